"""Phases without integers: as good as ambiguities that are states, and what a flight gains."""

import dataclasses

import msgspec
import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav import rotations
from fgnav.attitude.quadratic import RotationQuadratic, tangent_jacobian
from fgnav.integers.resolve import resolve
from fgnav.integers.truth import Truth
from fgnav.methods.smoother import links
from fgnav.methods.smoother.chain import STATE
from fgnav.methods.smoother.collect import Settings, collect
from fgnav.methods.smoother.float_arcs import ELEMENTS, _adjusted
from fgnav.methods.smoother.link_kernel import linearise, move
from fgnav.methods.smoother.smoother import Batch, GtsamBatch, Smoother
from fgnav_sim.receiver_tables import OutageTable
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.attitude.arrays import sky, synthetic
from tests.methods.simulated import SCENARIOS, errors_rad, nees

ANTENNAS_B_M = np.array([[0.0, 0, 0], [1.0, 0, 0], [0, 0.5, 0], [0.1, 0.1, -0.4]])
WITHOUT_S = (5.0, 9.0)
BLIND_S = 0.25  # before that, so that arcs are new ones


@dataclasses.dataclass(frozen=True)
class Cut:
    """True integers, none of them in a span of time."""

    name: str = "cut"

    def __call__(self, differences, flight):
        true = Truth()(differences, flight)
        inside = (differences.t_s >= WITHOUT_S[0]) & (differences.t_s < WITHOUT_S[1])
        fixed = true.fixed & ~inside[:, None, None]
        return dataclasses.replace(true, fixed=fixed, cycles=np.where(fixed, true.cycles, 0))


@pytest.fixture(scope="module")
def flight():
    """All arcs begin anew at 5 and at 9 s; none that lives in between is ever fixed."""
    scenario = load_scenario(SCENARIOS / "six.toml")
    outages = tuple(OutageTable(from_s=t - BLIND_S, until_s=t) for t in WITHOUT_S)
    gnss = msgspec.structs.replace(scenario.gnss, outages=outages)
    scenario = msgspec.structs.replace(scenario, duration_s=13.0, gnss=gnss)
    return simulate(scenario, np.random.default_rng(3))


def settings(**more):
    return Settings(
        resolver=Cut(),
        gravity=None,
        angular_acceleration_density=None,
        sub_steps=2,
        false_alarm=1e-4,
        **more,
    )


def test_nine_elements_are_worth_all_ambiguities():
    """Information on attitudes, brute force with a state for each ambiguity against the form."""
    rng = np.random.default_rng(0)
    R_nb = rotations.exp(0.4 * rng.standard_normal((4, 3)))
    differences, true = synthetic(R_nb, sky(5, rng), rng, antennas_b_m=ANTENNAS_B_M)
    ranges_m = differences.phase_m - differences.wavelength_m * true.cycles
    form, J = RotationQuadratic.of_ranges(differences, ranges_m), tangent_jacobian(R_nb)
    n, u = 3 * len(R_nb), 3 * len(R_nb) + ELEMENTS
    ours = np.eye(u) * 1e-9
    wanted = differences.resolvable[0]
    ambiguities = int(wanted.sum())
    whole = np.zeros((n + ambiguities, n + ambiguities))
    for k, W in enumerate(form.information):
        D = np.zeros((ELEMENTS, u))
        D[:, 3 * k : 3 * k + 3], D[:, n:] = J[k], np.eye(ELEMENTS)
        ours += D.T @ W @ D
        E = np.zeros((ambiguities, n + ambiguities))
        for axis, step in enumerate(1e-6 * np.eye(3)):
            ahead, back = (
                differences.array_m(R_nb @ rotations.exp(s[None])) for s in (step, -step)
            )
            E[:, 3 * k + axis] = (ahead - back)[k][wanted] / 2e-6
        E[:, n:] = np.eye(ambiguities)
        covariance = differences.covariance(k, wanted, differences.phase_variance_m2)
        whole += E.T @ np.linalg.solve(covariance, E)

    def of_attitudes(N):
        return N[:n, :n] - N[:n, n:] @ np.linalg.pinv(N[n:, n:], rcond=1e-12) @ N[n:, :n]

    assert_allclose(of_attitudes(ours), of_attitudes(whole), rtol=1e-5, atol=1e-6 * whole.max())


def test_attitudes_beside_what_they_share_are_found_from_far_off():
    rng = np.random.default_rng(1)
    R_nb = rotations.exp(0.5 * rng.standard_normal((40, 3)))
    differences, true = synthetic(R_nb, sky(6, rng), rng, antennas_b_m=ANTENNAS_B_M)
    ranges_m = differences.phase_m - differences.wavelength_m * true.cycles
    turn = rotations.exp(np.full((1, 3), 0.1))
    off_m = (differences.array_m(R_nb @ turn) - differences.array_m(R_nb))[0]
    form = RotationQuadratic.of_ranges(differences, ranges_m + off_m)
    found = _adjusted(form, R_nb @ turn)
    error_rad = rotations.log(rotations.transpose(found) @ R_nb)
    assert np.sqrt((error_rad**2).mean()) < np.radians(0.5)


def test_float_rows_and_their_derivatives_agree_with_finite_differences(flight):
    keyframes = collect(flight, settings()).keyframes
    row = int(np.flatnonzero(keyframes.array.floating >= 0)[5])
    rng = np.random.default_rng(2)
    states, senses = links.states_of(keyframes), links.senses_of(keyframes)
    states.constants[:] = 0.01 * rng.standard_normal(len(states.constants))
    n, b = len(keyframes.t_s), len(states.constants)
    motions, prior = links.empty_motions(n), links.prior_of(keyframes)
    link = np.zeros((n, 2 * STATE + b + 1, 2 * STATE + b + 1))

    def cost(step):
        moved = states.copied()
        steps = np.zeros((1, STATE + b))
        steps[0] = step
        move(states, steps, row, moved, row, wholly=True)
        moved.constants[:] = states.constants + step[STATE:]
        linearise(link, moved, motions, senses, prior, np.array([row]), -1)
        return link[row, -1, -1]

    cost(np.zeros(STATE + b))
    slope = -2 * link[row, STATE:-1, -1].copy()
    numeric = np.array([(cost(d) - cost(-d)) / 2e-5 for d in 1e-5 * np.eye(STATE + b)])
    assert np.abs(slope[STATE:]).max() > 0
    assert_allclose(numeric, slope, rtol=1e-6, atol=1e-6 * np.abs(slope).max())


@pytest.mark.parametrize("method", [Batch(resolver=Cut()), Smoother(resolver=Cut())])
def test_attitude_is_held_without_a_single_integer(flight, method):
    estimate = method(flight)
    error_rad = errors_rad(flight, estimate)
    inside = (estimate.t_s >= WITHOUT_S[0]) & (estimate.t_s < WITHOUT_S[1])
    assert estimate.converged
    assert np.degrees(np.sqrt((error_rad[inside] ** 2).sum(axis=1).mean())) < 0.4
    assert nees(error_rad[inside], estimate.attitude_covariance_rad2[inside]) < 6
    assert any("Float ambiguities: 35 arcs" in note for note in estimate.notes)
    assert not estimate.constants


def test_without_them_nothing_is_known_there(flight):
    keyframes = collect(flight, settings(own_factors=False)).keyframes
    inside = (keyframes.t_s >= WITHOUT_S[0]) & (keyframes.t_s < WITHOUT_S[1] - 0.01)
    assert keyframes.array.floating is None
    assert not keyframes.constants
    strength = np.linalg.norm(keyframes.array.root[inside], axis=(1, 2))
    assert strength.max() < 1e-2 * np.linalg.norm(keyframes.array.root[0])


def test_gtsam_does_without(flight):
    method = GtsamBatch(resolver=Cut())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fgnav.methods.smoother.smoother.collect", _stop)
        with pytest.raises(_StoppedError) as stopped:
            method(flight)
    assert not stopped.value.settings.own_factors


class _StoppedError(Exception):
    def __init__(self, settings):
        super().__init__()
        self.settings = settings


def _stop(_, settings):
    raise _StoppedError(settings)


def test_epochs_with_integers_stay_as_they_are(flight):
    resolve(flight, Truth())
    whole = dataclasses.replace(settings(), resolver=Truth())
    assert collect(flight, whole).keyframes.array.floating is None


def test_stretches_keep_the_usual_intensity(flight):
    """Where they begin is known to a degree: told by them, the body would seem to jump about."""
    keyframes = collect(flight, settings()).keyframes
    pre, floating = keyframes.preintegrate, keyframes.array.floating >= 0
    inside = floating[1:] & floating[:-1]
    assert_allclose(
        pre.density[inside],
        np.tile(pre.angular_acceleration_density, (inside.sum(), 1)),
        rtol=1e-12,
    )
    assert not (keyframes.array.sure & floating).any()
