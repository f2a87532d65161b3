"""The chain may stand in for GTSAM while both agree to .01 degree and 3 % of every sigma."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.geometry.rotations import exp, log
from fgnav.graph.factors.array_phase import ArrayPhase
from fgnav.graph.factors.position import Position
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.multipath import Multipath
from fgnav.graph.types.constants import Constants, flight_constant
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.states import States
from fgnav.process import matern
from fgnav.solve import fixed_lag
from fgnav.solve.chain import window
from fgnav.solve.chain.batch import solve_batch
from tests.graph.factors.motions import EARTH_N_RADPS, GRAVITY_N_MPS2, sine

_AGREE_RAD, _AGREE_SIGMAS = np.radians(0.01), 0.03


@pytest.fixture(scope="module")
def flight():
    """Six seconds of swings of 20 degrees, keyframes at 10 Hz, attitudes to a quarter degree."""
    rng, motion = np.random.default_rng(20_007), sine(20.0)
    t_s = np.arange(61) / 10
    n, sigma_rad = len(t_s), 0.004
    true = motion.states(t_s, gyroscope=False, constants=np.zeros(3))
    constants = Constants((flight_constant("mean rate", ("x", "y", "z"), "rad/s", 15.0),))
    R_nb = true.R_nb @ exp(sigma_rad * rng.normal(size=(n, 3)))
    p_n_m = true.p_n_m + rng.normal(size=(n, 3))
    none = np.full(n, -1)
    phase = ArrayPhase(
        row=np.arange(n),
        root=np.tile(np.eye(9) / (np.sqrt(2) * sigma_rad), (n, 1, 1)),
        minimum=R_nb,
        element_column=none,
        constants=constants,
    )
    position = Position(
        row=np.arange(n),
        value_n_m=p_n_m,
        white=np.tile(np.eye(3), (n, 1, 1)),
        arm_b_m=np.array([0.3, 0.0, -0.1]),
        lever_column=-1,
        constants=constants,
    )
    rates = GyroFree(
        t_s=t_s,
        imu=motion.imu(6.0, 50.0, gyroscope=False),
        sub_steps=1,
        gravity_n_mps2=np.tile(GRAVITY_N_MPS2, (n, 1)),
        earth_rate_n_radps=EARTH_N_RADPS,
        poles_per_s=np.tile(matern.poles(2.0), (n - 1, 3, 1)),
        variance_rad2ps2=np.full((n - 1, 3), 0.12),
        accelerometer_noise=np.full(n - 1, 1e-6),
        rate_column=0,
        constants=constants,
    )
    return SmoothingProblem(
        t_s=t_s,
        start=States(R_nb, p_n_m, true.v_n_mps, np.zeros((n, 12)), np.zeros(3)),
        motion=rates,
        measurements=(phase, position),
        constants=constants,
        attitude_known=np.ones(n, bool),
    )


@pytest.mark.parametrize("keep", [False, True])
@pytest.mark.parametrize("method", ["solve_fixed_lag", "solve_forward"])
def test_window_agrees_with_gtsam(flight, method, keep):
    one, two = (
        getattr(of, method)(flight, 2.0, keep_linearisation=keep) for of in (window, fixed_lag)
    )
    # From a linearisation that is kept GTSAM moves positions by V(turn) step [Barfoot, 8.1.3], the
    # chain by the step itself: half of .01 rad times 3 m, where a sigma is .3 m.
    _agree(one, two, 0.1 if keep else _AGREE_SIGMAS)
    assert one.converged
    variances = (np.einsum("nii->ni", of.constant_covariance) for of in (one, two))
    np.testing.assert_allclose(*variances, rtol=2 * _AGREE_SIGMAS)


@pytest.mark.parametrize("method", ["solve_fixed_lag", "solve_forward"])
def test_window_agrees_beside_a_lasting_error_of_phases(flight, method):
    lasting = with_lasting(flight, 6)
    one, two = (getattr(of, method)(lasting, 2.0) for of in (window, fixed_lag))
    _agree(one, two)


def with_lasting(flight, size):
    """The same flight, half of its phases' variance an error that lasts for two seconds."""
    n, basis = len(flight.t_s), np.eye(9)[:, :size]
    error = Multipath(
        t_s=flight.t_s,
        basis=basis,
        share=np.full(n, 0.5),
        decay_per_s=np.full(n - 1, 0.5),
        kept=np.tile(np.eye(size), (n - 1, 1, 1)),
    )
    phase, position = flight.measurements
    aux = np.hstack([flight.start.aux, np.zeros((n, size))])
    return replace(
        flight,
        start=flight.start._replace(aux=aux),
        motion=replace(flight.motion, multipath=error),
        measurements=(replace(phase, share=error.share, basis=basis), position),
    )


def test_batch_is_where_a_window_over_all_of_it_ends(flight):
    _agree(solve_batch(flight), fixed_lag.solve_fixed_lag(flight, 100.0))


def _agree(one, two, sigmas=_AGREE_SIGMAS):
    turns = log(one.states.R_nb.swapaxes(1, 2) @ two.states.R_nb)
    assert np.linalg.norm(turns, axis=1).max() < _AGREE_RAD
    sigma, other = (np.sqrt(np.einsum("nii->ni", of.covariance)) for of in (one, two))
    np.testing.assert_allclose(sigma, other, rtol=_AGREE_SIGMAS)
    for name, part in (("p_n_m", slice(3, 6)), ("v_n_mps", slice(6, 9)), ("aux", slice(9, None))):
        apart = np.abs(getattr(one.states, name) - getattr(two.states, name))
        assert (apart / sigma[:, part]).max() < sigmas, name
