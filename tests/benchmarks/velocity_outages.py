"""What a velocity network is worth where GNSS is lost: simulated vehicles, a car, a quadrotor.

Position errors within outages of 5, 15 and 30 s, with and without the factor, the same flights in
pairs; intervals of 95 % by outage. Of filters, which do not know an outage's end, its first
seconds. ``VELOCITY_FLIGHTS`` states how many flights of each kind (8).
"""

import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.geometry.interpolation import interpolate
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav.neural import NeuralFactor
from fgnav.neural.calibration import calibration
from fgnav.neural.records import Record
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight
from fgnav_models.runtime.factors import manifest
from fgnav_models.training.velocity.vehicles.track import Track
from fgnav_models.training.velocity.vehicles.world import KINDS, VehiclesWorld, vehicle_scenario
from fgnav_sim.scenario import FixesTable
from fgnav_sim.simulate import simulate
from tests.benchmarks import car
from tests.benchmarks._rows import DATA, Row, row
from tests.recordings import drive, quadrotor

NAMES = tuple(f"velocity_outage_{s}_s" for s in (5, 15, 30))
FLIGHTS = int(os.environ.get("VELOCITY_FLIGHTS", "8"))
LENGTHS_S = (5.0, 15.0, 30.0)
SEED, FLIGHT_S, FIRST_S = 20_099, 90.0, 45.0
FIXES = FixesTable(rate_hz=4.0, position_noise_m=0.05, velocity_noise_mps=0.05)
RATE_HZ = 100.0  # of the network
CLOCK_S = -0.42  # of the quadrotor's unit, to be added: README of the recording
DRAWS = 2000


@dataclass(frozen=True, kw_only=True)
class Case:
    """A flight that loses GNSS in spans, (k, 2) s, and where it was then."""

    kind: str
    flight: Flight
    lost_s: FloatArray
    judge_s: FloatArray
    judge_n_m: FloatArray
    records: dict[str, Record]


def cases(length_s: float, count: int = FLIGHTS, seed: int = SEED) -> Iterator[Case]:
    """Yield flights that lose GNSS for so long."""
    world = VehiclesWorld(flight_s=FLIGHT_S)
    for k, kind in enumerate(KINDS):
        for rng in np.random.default_rng([seed, k]).spawn(count):
            scenario = vehicle_scenario(world, kind, rng, fixes=FIXES)
            flight = shaken(simulate(scenario, rng), scenario.motion)
            spans = np.array([[FIRST_S, FIRST_S + length_s]])
            yield _case(kind, flight, spans, flight.truth.t_s, flight.truth.p_n_m, {})
    if DATA.is_dir():
        flight = drive(DATA)
        first = np.arange(car.FIRST_S, flight.fixes[0].t_s[-1] - car.LAST_S - length_s, car.EVERY_S)
        spans = np.stack([first, first + length_s], axis=1)
        yield _case("drive", flight, spans, flight.fixes[0].t_s, flight.fixes[0].p_n_m, {})
        for path, middle_s in (("path_10", 24.0), ("path_15", 20.0)):
            flight = quadrotor(DATA, path)
            imu = replace(flight.imu, t_s=flight.imu.t_s + CLOCK_S)
            flight = replace(flight, imu=imu)
            spans = middle_s + np.array([[-0.5, 0.5]]) * length_s
            records = {
                "accelerometer": resampled(imu.t_s, imu.f_b_mps2, "m/s2"),
                "gyroscope": resampled(imu.t_s, imu.w_b_radps, "rad/s"),
            }
            fixes = flight.fixes[0]
            yield _case("quadrotor", flight, spans, fixes.t_s, fixes.p_n_m, records)


def _case(
    kind: str,
    flight: Flight,
    spans: FloatArray,
    t_s: FloatArray,
    p_n_m: FloatArray,
    records: dict[str, Record],
) -> Case:
    fixes = flight.fixes[0]
    kept = np.array([not ((s >= spans[:, 0]) & (s <= spans[:, 1])).any() for s in fixes.t_s])
    return Case(
        kind=kind,
        flight=replace(flight, fixes=(fixes[kept],)),
        lost_s=spans,
        judge_s=t_s,
        judge_n_m=p_n_m,
        records=records,
    )


def shaken(flight: Flight, motion: Track) -> Flight:
    """Return a flight that states its inertial unit's noise with the vehicle's shaking."""
    imu = flight.imu
    rough, calm = motion(imu.t_s), motion.calm(imu.t_s)
    by_rate = 1 / np.sqrt(RATE_HZ)
    jolts = np.sqrt(((rough.a_n_mps2 - calm.a_n_mps2) ** 2).mean()) * by_rate
    turns = np.sqrt(((rough.w_nb_b_radps - calm.w_nb_b_radps) ** 2).mean()) * by_rate
    noise = {
        "accelerometer_noise_mps2_per_sqrt_hz": jolts,
        "gyroscope_noise_radps_per_sqrt_hz": turns,
    }
    stated = {name: float(np.hypot(getattr(imu, name), more)) for name, more in noise.items()}
    return replace(flight, imu=replace(imu, **stated))


def resampled(t_s: FloatArray, values: FloatArray, unit: str) -> Record:
    """Return samples at the network's rate, between their neighbours."""
    at_s = np.arange(t_s[0], t_s[-1], 1 / RATE_HZ)
    columns = [np.interp(at_s, t_s, column) for column in values.T]
    return Record(t_s=at_s, values=np.stack(columns, axis=1), unit=unit, frame="b")


def errors(
    case: Case, method: Smoother, manifests: Sequence[Path | None], within_s: Sequence[float]
) -> FloatArray:
    """Return RMS position errors in the first seconds of outages, by manifest, (w, k, m)."""
    found = np.full((len(within_s), len(case.lost_s), len(manifests)), np.nan)
    try:
        prepared = method.prepare(case.flight)
        for m, one in enumerate(manifests):
            own = () if one is None else (NeuralFactor(one, records=case.records),)
            estimate = replace(method, factors=own).estimate_prepared(case.flight, prepared)
            found[:, :, m] = _of_outages(case, estimate, within_s)
    except NoSolutionError:
        pass  # counted: those without a figure
    return found


def _of_outages(case: Case, found: Estimate, within_s: Sequence[float]) -> FloatArray:
    antenna_n_m = found.p_n_m + found.R_nb @ case.flight.antennas[0].position_b_m
    truth = interpolate(found.t_s, case.judge_s, case.judge_n_m)
    squares = ((antenna_n_m - truth) ** 2).sum(axis=1)
    since_s = found.t_s[:, None] - case.lost_s[:, 0]
    length_s = case.lost_s[:, 1] - case.lost_s[:, 0]
    of = [(since_s > 0) & (since_s < np.minimum(length_s, within)) for within in within_s]
    return np.sqrt([[squares[rows].mean() for rows in each.T] for each in of])


def constant(folder: Path, sigma_mps: Sequence[float]) -> Path:
    """Write the network with a constant sigma in place of its own; return the manifest."""
    source = manifest("velocity")
    content = json.loads(source.read_text())
    content["output"]["covariance"] = {"form": "none", "sigma": list(sigma_mps)}
    (folder / content["onnx"]).write_bytes(source.with_suffix(".onnx").read_bytes())
    place = folder / "constant.json"
    place.write_text(json.dumps(content))
    return place


def interval(difference: FloatArray, rng: np.random.Generator) -> tuple[float, float]:
    """Return the 95 % interval of a mean, by bootstrap."""
    means = rng.choice(difference, (DRAWS, len(difference))).mean(axis=1)
    return tuple(np.percentile(means, (2.5, 97.5)).tolist())


def run(count: int = FLIGHTS) -> list[Row]:
    """Return a row for each length."""
    world = VehiclesWorld(flight_s=FLIGHT_S)
    rngs = np.random.default_rng([SEED, 9]).spawn(60)
    flown = [
        simulate(vehicle_scenario(world, KINDS[k % len(KINDS)], rng), rng)
        for k, rng in enumerate(rngs)
    ]
    fitted = calibration(manifest("velocity"), [(one, {}) for one in flown]).constant_sigma
    with TemporaryDirectory() as folder:
        manifests = (None, manifest("velocity"), constant(Path(folder), fitted))
        filtered = [
            (case.kind, errors(case, Forward(noise="stated"), manifests, LENGTHS_S))
            for case in cases(LENGTHS_S[-1], count)
            if case.kind in KINDS  # recordings state a data sheet's noise
        ]
        rows = []
        for w, length_s in enumerate(LENGTHS_S):
            smoothed = []
            for case in cases(length_s, count):
                noise = "stated" if case.kind in KINDS else "identified"
                found = errors(case, Batch(noise=noise), manifests, (length_s,))
                smoothed.append((case.kind, found[0]))
            rows.append(_row(length_s, [(kind, found[w]) for kind, found in filtered], smoothed))
    return rows


def _row(
    length_s: float,
    filtered: list[tuple[str, FloatArray]],
    smoothed: list[tuple[str, FloatArray]],
) -> Row:
    both = np.concatenate([found for _, found in filtered])
    none, factor = np.sqrt(np.nanmean(both[:, :2] ** 2, axis=0))
    note = (
        f"RMS position error of `forward` in outages; peer: no factor. {_words(filtered)}; "
        f"`batch`: {_words(smoothed)}"
    )
    return row(f"velocity_outage_{length_s:.0f}_s", factor, none, "m", note, less=True)


def _words(of: list[tuple[str, FloatArray]]) -> str:
    parts, rng = [], np.random.default_rng(0)
    for kind in dict.fromkeys(kind for kind, _ in of):
        found = np.concatenate([one for name, one in of if name == kind])
        solved = found[np.isfinite(found).all(axis=1)]
        if not len(solved):
            parts.append(f"{kind}: none of {len(found)} solved")
            continue
        rms = np.sqrt((solved**2).mean(axis=0))
        low, high = interval(solved[:, 1] - solved[:, 0], rng)
        parts.append(
            f"{kind}, {len(solved)} of {len(found)}: none {rms[0]:.2f}, factor {rms[1]:.2f}, "
            f"constant sigma {rms[2]:.2f} m, mean of factor less none {low:+.2f} to {high:+.2f}"
        )
    return "; ".join(parts)
