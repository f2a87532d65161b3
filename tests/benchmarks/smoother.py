"""The smoother's speed against real time, and accuracy against the bound, on the demo's motion."""

from dataclasses import replace
from pathlib import Path
from time import perf_counter

import msgspec
import numpy as np

from fgnav.evaluation.comparison import compare
from fgnav.flight import Flight
from fgnav.integers.lambda_ import Lambda
from fgnav.integers.resolve import resolve
from fgnav.methods import method_named
from fgnav.methods.smoother import Batch, Smoother
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

SCENARIO = Path(__file__).resolve().parents[2] / "sim" / "scenarios" / "demo.toml"
SPAN_S = 300.0
SETTING = "demo motion, 8 antennas, 10 Hz keyframes, 100 Hz accelerometer, 300 s"
ACCURATE = ("closed-form", "maximum-likelihood", "smoother", "batch", "rtk")
NAMES = (
    "smoother_batch",
    "smoother_window",
    "flight_to_estimate",
    *(
        f"accuracy_{name.replace('-', '_')}_{angle}"
        for name in ACCURATE
        for angle in ("roll", "pitch", "yaw")
    ),
)


def run() -> list[dict]:
    """Return the rows."""
    scenario = msgspec.structs.replace(load_scenario(SCENARIO), duration_s=SPAN_S)
    flight = simulate(scenario, np.random.default_rng(1))
    for method in (Batch(), Smoother()):
        method(flight)  # compiles kernels; its front end and integers stay cached with the flight
    resolve(flight, Lambda())
    smoothing = "smoothing alone: single-epoch attitudes, preintegration, solution, covariances"
    return [
        _speed("smoother_batch", lambda: Batch()(flight), f"{smoothing}; {SETTING}"),
        _speed("smoother_window", lambda: Smoother()(flight), f"lag 5 s, {smoothing}; {SETTING}"),
        _speed(
            "flight_to_estimate",
            lambda: Batch()(replace(flight)),
            f"differences, integers and batch smoothing; {SETTING}",
        ),
        *_accuracy(flight),
    ]


def _speed(name, work, note):
    """Return flight seconds per second of work, the median of five."""
    seconds = []
    for _ in range(5):
        started_s = perf_counter()
        work()
        seconds.append(perf_counter() - started_s)
    factor = SPAN_S / float(np.median(seconds))
    return {
        "name": name,
        "ours": factor,
        "peer": 1.0,
        "ratio": factor,
        "unit": "x real time",
        "note": note,
    }


def _accuracy(flight: Flight) -> list[dict]:
    """Return every method's RMS errors against the Cramer-Rao bound of one epoch."""
    comparison = compare(flight, [method_named(name, Lambda()) for name in ACCURATE])
    figures = comparison.to_dict()
    bound_deg = figures["bound"]["crlb_deg"]
    rows = []
    for name in ACCURATE:
        score = figures["methods"][name]
        for angle, rmse_deg in score["rmse_deg"].items():
            rows.append(
                {
                    "name": f"accuracy_{name.replace('-', '_')}_{angle}",
                    "ours": rmse_deg,
                    "peer": bound_deg[angle],
                    "ratio": bound_deg[angle] / rmse_deg,
                    "unit": "deg",
                    "note": f"peer: bound of one epoch; {100 * score['available']:.1f} % of epochs",
                }
            )
    return rows
