from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError, NoSolutionError
from fgnav.geometry import rotations
from fgnav.integers.resolvers.truth import Truth
from fgnav.methods import method_named
from fgnav.methods.rtk import Rtk
from fgnav.types.flight import GnssNoise
from fgnav_sim.gnss.tables import GnssTable
from fgnav_sim.motion import Arc, Motion, Sine
from fgnav_sim.scenario import Scenario
from fgnav_sim.simulate import simulate

LIVELY = Motion(
    path=Arc(speed_mps=100.0, radius_m=800.0),
    roll=Sine(amplitude_deg=20.0),
    pitch=Sine(amplitude_deg=20.0),
    yaw=Sine(amplitude_deg=20.0),
)
BOTH = {"G": ("1C",), "E": ("1C",)}
COMPACT_B_M = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.8, 0.0), (-0.6, 0.1, 0.5))


def flown(antennas_b_m=COMPACT_B_M, *, seed=6, signals=BOTH):
    gnss = GnssTable(rate_hz=10.0, signals=signals, code_noise_m=0.3)
    scenario = Scenario(duration_s=30.0, motion=LIVELY, gnss=gnss, antennas_b_m=antennas_b_m)
    return simulate(scenario, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def flight():
    return flown()


@pytest.fixture(scope="module")
def estimate(flight):
    return Rtk()(flight)


def errors_rad(flight, estimate):
    row = np.searchsorted(flight.truth.t_s, estimate.t_s - 1e-6)
    return rotations.log(estimate.R_nb.swapaxes(1, 2) @ flight.truth.R_nb[row])


def test_most_epochs_are_fixed_and_good_to_a_fraction_of_a_degree(flight, estimate):
    assert estimate.available > 0.85  # the ratio test turns the rest away
    rmse_deg = np.degrees(np.sqrt((errors_rad(flight, estimate) ** 2).mean(axis=0)))
    assert (rmse_deg < 0.8).all()  # 3 mm of phase over arms of 1 m, some dilution


def test_attitude_errors_meet_their_covariance(flight, estimate):
    error = errors_rad(flight, estimate)
    P = estimate.attitude_covariance_rad2
    nees = np.einsum("ni,ni->n", error, np.linalg.solve(P, error[..., None])[..., 0])
    assert nees.mean() == pytest.approx(3.0, abs=5 * np.sqrt(6 / len(nees)))


def test_it_keeps_its_own_integers_when_made_by_name(flight):
    method = method_named("rtk", Truth())
    estimate = method(flight)
    assert (estimate.method, estimate.integers.resolver) == ("rtk", "lambda")
    assert any("whatever resolver was asked" in note for note in estimate.notes)


def test_accepted_baselines_pass_the_ratio_test(estimate):
    fixed = estimate.integers.fixed.any(axis=2)
    assert (estimate.integers.ratio[fixed] >= 3.0).all()


def test_two_antennas_leave_roll_open_with_the_variance_of_a_uniform_angle():
    flight = flown(((0.0, 0.0, 0.0), (1.6, 0.0, 0.0)))
    estimate = Rtk()(flight)
    assert estimate.unobservable == ("roll",)
    np.testing.assert_allclose(rotations.to_euler(estimate.R_nb)[:, 0], 0, atol=1e-9)
    P = estimate.attitude_covariance_rad2
    np.testing.assert_allclose(P[:, 0, 0], np.pi**2 / 3, rtol=1e-9)
    row = np.searchsorted(flight.truth.t_s, estimate.t_s - 1e-6)
    nose = estimate.R_nb[:, :, 0] - flight.truth.R_nb[row, :, 0]
    across = np.einsum("nji,nj->ni", estimate.R_nb, nose)[:, 1:]
    # The nose moves by (.., delta_z, -delta_y): variances of z and y.
    variance = P[:, [2, 1], [2, 1]]
    assert (across**2 / variance).mean() == pytest.approx(1.0, abs=0.3)


def test_epochs_that_fail_the_ratio_test_are_counted():
    weak = flown(signals={"G": ("1C",)})
    # Code that claims far too much noise makes every float solution weak.
    weak = replace(weak, gnss_noise=GnssNoise(code_m=3.0, phase_m=0.003))
    estimate = Rtk(ratio_min=2.0)(weak)
    lost = sum(loss.count for loss in estimate.unused if loss.what == "epoch")
    assert lost > 0
    assert lost + len(estimate.t_s) == estimate.n_epochs


def test_no_epoch_past_the_ratio_test_is_no_solution(flight):
    with pytest.raises(NoSolutionError, match="attitude: no two baselines out of line are f"):
        Rtk(ratio_min=1e9)(flight)


def test_a_single_antenna_is_no_solution():
    single = flown(((0.0, 0.0, 0.0),))
    with pytest.raises(NoSolutionError, match="needs raw data of two antennas"):
        Rtk()(single)


def test_a_ratio_below_one_is_rejected():
    with pytest.raises(BadInputError, match=r"rtk ratio_min: must be 1 or more, got 0\.5"):
        Rtk(ratio_min=0.5)
