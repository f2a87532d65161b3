"""What a network's factor costs a smoother at ten answers a second, and its training through one.

Shares of one core's time (``process_time``), the median of some rounds, what is compared in turns.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import msgspec
import numpy as np

from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.integers.resolvers.resolve import resolve
from fgnav.methods.smoother import Batch, Smoother
from fgnav.neural import NeuralFactor
from fgnav.types.integers import Integers
from fgnav_models import learn
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.benchmarks._rows import Row, row, timed
from tests.models.learn.small import Airspeed, flown, plain_input, wind
from tests.neural import graphs

FACTORS = {  # what it measures, the share of its errors that lasts, and whose factor that is
    "heading": ("heading", 0.0, "in Python"),
    "velocity": ("velocity", 0.0, "GTSAM's own"),  # and so the others
    "lasting": ("heading", 0.25, "in Python, a constant of the flight in each"),
}
NAMES = (*(f"neural_factor_{name}" for name in FACTORS), "through_smoother")
SPAN_S, LAG_S, ROUNDS = 60.0, 2.0, 7
WINDOW, WIDTH = 100, 128  # a second of accelerations, a multilayer perceptron of 100,000 weights
MOST_PERCENT = 15.0
MOST_SECONDS = 3.6  # an epoch of 50 flights in 90 s on two cores


@dataclass(frozen=True)
class Given:
    """A resolver that has the integers of one flight."""

    integers: Integers
    name: str = "given"

    def __call__(self, *_: object) -> Integers:
        """Return them."""
        return self.integers


def run(span_s: float = SPAN_S) -> list[Row]:
    """Return the rows."""
    return [*_factors(span_s), _training(span_s)]


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


def _training(span_s: float) -> Row:
    flight = learn.training_flight(flown(1, span_s, 10.0), Batch(noise="nominal"))
    records = {"wind": wind(flight.flight, 2)}
    network = learn.factor(Airspeed(), "velocity", [plain_input()], frame="b", records=records)

    def trained() -> None:
        learn.nll(learn.posterior(flight, [network]), flight.truth).backward()

    trained()  # its first search begins far away
    (seconds,) = _in_turns([trained])
    note = (
        f"processor time of value and gradient through the minimum, begun at the last one: "
        f"{span_s:g} s at 10 Hz, a velocity each; peer: at most"
    )
    return row("through_smoother", seconds, MOST_SECONDS, "s", note, less=True)


def _in_turns(works: list[Callable[[], object]]) -> list[float]:
    return np.median(timed(works, ROUNDS, process_time), axis=0).tolist()
