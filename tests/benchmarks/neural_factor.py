"""What a network's factor costs a smoother at ten answers a second, and its training through one.

Shares of one core's time (``process_time``), the median of some rounds, what is compared in turns.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import msgspec
import numpy as np

from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.integers.resolvers.resolve import resolve
from fgnav.methods.smoother import Smoother
from fgnav.neural import NeuralFactor
from fgnav.solve.adjoint import Judged, LinearisedFlight
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.benchmarks._rows import Row, row, timed
from tests.benchmarks.smoother import LAG_S, Given
from tests.neural import graphs
from tests.solve.linear_flight import random_problem

FACTORS = {  # what it measures, the share of its errors that lasts, and whose factor that is
    "heading": ("heading", 0.0, "in Python"),
    "velocity": ("velocity", 0.0, "GTSAM's own"),  # and so the others
    "lasting": ("heading", 0.25, "in Python, a constant of the flight in each"),
}
NAMES = (*(f"neural_factor_{name}" for name in FACTORS), "through_smoother")
SPAN_S, ROUNDS = 60.0, 7
WINDOW, WIDTH = 100, 128  # a second of accelerations, a multilayer perceptron of 100,000 weights
MOST_PERCENT, MOST_SOLVES = 15.0, 3.0
KEYFRAMES = 2000
FREEDOM = 2  # of a given measurement


def run(span_s: float = SPAN_S) -> list[Row]:
    """Return the rows."""
    return [*_factors(span_s), _training()]


def _factors(span_s: float) -> list[Row]:
    scenario = msgspec.structs.replace(load_scenario("demo"), duration_s=span_s)
    flight = simulate(scenario, np.random.default_rng(1))
    plain = Smoother(resolver=Given(resolve(flight, Lambda())[1]), lag_s=LAG_S)
    methods = [plain]
    for measures, lasting, _ in FACTORS.values():
        with TemporaryDirectory() as folder:
            path = graphs.perceptron(Path(folder), WINDOW, WIDTH, measures, lasting)
            network = NeuralFactor(path)
        methods.append(replace(plain, factors=(network,)))
    count = next(t.count for t in methods[-1](flight).consistency if t.what == network.name)
    seconds = _in_turns([lambda one=one: one(flight) for one in methods])
    note = (
        f"more time of `smoother`, lag {LAG_S:g} s, demo, {span_s:g} s: {count} answers of a "
        f"perceptron of {WIDTH} x {WIDTH} to a second of accelerations; peer: at most"
    )
    return [
        row(
            f"neural_factor_{name}",
            100 * (s / seconds[0] - 1),
            MOST_PERCENT,
            "%",
            f"{how}, {note}",
            less=True,
        )
        for (name, (_, _, how)), s in zip(FACTORS.items(), seconds[1:], strict=True)
    ]


def _training() -> Row:
    flight, given, judged = _given(KEYFRAMES)
    at, jacobian, residual, covariance = given
    root = np.linalg.cholesky(covariance)
    shared = np.zeros((*residual.shape, flight.problem.constants.width))
    whitened = np.concatenate([residual[:, :, None], jacobian, shared], axis=2)
    whitened = np.linalg.solve(root, whitened)
    works = [
        lambda: flight._posterior(at, whitened),  # what is measured
        lambda: flight.likelihood(*given, judged),
    ]
    alone, both = _in_turns(works)
    note = (
        f"value and gradient by adjoint, {KEYFRAMES} keyframes of 21 states, 3 constants, a "
        "measurement every tenth; in solves of the batch with covariances; peer: at most"
    )
    return row("through_smoother", both / alone, MOST_SOLVES, "solves", note, less=True)


def _given(n: int) -> tuple[LinearisedFlight, tuple, Judged]:
    rng, problem = np.random.default_rng(1), random_problem(n, 12, 3)
    at = np.arange(0, n, 10)
    root = rng.normal(size=(len(at), FREEDOM, FREEDOM))
    covariance = root @ root.swapaxes(1, 2) + 0.3 * np.eye(FREEDOM)
    jacobian = rng.normal(size=(len(at), FREEDOM, problem.width))
    judged = Judged(np.arange(n), np.array([0, 1, 2, 6, 7, 8]), rng.normal(size=(n, 6)))
    given = (at, jacobian, rng.normal(size=(len(at), FREEDOM)), covariance)
    return LinearisedFlight.at(problem, problem.start), given, judged


def _in_turns(works: list[Callable[[], object]]) -> list[float]:
    return np.median(timed(works, ROUNDS, process_time), axis=0).tolist()
