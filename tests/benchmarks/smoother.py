"""The smoother's speed against real time, and accuracy against the bound, on the demo's motion."""

import tracemalloc
from dataclasses import fields, replace
from pathlib import Path
from time import process_time

import msgspec
import numpy as np

from fgnav.evaluation.comparison import compare
from fgnav.flight import Flight
from fgnav.gnss.differences import DoubleDifferences
from fgnav.integers.lambda_ import Lambda
from fgnav.integers.registry import resolver_named
from fgnav.integers.resolve import resolve
from fgnav.integers.resolver import Integers
from fgnav.methods import method_named
from fgnav.methods.smoother import Batch, Smoother
from fgnav.methods.smoother.batch import solve_batch
from fgnav.methods.smoother.by_gtsam import solve_by_gtsam
from fgnav.methods.smoother.collect import Settings, collect
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.window import Window, solve_window
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

SCENARIO = Path(__file__).resolve().parents[2] / "sim" / "scenarios" / "demo.toml"
SPAN_S = 300.0
SETTING = "demo motion, 8 antennas, 10 Hz keyframes, 100 Hz accelerometer, 300 s"
ACCURATE = ("closed-form", "maximum-likelihood", "smoother", "batch", "rtk")
NAMES = (
    "smoother_batch",
    "smoother_fixed_lag",
    "smoother_fixed_lag_next",
    "smoother_with_integers",
    "smoother_growth",
    "smoother_memory",
    "smoother_solver",
    *(
        f"accuracy_{name.replace('-', '_')}_{angle}"
        for name in ACCURATE
        for angle in ("roll", "pitch", "yaw")
    ),
)


class Given:
    """A resolver that was told the integers of one flight."""

    def __init__(self, integers: Integers) -> None:
        self.integers = integers

    def __call__(self, _differences: DoubleDifferences, _flight: Flight) -> Integers:
        """Return them."""
        return self.integers


def run() -> list[dict]:
    """Return the rows."""
    scenario = msgspec.structs.replace(load_scenario(SCENARIO), duration_s=SPAN_S)
    flight = simulate(scenario, np.random.default_rng(1))
    given, constrained = Given(resolve(flight, Lambda())[1]), resolver_named("constrained")
    batch, window = Batch(resolver=given), Smoother(resolver=given, lag_s=2.0)
    with_integers = Batch(resolver=constrained)
    for method in (batch, window, with_integers):
        method(replace(flight))  # compiles kernels
    batch(flight)
    whole = "all of a method on a flight that nothing is known of, integers given"
    return [
        _speed("smoother_batch", lambda: batch(replace(flight)), f"{whole}; {SETTING}"),
        _speed(
            "smoother_fixed_lag", lambda: window(replace(flight)), f"lag 2 s; {whole}; {SETTING}"
        ),
        _speed(
            "smoother_fixed_lag_next",
            lambda: window(flight),
            f"lag 2 s; as the next method of a comparison, keyframes collected; {SETTING}",
        ),
        _speed(
            "smoother_with_integers",
            lambda: with_integers(replace(flight)),
            f"all of it and array-constrained integers, batch; {SETTING}",
        ),
        *_chain(flight),
        *_accuracy(flight),
    ]


def _speed(name, work, note):
    """Return flight seconds per second of work, the median of five."""
    factor = SPAN_S / float(np.median([_seconds(work) for _ in range(5)]))
    return _row(name, factor, 1.0, factor, "x real time", note)


def _seconds(work):
    started_s = process_time()  # of one core, whoever else uses it
    work()
    return process_time() - started_s


def _row(name, ours, peer, ratio, unit, note):
    keys = ("name", "ours", "peer", "ratio", "unit", "note")
    return dict(zip(keys, (name, ours, peer, ratio, unit, note), strict=True))


def _chain(flight: Flight) -> list[dict]:
    """Return how the solvers grow with the flight, and the batch beside GTSAM's own."""
    settings = Settings(
        resolver=Lambda(),
        gravity=None,
        angular_acceleration_density=None,
        sub_steps=2,
        false_alarm=1e-4,
    )
    whole = collect(flight, settings).keyframes
    short = _first(whole, len(whole.t_s) // 10)
    seconds = [[_seconds(lambda k=k: solve_window(k, 2.0)) for k in (short, whole)] for _ in "aaa"]
    growth = float(np.median([b / a for a, b in seconds]))
    held = [_held(part) for part in (short, whole)]
    ours = np.median([_seconds(lambda: solve_batch(short)) for _ in range(5)])
    theirs = np.median([_seconds(lambda: solve_by_gtsam(short)) for _ in range(3)])
    note = "time of ten times the flight over that of the flight, window of 2 s; peer: linear"
    return [
        _row("smoother_growth", growth, 10.0, 10.0 / growth, "", note),
        _row(
            "smoother_memory",
            held[1],
            held[0],
            held[0] / held[1],
            "MB",
            "peak of Python's and numpy's memory in the window; peer: a tenth of the flight",
        ),
        _row(
            "smoother_solver",
            len(short.t_s) / ours,
            len(short.t_s) / theirs,
            theirs / ours,
            "keyframes/s",
            "batch; peer: GTSAM's LevenbergMarquardtOptimizer and Marginals, same links",
        ),
    ]


def _first(keyframes: Keyframes, n: int) -> Keyframes:
    """Return the first n keyframes; what has a row for each is cut, the rest is shared."""

    def cut(part):
        arrays = {f.name: getattr(part, f.name) for f in fields(part)}
        long = {
            name: value[:n]
            for name, value in arrays.items()
            if isinstance(value, np.ndarray) and len(value) == len(keyframes.t_s)
        }
        return replace(part, **long)

    parts = {name: cut(getattr(keyframes, name)) for name in ("array", "position", "velocity")}
    return replace(cut(keyframes), **parts)


def _held(keyframes: Keyframes) -> float:
    window = Window(2.0)
    tracemalloc.start()
    for row in range(len(keyframes.t_s)):
        window.update(keyframes, row)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


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
