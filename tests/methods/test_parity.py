"""The compiled chain may stand in for GTSAM while both agree: every method, option, kind of flight.

Within 0.01 degree, or 3 % of a sigma where that is more, and 3 % of every sigma, root mean square
over a flight: both relinearise and marginalise by one rule (``solve.sliding.relinearisation``).
Keyframes whose attitude either does not know are left out: they are relinearised by half a turn,
where the last digits decide.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from types import SimpleNamespace

import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.geometry.rotations import log, transpose
from fgnav.gravity import LowDynamics
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav.solve.sliding.relinearisation import UNKNOWN_RAD
from fgnav_sim.simulate import simulate
from tests.frontend.array.test_float_arcs import Cut, flown_without_integers
from tests.methods.simulated import shared
from tests.methods.test_truncation import OUTAGE, SPAN_S, scenario
from tests.methods.true_gravity import TrueGravity

AGREE_DEG, AGREE_SIGMAS, SIGMAS_AGREE = 0.01, 0.03, 0.03
VECTORS = {
    "p_n_m": "position_covariance_m2",
    "v_n_mps": "velocity_covariance_m2ps2",
    "accelerometer_bias_mps2": "accelerometer_bias_covariance_m2ps4",
}


@dataclass(frozen=True)
class Case:
    """A scenario, what is asked of the methods, and how often they state anything."""

    scenario: object
    options: dict = field(default_factory=dict)
    rate_hz: float | None = None


SIGHT = scenario("terminal", SPAN_S, range_m=9000.0)
SURROUNDINGS = scenario("surroundings", 15.0)
CASES = {
    "demo": Case(scenario("demo", SPAN_S)),
    "rough": Case(scenario("rough", SPAN_S)),
    "spin": Case(scenario("spin", SPAN_S)),
    "gyroscope": Case(scenario("demo", SPAN_S, gyroscope=True)),
    "one epoch a second": Case(scenario("demo", SPAN_S, rate_hz=1.0)),
    "outage": Case(scenario("demo", SPAN_S, outages=(OUTAGE,))),
    "landmark": Case(SIGHT, {"estimate": ("landmark",)}),
    "boresight": Case(SIGHT, {"estimate": ("boresight",)}),
    "lever-arm": Case(scenario("demo", SPAN_S), {"estimate": ("lever-arm",)}),
    "lever-arm, gyroscope": Case(
        scenario("demo", SPAN_S, gyroscope=True), {"estimate": ("lever-arm",)}
    ),
    "antennas": Case(scenario("demo", SPAN_S), {"estimate": ("antennas",)}),
    "barometer and hard iron": Case(SURROUNDINGS),
    "gravity": Case(scenario("demo", SPAN_S), {"gravity": TrueGravity(), "estimate": ("gravity",)}),
    "gravity without phase": Case(scenario("six", SPAN_S, fixes=True), {"gravity": TrueGravity()}),
    "low dynamics": Case(scenario("ramp", SPAN_S), {"gravity": LowDynamics()}),
    "fixes and gyroscope": Case(scenario("six", 15.0, fixes=True, gyroscope=True)),
    "float arcs": Case(None, {"resolver": Cut()}),
    "states between epochs": Case(scenario("demo", SPAN_S), rate_hz=25.0),
}
METHODS = {
    "smoother": Smoother(lag_s=2.0, noise="stated"),
    "forward": Forward(noise="stated"),
    "batch": Batch(noise="stated"),
}


def solved(which, name):
    """Return what GTSAM and the chain make of a case, of one problem where there is one."""
    case, flight = CASES[which], flight_of(which)
    both = [replace(METHODS[name], solver=solver, **case.options) for solver in ("gtsam", "chain")]
    if case.rate_hz is not None:
        return [one.at(flight, rate_hz=case.rate_hz) for one in both]
    return [shared(one, flight) for one in both]


@lru_cache(maxsize=4)
def flight_of(which):
    if CASES[which].scenario is None:
        return flown_without_integers()
    return simulate(CASES[which].scenario, np.random.default_rng(20_001))


def rms(values):
    return float(np.sqrt((np.asarray(values) ** 2).mean()))


def sigmas(covariance):
    return np.sqrt(np.einsum("nii->ni", covariance))


# Forward has no gravity that is drawn about the truth of a whole flight.
PAIRS = [
    (which, name)
    for which, case in CASES.items()
    for name in METHODS
    if name != "forward" or not isinstance(case.options.get("gravity"), TrueGravity)
]


@pytest.mark.parametrize(("which", "name"), PAIRS)
def test_gtsam_and_the_chain_agree(which, name):
    gtsam, chain = solved(which, name)
    assert gtsam.converged == chain.converged
    for what, figures in apart(gtsam, chain).items():
        for figure, limit in zip(figures, (AGREE_SIGMAS, SIGMAS_AGREE), strict=True):
            assert figure < limit, what


@pytest.mark.parametrize("name", METHODS)
def test_both_refuse_a_flight_without_a_turn(name):
    """One antenna, no gyroscope: where no solution is, neither has one."""
    flight = simulate(scenario("six", 4.0, fixes=True), np.random.default_rng(20_001))
    still = np.broadcast_to(flight.fixes[0].p_n_m[0], flight.fixes[0].p_n_m.shape)
    fixes = replace(flight.fixes[0], p_n_m=still, v_n_mps=None, velocity_sigma_mps=None)
    for solver in ("gtsam", "chain"):
        with pytest.raises(NoSolutionError):
            replace(METHODS[name], solver=solver)(replace(flight, fixes=(fixes,)))


def of_rows(estimate, rows):
    names = ("R_nb", "attitude_covariance_rad2", *VECTORS, *VECTORS.values())
    arrays = {name: getattr(estimate, name)[rows] for name in names}
    return SimpleNamespace(**arrays, constants=estimate.constants)


def apart(one, other):
    """Return how far apart two estimates and their sigmas are, in sigmas, by what is estimated."""
    _, i, j = np.intersect1d(one.t_s.round(6), other.t_s.round(6), return_indices=True)
    both = np.maximum(
        sigmas(one.attitude_covariance_rad2)[i], sigmas(other.attitude_covariance_rad2)[j]
    )
    known = (both < UNKNOWN_RAD).all(axis=1)
    assert known.mean() > 0.45
    one, other = of_rows(one, i[known]), of_rows(other, j[known])
    sigma = sigmas(other.attitude_covariance_rad2)
    turn = log(transpose(one.R_nb) @ other.R_nb)
    floor = np.radians(AGREE_DEG) / AGREE_SIGMAS  # 0.01 degree counts as three hundredths
    found = {
        "attitude": (
            rms(turn) / max(rms(sigma), floor),
            rms(sigmas(one.attitude_covariance_rad2) / sigma - 1),
        )
    }
    for name, covariance in VECTORS.items():
        sigma = sigmas(getattr(other, covariance))
        found[name] = (
            rms((getattr(one, name) - getattr(other, name)) / sigma),
            rms(sigmas(getattr(one, covariance)) / sigma - 1),
        )
    for a, b in zip(one.constants, other.constants, strict=True):
        sigma = np.sqrt(np.diag(b.covariance))
        found[b.name] = (
            rms((a.value - b.value) / sigma),
            rms(np.sqrt(np.diag(a.covariance)) / sigma - 1),
        )
    return found
