"""Phases without integers: as good as ambiguities that are states, and what a problem has of them.

The flight's figures are those of its own seed; nothing is tuned on it.
"""

import dataclasses

import msgspec
import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.alignment.array.float_arcs import ELEMENTS, _adjusted
from fgnav.assembly import motion
from fgnav.assembly.calibration_request import calibration_requests
from fgnav.assembly.problem import build_problem
from fgnav.assembly.settings import ProblemSettings
from fgnav.attitude.quadratic import RotationQuadratic, tangent_jacobian
from fgnav.geometry import rotations
from fgnav.graph.factors.array_phase import FLOAT_AMBIGUITIES
from fgnav.integers.resolvers.truth import Truth, attitude_at
from fgnav.process.hyperparameters import RatePrior
from fgnav_sim.gnss.tables import OutageTable
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.attitude.arrays import sky, synthetic
from tests.integers.arrays import link_covariance
from tests.methods.simulated import SCENARIOS

ANTENNAS_B_M = np.array([[0.0, 0, 0], [1.0, 0, 0], [0, 0.5, 0], [0.1, 0.1, -0.4]])
WITHOUT_S = (5.0, 9.0)
BLIND_S = 0.25  # before that, so that arcs are new ones
PRIOR = RatePrior(length_s=1.0, variance_rad2ps2=np.full(3, 0.1), evidence=0.0)


@dataclasses.dataclass(frozen=True)
class Cut:
    """True integers, none of them in a span of time."""

    name: str = "cut"

    def __call__(self, differences, flight):
        true = Truth()(differences, flight)
        inside = (differences.t_s >= WITHOUT_S[0]) & (differences.t_s < WITHOUT_S[1])
        fixed = true.fixed & ~inside[:, None, None]
        return dataclasses.replace(true, fixed=fixed, cycles=np.where(fixed, true.cycles, 0))


def flown_without_integers():
    """All arcs begin anew at 5 and at 9 s; none that lives in between is ever fixed."""
    scenario = load_scenario(SCENARIOS / "six.toml")
    outages = tuple(OutageTable(from_s=t - BLIND_S, until_s=t) for t in WITHOUT_S)
    gnss = msgspec.structs.replace(scenario.gnss, outages=outages)
    scenario = msgspec.structs.replace(scenario, duration_s=13.0, gnss=gnss)
    return simulate(scenario, np.random.default_rng(3))


@pytest.fixture(scope="module")
def flight():
    return flown_without_integers()


@pytest.fixture(scope="module")
def prepared(flight):
    return build_problem(flight, ProblemSettings(resolver=Cut(), rate_prior=PRIOR))


def array_of(prepared):
    return next(m for m in prepared.problem.sensors if m.name == "array phases")


def inside(t_s):
    return (t_s >= WITHOUT_S[0]) & (t_s < WITHOUT_S[1] - BLIND_S)


def test_nine_elements_are_worth_all_ambiguities():
    """Information on attitudes, brute force with a state for each ambiguity against the form."""
    rng = np.random.default_rng(0)
    R_nb = rotations.exp(0.4 * rng.standard_normal((4, 3)))
    differences, true = synthetic(R_nb, sky(5, rng), rng, antennas_b_m=ANTENNAS_B_M)
    ranges_m = differences.phase_m - differences.wavelength_m * true.cycles
    form, J = RotationQuadratic.of_ranges(differences, ranges_m), tangent_jacobian(R_nb)
    n, u = 3 * len(R_nb), 3 * len(R_nb) + ELEMENTS
    by_elements = np.eye(u) * 1e-9
    wanted = differences.resolvable[0]
    ambiguities = int(wanted.sum())
    by_ambiguities = np.zeros((n + ambiguities, n + ambiguities))
    for k, W in enumerate(form.information):
        D = np.zeros((ELEMENTS, u))
        D[:, 3 * k : 3 * k + 3], D[:, n:] = J[k], np.eye(ELEMENTS)
        by_elements += D.T @ W @ D
        E = np.zeros((ambiguities, n + ambiguities))
        for axis, step in enumerate(1e-6 * np.eye(3)):
            ahead, back = (
                differences.array_m(R_nb @ rotations.exp(s[None])) for s in (step, -step)
            )
            E[:, 3 * k + axis] = (ahead - back)[k][wanted] / 2e-6
        E[:, n:] = np.eye(ambiguities)
        covariance = link_covariance(differences, k, wanted, differences.phase_variance_m2)
        by_ambiguities += E.T @ np.linalg.solve(covariance, E)

    def of_attitudes(N):
        return N[:n, :n] - N[:n, n:] @ np.linalg.pinv(N[n:, n:], rcond=1e-12) @ N[n:, :n]

    assert_allclose(
        of_attitudes(by_elements),
        of_attitudes(by_ambiguities),
        rtol=1e-5,
        atol=1e-6 * by_ambiguities.max(),
    )


def test_attitudes_beside_what_they_share_are_estimated_from_far_off():
    rng = np.random.default_rng(1)
    R_nb = rotations.exp(0.5 * rng.standard_normal((40, 3)))
    differences, true = synthetic(R_nb, sky(6, rng), rng, antennas_b_m=ANTENNAS_B_M)
    ranges_m = differences.phase_m - differences.wavelength_m * true.cycles
    turn = rotations.exp(np.full((1, 3), 0.1))
    off_m = (differences.array_m(R_nb @ turn) - differences.array_m(R_nb))[0]
    form = RotationQuadratic.of_ranges(differences, ranges_m + off_m)
    adjusted = _adjusted(form, R_nb @ turn)
    error_rad = rotations.log(rotations.transpose(adjusted) @ R_nb)
    assert np.sqrt((error_rad**2).mean()) < np.radians(0.5)


def test_epochs_without_integers_share_nine_constants_and_know_their_attitude(flight, prepared):
    problem, array = prepared.problem, array_of(prepared)
    shared = array.stretch >= 0
    np.testing.assert_array_equal(shared, inside(problem.t_s[array.row]))
    first = problem.constants.column(FLOAT_AMBIGUITIES)
    assert not array.stretch[shared].any()
    assert problem.constants.columns(FLOAT_AMBIGUITIES) == slice(first, first + ELEMENTS)
    (constant,) = (one for one in problem.constants.parts if one.name == FLOAT_AMBIGUITIES)
    assert constant.linear
    assert not constant.reported
    assert any("Float ambiguities: 35 arcs" in note for note in prepared.notes)
    rows = array.row
    assert problem.attitude_known[rows[shared]].all()
    R_nb, _ = attitude_at(flight.truth, problem.t_s[rows])
    error_rad = rotations.log(rotations.transpose(problem.start.R_nb[rows]) @ R_nb)
    # All of them are off alike by where the stretch is thought to begin: a degree. Beside that,
    # and what its elements turn with the attitude, they err as epochs with integers do.
    assert np.linalg.norm(error_rad[shared].mean(axis=0)) < np.radians(2.0)
    spread = [np.linalg.norm(error_rad[part].std(axis=0)) for part in (shared, ~shared)]
    assert spread[0] < 1.2 * spread[1]


def test_epochs_with_integers_have_no_such_constants(flight):
    prepared = build_problem(flight, ProblemSettings(resolver=Truth(), rate_prior=PRIOR))
    assert (array_of(prepared).stretch == -1).all()
    assert prepared.problem.constants.column(FLOAT_AMBIGUITIES) == -1


def test_where_antennas_are_estimated_such_epochs_take_no_part(flight):
    """Nine elements for the rotation would not do: places in the body are unknown, too."""
    requests = calibration_requests(("antenna:a4",))
    settings = ProblemSettings(resolver=Cut(), rate_prior=PRIOR, calibration=requests)
    problem = build_problem(flight, settings).problem
    assert problem.constants.column(FLOAT_AMBIGUITIES) == -1
    assert not problem.attitude_known[inside(problem.t_s)].any()


def test_the_rate_prior_is_not_identified_from_such_epochs(flight, monkeypatch):
    """Where they begin is known to a degree: by them the body would seem to jump about."""
    times = []

    def recorded(t_s, R_nb, covariance_rad2, *, swings):
        assert swings
        times.append(t_s)
        assert len(t_s) == len(R_nb) == len(covariance_rad2)
        return PRIOR

    monkeypatch.setattr(motion, "rate_prior", recorded)
    build_problem(flight, ProblemSettings(resolver=Cut()))
    (t_s,) = times
    assert len(t_s) > 50
    assert not inside(t_s).any()
