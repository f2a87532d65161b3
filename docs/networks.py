"""Judge the released networks: ``python docs/networks.py SHARED`` writes evidence/networks.csv.

SHARED is the folder of reference data, for the recordings. Some minutes of one core.
"""

import csv
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import fgnav  # noqa: E402
from fgnav.evaluation.networks import referee  # noqa: E402
from fgnav.evaluation.networks.comparison import NO_NETWORK, constant_of  # noqa: E402
from fgnav.evaluation.span import within  # noqa: E402
from fgnav.geometry.interpolation import interpolate  # noqa: E402
from fgnav_models.runtime.factors import manifest  # noqa: E402
from fgnav_models.training.velocity.vehicles.world import (  # noqa: E402
    VehiclesWorld,
    vehicle_scenario,
)
from fgnav_sim.scenario import FixesTable, load_scenario  # noqa: E402
from fgnav_sim.simulate import simulate  # noqa: E402
from tests.recordings import drive, quadrotor  # noqa: E402

FLIGHTS, SPAN_S, RATE_HZ = 6, 20.0, 100.0
CAR_S = np.arange(60.0, 500.0, 75.0)  # where pieces of the drive begin
GRAVITY, VELOCITY = ("gravity", "gravity-accelerometer"), ("velocity",)
SEED = 4_711  # of flights that taught nothing


def bodies(name: str) -> list[fgnav.Flight]:
    """Return flights of a scenario with an accelerometer and fixes ten times a second."""
    scenario = load_scenario(name)
    fixes = FixesTable(rate_hz=10.0)
    scenario = msgspec.structs.replace(scenario, gnss=None, fixes=fixes, duration_s=SPAN_S)
    rngs = np.random.default_rng([SEED, len(name)]).spawn(FLIGHTS)
    return [simulate(scenario, rng) for rng in rngs]


def vehicles(kind: str) -> list[fgnav.Flight]:
    """Return flights of a kind of vehicle with an inertial unit and fixes."""
    world, fixes = VehiclesWorld(flight_s=SPAN_S), FixesTable(rate_hz=4.0, position_noise_m=0.05)
    rngs = np.random.default_rng([SEED, len(kind)]).spawn(FLIGHTS)
    return [simulate(vehicle_scenario(world, kind, rng, fixes=fixes), rng) for rng in rngs]


def car(shared: Path) -> list[fgnav.Flight]:
    """Return pieces of a drive, each judged by the estimate of the whole."""
    whole = referenced(drive(shared, stretched=True))
    return [within(whole, begin_s, begin_s + SPAN_S) for begin_s in CAR_S]


def quadrotors(shared: Path) -> list[fgnav.Flight]:
    """Return halves of two paths of a quadrotor, each judged by the estimate of the whole."""
    paths = [referenced(quadrotor(shared, path)) for path in ("path_10", "path_15")]
    return [within(one, at_s, at_s + SPAN_S) for one in paths for at_s in (0.0, SPAN_S - 2)]


def referenced(flight: fgnav.Flight) -> fgnav.Flight:
    """Return a recording at the networks' rate with its estimate as reference."""
    imu = flight.imu
    t_s = np.arange(imu.t_s[0], imu.t_s[-1], 1 / RATE_HZ)
    sampled = {
        name: interpolate(t_s, imu.t_s, getattr(imu, name)) for name in ("f_b_mps2", "w_b_radps")
    }
    flight = replace(flight, imu=replace(imu, t_s=t_s, **sampled))
    found = fgnav.Batch(factors=())(flight)
    states = {name: getattr(found, name) for name in ("t_s", "p_n_m", "v_n_mps", "R_nb")}
    return replace(flight, truth=fgnav.Truth(**states, source="filter"))


KINDS: dict[str, tuple[tuple[str, ...], str, Callable[[Path], list[fgnav.Flight]]]] = {
    **{name: (GRAVITY, "nominal", lambda _, n=name: bodies(n)) for name in ("rocket", "glider")},
    **{
        f"simulated {kind}": (VELOCITY, "estimated", lambda _, k=kind: vehicles(k))
        for kind in ("car", "multirotor", "aeroplane")
    },
    "drive_0708": (("gravity-accelerometer", *VELOCITY), "estimated", car),
    "quadrotor": (("gravity-accelerometer", *VELOCITY), "estimated", quadrotors),
}


def rows(kind: str, shared: Path) -> list[dict[str, str]]:
    """Return the figures of networks on a kind of flights."""
    networks, noise, flights_of = KINDS[kind]
    made, flights = [], flights_of(shared)
    for name in networks:
        row = {"flights": kind, "network": name, "method": f"batch, {noise} noise"}
        try:
            found = referee([manifest(name)], flights, fgnav.Batch(noise=noise))
        except fgnav.BadInputError as error:
            made.append(row | {"failure": str(error).replace(str(ROOT), "")[-200:]})
            continue
        (answers,) = found.calibrations
        figures = {
            "answers": answers.count,
            "answered": answers.answered,
            "rmse": answers.rmse,
            "gain": answers.gain.value,
            "gain_low": answers.gain.low,
            "gain_high": answers.gain.high,
        }
        for by in ("network", "constant"):
            scores = getattr(answers, by)
            figures |= {f"{key}_{by}": getattr(scores, key) for key in ("nees", "nll", "energy")}
        for key in (
            "matched_attitude_rmse_deg",
            "position_rmse_m",
            "attitude_nees",
            "position_nees",
        ):
            for by, method in (
                ("none", NO_NETWORK),
                ("constant", constant_of(name)),
                ("network", name),
            ):
                figures[f"{key}_{by}"] = found.flights.pooled(key, method).value
            for by, method in (("none", NO_NETWORK), ("constant", constant_of(name))):
                pair = found.worth(key, name, method)
                figures |= {f"{key}_less_{by}": pair.difference.value}
                figures |= {f"{key}_less_{by}_low": pair.difference.low}
                figures |= {f"{key}_less_{by}_high": pair.difference.high, "n": pair.flights}
        made.append(row | {"unit": answers.unit} | {k: f"{v:.4g}" for k, v in figures.items()})
    return made


def main(shared: Path) -> None:
    """Write the rows of all kinds."""
    every = [row for kind in KINDS for row in rows(kind, shared)]
    names = list(dict.fromkeys(name for row in every for name in row))
    with (ROOT / "docs" / "evidence" / "networks.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(every)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
