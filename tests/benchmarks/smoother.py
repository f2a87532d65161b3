"""The smoother's speed against real time, and accuracy against the bound, on the demo's motion.

Speeds are flight seconds per second of one core (``process_time``), covariances included; where a
row has a target, that is its peer.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import process_time

import msgspec
import numpy as np

from fgnav.evaluation.comparison import compare
from fgnav.graph.types.problem import Problem
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.integers.resolvers.registry import resolver_named
from fgnav.integers.resolvers.resolve import resolve
from fgnav.methods import method_named
from fgnav.methods.smoother import Batch, Smoother
from fgnav.methods.stream import Stream
from fgnav.solve.fixed_lag import FixedLag, solve_fixed_lag
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers
from fgnav_sim.scenario import Scenario, load_scenario
from fgnav_sim.simulate import simulate
from tests.benchmarks._rows import Row, row, timed
from tests.benchmarks.smoother_memory import RATE_HZ, SET_UP, measurements

SPAN_S = 300.0
STREAM_S = 60.0
LAG_S = 2.0
ROUNDS = 3
# x real time, of one core at 10 Hz.
TARGETS = {
    "smoother_fixed_lag": 100.0,
    "smoother_fixed_lag_whole": 50.0,
    "smoother_every_keyframe": 80.0,
}
ACCURATE = ("closed-form", "maximum-likelihood", "smoother", "batch", "rtk")
NAMES = (
    *TARGETS,
    "smoother_stream",
    "smoother_batch",
    "smoother_with_integers",
    *(
        f"accuracy_{name.replace('-', '_')}_{angle}"
        for name in ACCURATE
        for angle in ("roll", "pitch", "yaw")
    ),
)


@dataclass(frozen=True)
class Given:
    """A resolver that has the integers of one flight."""

    integers: Integers
    name: str = "given"

    def __call__(self, _differences: DoubleDifferences, _flight: Flight) -> Integers:
        """Return them."""
        return self.integers


def run(span_s: float = SPAN_S) -> list[Row]:
    """Return the rows."""
    scenario = msgspec.structs.replace(load_scenario("demo"), duration_s=span_s)
    flight = simulate(scenario, np.random.default_rng(1))
    given = Given(resolve(flight, Lambda())[1])
    _compile(scenario)
    problem = Smoother(resolver=given).prepare(flight).problem
    setting = f"demo motion, 8 antennas, 10 Hz keyframes, 100 Hz accelerometer, {span_s:g} s"
    return [
        *_solves(problem, setting),
        _stream(min(span_s, STREAM_S)),
        *_methods(flight, given, setting),
        *_accuracy(flight),
    ]


def _compile(scenario: Scenario) -> None:
    """Compile all kernels on a few seconds."""
    short = msgspec.structs.replace(scenario, duration_s=5.0)
    flight = simulate(short, np.random.default_rng(1))
    for resolver in (Lambda(), resolver_named("constrained")):
        for method in (Smoother, Batch):
            method(resolver=resolver)(flight)


def _solves(problem: Problem, setting: str) -> list[Row]:
    """Return the window's speeds on a problem that is prepared."""
    span_s = float(problem.t_s[-1] - problem.t_s[0])
    lag = f"lag {LAG_S:g} s, GTSAM, the solve alone"
    return [
        _speed(
            "smoother_fixed_lag",
            span_s,
            lambda: solve_fixed_lag(problem, LAG_S),
            f"{lag}, an update a second; {setting}",
        ),
        _speed(
            "smoother_every_keyframe",
            span_s,
            lambda: _every_keyframe(problem),
            f"{lag}, an update for each keyframe; {setting}",
        ),
    ]


def _stream(span_s: float) -> Row:
    """Return the speed of a stream, its epochs at hand."""
    rng = np.random.default_rng(1)
    epochs = [measurements(k / RATE_HZ, rng) for k in range(1, round(span_s * RATE_HZ) + 1)]

    def run_through() -> None:
        stream = Stream(SET_UP, lag_s=LAG_S)
        for epoch in epochs:
            stream.update(epoch)
        stream.flush()

    note = f"Stream.update with each epoch of smoother_memory, lag {LAG_S:g} s, {span_s:g} s"
    return _speed("smoother_stream", span_s, run_through, note)


def _methods(flight: Flight, given: Given, setting: str) -> list[Row]:
    """Return the speeds of whole methods on a flight of which nothing is prepared."""
    span_s = float(flight.observations.t_s[-1] - flight.observations.t_s[0])
    window = Smoother(resolver=given, lag_s=LAG_S)
    whole = "all of a method, hyperparameters included, integers given"
    methods = {
        "smoother_fixed_lag_whole": (window, f"GTSAM, lag {LAG_S:g} s; {whole}"),
        "smoother_batch": (Batch(resolver=given), f"GTSAM; {whole}"),
        "smoother_with_integers": (
            Batch(resolver=resolver_named("constrained")),
            "GTSAM, batch; all of it and array-constrained integers",
        ),
    }
    return [
        _speed(name, span_s, lambda method=method: method(replace(flight)), f"{note}; {setting}")
        for name, (method, note) in methods.items()
    ]


def _every_keyframe(problem: Problem) -> None:
    """Pass keyframes through a window one by one; estimates are not kept."""
    window = FixedLag(LAG_S, block_s=0.0)
    for keyframe in range(len(problem.t_s)):
        window.update(problem, keyframe)
    window.flush()


def _accuracy(flight: Flight) -> list[Row]:
    """Return every method's RMS errors against the Cramer-Rao bound of one epoch."""
    comparison = compare(flight, [method_named(name, Lambda()) for name in ACCURATE])
    figures = comparison.to_dict()
    bound_deg = figures["bound"]["crlb_deg"]
    rows = []
    for name in ACCURATE:
        score = figures["methods"][name]
        note = f"peer: bound of one epoch; {100 * score['available']:.1f} % of epochs"
        for angle, rmse_deg in score["rmse_deg"].items():
            of = f"accuracy_{name.replace('-', '_')}_{angle}"
            rows.append(row(of, rmse_deg, bound_deg[angle], "deg", note, less=True))
    return rows


def _speed(name: str, span_s: float, work: Callable[[], object], note: str) -> Row:
    """Return flight seconds per second of work, the median of some rounds."""
    factor = span_s / np.median(timed([work], ROUNDS, process_time))  # of one core
    of = "target" if name in TARGETS else "real time"
    return row(name, factor, TARGETS.get(name, 1.0), "x real time", f"{note}; peer: {of}")
