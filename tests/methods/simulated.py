"""Flights of the gallery's scenarios, shortened, in memory."""

from functools import cache
from pathlib import Path

import msgspec
import numpy as np

from fgnav.geometry import rotations
from fgnav.integers.resolvers.truth import attitude_at
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

MOST = 8  # problems that are kept
SCENARIOS = Path(__file__).resolve().parents[2] / "sim" / "fgnav_sim" / "scenarios"


@cache
def flown(name, span_s=20.0, seed=1, imu_position_b_m=None):
    """Return the flight of a scenario; the same object for the same arguments."""
    scenario = msgspec.structs.replace(load_scenario(SCENARIOS / f"{name}.toml"), duration_s=span_s)
    if imu_position_b_m is not None:
        imu = msgspec.structs.replace(scenario.imu, position_b_m=imu_position_b_m)
        scenario = msgspec.structs.replace(scenario, imu=imu)
    return simulate(scenario, np.random.default_rng(seed))


def flown_with(name, span_s, *, seed=1, **gnss):
    """Return a flight of a scenario whose receivers differ."""
    scenario = load_scenario(SCENARIOS / f"{name}.toml")
    changed = msgspec.structs.replace(scenario.gnss, **gnss)
    scenario = msgspec.structs.replace(scenario, duration_s=span_s, gnss=changed)
    return simulate(scenario, np.random.default_rng(seed))


_problems = {}  # by what decides them; the last few


def prepared_of(method, flight):
    """Return a method's problem, the same for methods that agree in it."""
    decides = method.preparation, method.causal and method.lag_s, flight
    if decides not in _problems:
        if len(_problems) == MOST:
            del _problems[next(iter(_problems))]
        _problems[decides] = method.prepare(flight)
    return _problems[decides]


def shared(method, flight):
    """Return a method's estimate, its problem shared with methods that agree in it."""
    return method.estimate_prepared(flight, prepared_of(method, flight))


def errors_rad(flight, estimate):
    """Body tangents from estimate to truth, (n, 3)."""
    R_nb, covered = attitude_at(flight.truth, estimate.t_s)
    assert covered.all()
    return rotations.log(rotations.transpose(estimate.R_nb) @ R_nb)


def euler_rmse_deg(flight, estimate):
    R_nb, _ = attitude_at(flight.truth, estimate.t_s)
    change = rotations.to_euler(estimate.R_nb) - rotations.to_euler(R_nb)
    return np.degrees(np.sqrt((rotations.wrap(change) ** 2).mean(axis=0)))


def nees(error, covariance):
    return np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error).mean()
