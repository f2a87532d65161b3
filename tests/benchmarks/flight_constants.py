"""Flights whose description is off: what that costs, and what is left once it is estimated.

``FLIGHT_CONSTANTS_FLIGHTS`` in the environment states how many flights of each kind (24).
"""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import exp, log, transpose
from fgnav.integers.resolvers.truth import attitude_at
from fgnav.methods.smoother import Batch
from fgnav.photodetector import line_of_sight
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight
from fgnav_sim.gnss.tables import Point
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.benchmarks._rows import Row, row

FLIGHTS = int(os.environ.get("FLIGHT_CONSTANTS_FLIGHTS", "24"))
SEED = 20_000  # the first; none that has chosen a constant of the library
BASE = Point(latitude_deg=40.36, longitude_deg=-3.90, height_m=700.0)
ANTENNA_M, LANDMARK_M, BORESIGHT_RAD = 0.03, 5.0, np.radians(1.0)
NAMES = tuple(
    f"{name}_{figure}"
    for name in ("antenna_off", "landmark_off", "boresight_off")
    for figure in ("rmse", "nees")
)


@dataclass(frozen=True, kw_only=True)
class Case:
    """One way to be off.

    Attributes
    ----------
    scenario : str
    words : tuple of str
        What is estimated; its priors are the size of the fault, as whoever doubts would state it.
    fault : callable
        Takes flight and generator; returns the flight as described, and what is to be estimated.
    """

    scenario: str
    words: tuple[str, ...]
    fault: Callable[[Flight, np.random.Generator], tuple[Flight, FloatArray]]


def antenna(flight: Flight, rng: np.random.Generator) -> tuple[Flight, FloatArray]:
    """Put the antenna on the nose elsewhere, 3 cm in each axis at one sigma."""
    shift_b_m = ANTENNA_M * rng.standard_normal(3)
    antennas = list(flight.antennas)
    antennas[3] = replace(antennas[3], position_b_m=antennas[3].position_b_m + shift_b_m)
    return replace(flight, antennas=tuple(antennas)), -shift_b_m


def landmark(flight: Flight, rng: np.random.Generator) -> tuple[Flight, FloatArray]:
    """Put the landmark elsewhere, 5 m in each axis at one sigma."""
    shift_n_m = LANDMARK_M * rng.standard_normal(3)
    place_n_m = flight.photodetector.landmark_n_m + shift_n_m
    return replace(
        flight, photodetector=replace(flight.photodetector, landmark_n_m=place_n_m)
    ), -shift_n_m


def boresight(flight: Flight, rng: np.random.Generator) -> tuple[Flight, FloatArray]:
    """Turn the detector, a degree about each axis at one sigma: its spots move on the detector.

    The calibration is the identity there, so that currents are told from spots exactly.
    """
    turn_b_rad = np.array([0.0, *(BORESIGHT_RAD * rng.standard_normal(2))])
    photodetector, seen = flight.photodetector, line_of_sight(flight.photodetector)
    e_d = seen.e_b @ exp(turn_b_rad[None])[0]
    spot = photodetector.focal_length_m * e_d[:, 1:] / e_d[:, :1] / photodetector.detector_radius_m
    currents = np.exp(np.stack([spot[:, 1], 0 * spot[:, 0], 0 * spot[:, 0], spot[:, 0]], axis=1))
    part = replace(
        photodetector,
        t_s=seen.t_s,
        currents=currents,
        calibration=np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]),
    )
    within = np.linalg.norm(spot, axis=1) < 1
    part = replace(part, t_s=part.t_s[within], currents=part.currents[within])
    return replace(flight, photodetector=part), turn_b_rad[1:]


CASES = {
    "antenna_off": Case(scenario="demo", words=(f"antenna:a4={ANTENNA_M}",), fault=antenna),
    "landmark_off": Case(scenario="approach", words=(f"landmark={LANDMARK_M}",), fault=landmark),
    "boresight_off": Case(scenario="approach", words=("boresight=1",), fault=boresight),
}


def run(count: int = FLIGHTS) -> list[Row]:
    """Return, for each way, RMS errors against the flight rightly described, and the NEES."""
    rows = []
    for name, case in CASES.items():
        figures = np.array(list(flown(case, count)))
        right, wrong, ours = np.sqrt((figures[:, :3] ** 2).mean(axis=0))
        squared, within, size = figures[:, 3].mean(), figures[:, 4].mean(), figures[0, 5]
        note = (
            f"{count} flights of {case.scenario}, {' '.join(case.words)}; peer: rightly described"
        )
        note += f"; described wrongly and not estimated {wrong:.4f} deg"
        rows.append(row(f"{name}_rmse", ours, right, "deg", note, less=True))
        note = f"mean squared error of what is estimated over its covariance; peer: its {size:.0f} "
        note += f"dimensions; within 3 sigma in every axis: {100 * within:.0f} % of flights"
        rows.append(row(f"{name}_nees", squared, size, "", note, less=True))
    return rows


def flown(case: Case, count: int) -> Iterator[tuple[float, ...]]:
    """Yield RMS angles of the three estimates, NEES and 3-sigma hit of the constant, its size."""
    scenario = load_scenario(case.scenario)
    if case.scenario == "demo":
        scenario = msgspec.structs.replace(scenario, duration_s=20.0)
    if case.fault is landmark:  # else positions have metres in common, which hide where it is
        gnss = msgspec.structs.replace(scenario.gnss, base=BASE)
        scenario = msgspec.structs.replace(scenario, gnss=gnss)
    for seed in range(SEED, SEED + count):
        flight = simulate(scenario, np.random.default_rng(seed))
        described, truth = case.fault(flight, np.random.default_rng([seed, 1]))
        estimated = Batch(estimate=case.words)(described)
        (constant,) = estimated.constants
        error = constant.value - truth
        sigma = np.sqrt(np.diag(constant.covariance))
        estimates = (Batch()(flight), Batch()(described), estimated)
        yield (
            *(rms_deg(flight, estimate) for estimate in estimates),
            float(error @ np.linalg.solve(constant.covariance, error)),
            float((np.abs(error) < 3 * sigma).all()),
            float(len(error)),
        )


def rms_deg(flight: Flight, estimate: Estimate) -> float:
    """Return the RMS angle of an estimate to the truth."""
    R_nb, _ = attitude_at(flight.truth, estimate.t_s)
    angles = log(transpose(estimate.R_nb) @ R_nb)
    return float(np.degrees(np.sqrt((angles**2).sum(axis=1).mean())))
