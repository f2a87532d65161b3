"""The paper's campaign: task and type, architecture, learning rate, then one network per integer.

Phases 1 to 3 look at one network, the benchmark; each choice is made on validation rows, figures
are reported on test rows. Everything is an experiment in a folder of its own, so a campaign that
was cut or killed goes on where it stood.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeAlias

import msgspec
import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.io.strict_toml import Positive, Table
from fgnav_models.training.ambiguity.baselines import Figures, of_baselines
from fgnav_models.training.ambiguity.data import Data, Parts, Samples, draw, parts_of
from fgnav_models.training.ambiguity.experiment import (
    Experiment,
    Result,
    read_failures,
    run_experiment,
)
from fgnav_models.training.ambiguity.nets import Architecture, Task
from fgnav_models.training.order import Order
from fgnav_sim.data_sets.world import World
from fgnav_sim.ranges import Count

Type: TypeAlias = Literal["mlp", "rnn", "lstm"]
_DATA, _PARTS = range(2)  # streams of random numbers, apart from one another


class Grid(Table, frozen=True):
    """Grid of the phases; the defaults are the paper's."""

    tasks: tuple[Task, ...] = ("classification", "regression")
    types: tuple[Type, ...] = ("mlp", "rnn")
    windows: tuple[Count, ...] = (1, 5, 10)  # phase 1
    # dense layers by name; phase 2, as are ``units`` and ``activations``
    sizes: dict[str, tuple[Count, ...]] = msgspec.field(
        default_factory=lambda: {
            "BA": (800, 400, 200, 100),
            "MA": (400, 200, 100, 50),
            "LA": (200, 100, 50, 25),
        }
    )
    units: tuple[Count, ...] = (100, 125, 150, 175, 200)
    activations: tuple[Literal["tanh", "relu"], ...] = ("tanh", "relu")
    learning_rates: tuple[Positive, ...] = (0.01, 0.005, 0.001, 0.0005, 0.0001)  # phase 3
    tuning_passes: Positive = 2000.0  # phase 3's length
    # by the network's type
    batches: dict[Type, Count] = msgspec.field(
        default_factory=lambda: {"mlp": 200, "rnn": 16, "lstm": 16}
    )

    def __post_init__(self) -> None:
        """Require a batch for each type."""
        for kind in self.types:
            if kind not in self.batches:
                raise ValueError(f"batches: must hold each of types, lacks {kind}")


class Final(Table, frozen=True):
    """Phase 4: when a network is good enough, and how often to try again with another seed."""

    accuracy_percent: float = 99.0
    mse_failed_cycles2: float = 1.1
    rounds: Count = 10
    passes: dict[Task, Positive] = msgspec.field(
        default_factory=lambda: {"classification": 1050.0, "regression": 600.0}
    )
    shares: tuple[float, float, float] = (0.8, 0.0, 0.2)
    shuffles: Annotated[int, msgspec.Meta(ge=1)] = 1000


class Campaign(Table, frozen=True):
    """The recipe of the four phases; ``start`` is what every experiment begins from."""

    name: str
    world: World
    data: Data
    seed: int = 1
    start: Experiment = Experiment(targets="benchmark", repeats=3, passes=600.0)
    grid: Grid = Grid()
    final: Final = Final()

    def __post_init__(self) -> None:
        """Require what phase 4 needs for each task."""
        for task in self.grid.tasks:
            if task not in self.final.passes:
                raise ValueError(f"final.passes: must hold each of grid.tasks, lacks {task}")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Ensemble:
    """Phase 4 of one task: one network per integer."""

    # accuracy_percent, mse_failed_cycles2: (d,); of each network, in its last round
    accuracy_percent: FloatArray
    mse_failed_cycles2: FloatArray
    rounds: IntArray  # (d,); trainings that it took
    reached: BoolArray  # (d,); whether the threshold was met
    failed: BoolArray  # (n, d); failures on the test rows


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Findings:
    """All of a campaign that its report needs."""

    campaign: Campaign
    results: dict[str, Result]  # by the folder's name: ``"1/classification-rnn-k5"``
    chosen: dict[str, Experiment]  # what phases 1 to 3 chose, by task
    baselines: dict[str, Figures]  # on the test rows of phases 1 to 3, and of phase 4
    final_baselines: dict[str, Figures]
    ensembles: dict[str, Ensemble]  # by task
    group: IntArray  # test rows of phase 4: a change is a gap in time
    unused: list[str]  # epochs and differences that were drawn and not used


def find(campaign: Campaign, order: Order) -> Findings:
    """Run what is left of a campaign and return all of it.

    Raises
    ------
    fgnav_models.training.order.SliceOver
        If the time is up.
    """
    samples = draw(
        campaign.world,
        campaign.data.inputs,
        campaign.data.epochs,
        rng=np.random.default_rng([campaign.seed, _DATA]),
    )
    bench = _Bench(campaign, samples, order)
    chosen: dict[str, Experiment] = {
        task: three_phases(campaign.grid, campaign.start, task, bench.accuracy_percent)
        for task in campaign.grid.tasks
    }
    shares = msgspec.structs.replace(campaign.data, shares=campaign.final.shares)
    window = max(experiment.window for experiment in chosen.values())
    parts = parts_of(samples, shares, window, rng=_rng(campaign, _PARTS))
    ensembles: dict[str, Ensemble] = {
        task: _ensemble(campaign, experiment, samples, parts, order)
        for task, experiment in chosen.items()
    }
    of_bench = bench.parts(window)
    unused = [*samples.unused, *of_bench.unused]
    return Findings(
        campaign=campaign,
        results=bench.results,
        chosen=chosen,
        baselines=of_baselines(samples, of_bench.train, of_bench.test),
        final_baselines=of_baselines(samples, parts.train, parts.test),
        ensembles=ensembles,
        group=np.cumsum(np.diff(parts.test, prepend=parts.test[0]) > 1),
        unused=[f"{loss.count} × {loss.what} not used: {loss.reason}" for loss in unused],
    )


class _Bench:
    """Runs experiments of the benchmark network, each once."""

    def __init__(self, campaign: Campaign, samples: Samples, order: Order) -> None:
        self.campaign, self.samples, self.order = campaign, samples, order
        self.results: dict[str, Result] = {}

    def parts(self, window: int) -> Parts:
        rng = _rng(self.campaign, _PARTS)
        return parts_of(self.samples, self.campaign.data, window, rng=rng)

    def accuracy_percent(self, name: str, experiment: Experiment) -> float:
        """Run an experiment; return its best repetition's accuracy on the validation rows.

        For both tasks: the paper takes the error of failures for regression, which a network that
        fails often, by one cycle each time, makes small.
        """
        parts = self.parts(experiment.window)
        self.results[name] = run_experiment(name, experiment, self.samples, parts, self.order)
        return best_of(self.results[name])[1]


def three_phases(
    grid: Grid, start: Experiment, task: Task, score: Callable[[str, Experiment], float]
) -> Experiment:
    """Choose by phases 1 to 3: type and window, architecture, learning rate.

    ``score`` runs an experiment in the folder of a name; the highest is chosen, of equal ones the
    first.
    """

    def best(phase: int, experiments: Mapping[str, Experiment]) -> Experiment:
        scores = {
            name: score(f"{phase}/{name}", experiment) for name, experiment in experiments.items()
        }
        return experiments[max(scores, key=scores.__getitem__)]

    first = best(1, _phase_1(grid, start, task))
    second = best(2, _phase_2(grid, first))
    return best(3, _phase_3(grid, second))


def _phase_1(grid: Grid, start: Experiment, task: Task) -> dict[str, Experiment]:
    return {
        f"{task}-{kind}-k{window}": msgspec.structs.replace(
            start,
            task=task,
            window=window,
            batch=grid.batches[kind],
            architecture=msgspec.structs.replace(start.architecture, kind=kind),
        )
        for kind in grid.types
        for window in grid.windows
    }


def _phase_2(grid: Grid, first: Experiment) -> dict[str, Experiment]:
    """Return the architectures to try; an MLP has no recurrent units to choose."""

    def named(size: str, **changes: Any) -> Architecture:  # noqa: ANN401  # fields of a table
        return msgspec.structs.replace(first.architecture, dense=grid.sizes[size], **changes)

    if first.architecture.kind == "mlp":
        shapes = {size: named(size) for size in grid.sizes}
    else:
        shapes = {
            f"{size}-{activation}-{units}": named(size, activation=activation, recurrent=units)
            for size in grid.sizes
            for activation in grid.activations
            for units in grid.units
        }
    return {
        f"{first.task}-{name}": msgspec.structs.replace(first, architecture=shape)
        for name, shape in shapes.items()
    }


def _phase_3(grid: Grid, second: Experiment) -> dict[str, Experiment]:
    return {
        f"{second.task}-{rate:g}": msgspec.structs.replace(
            second, learning_rate=rate, passes=grid.tuning_passes, validations=40
        )
        for rate in grid.learning_rates
    }


def best_of(result: Result) -> tuple[int, float]:
    """Find the repetition that is best on the validation rows, and its accuracy there, percent."""
    accuracy = result.validation["accuracy_percent"]
    best = int(np.argmax(accuracy))
    return best, float(accuracy[best])


def _ensemble(
    campaign: Campaign, experiment: Experiment, samples: Samples, parts: Parts, order: Order
) -> Ensemble:
    """Train one network per integer, and those that are not good enough again."""
    task, final, d = experiment.task, campaign.final, samples.cycles.shape[1]
    accuracy, error = np.zeros(d), np.full(d, np.nan)
    rounds, left = np.zeros(d, dtype=np.int64), np.arange(d)
    failed = np.ones((len(parts.test), d), dtype=bool)
    for k in range(final.rounds):
        name = f"4/{task}-{k + 1}"
        network = msgspec.structs.replace(
            experiment,
            targets="each",
            keep="last",
            passes=final.passes[task],
            seed=experiment.seed + k,
        )
        result = run_experiment(
            name, network, samples, parts, order, columns=left, keep_weights=True
        )
        accuracy[left] = result.test["accuracy_percent"]
        error[left] = np.array(result.test["mse_failed_cycles2"], dtype=float)
        failed[:, left] = read_failures(order.out / name)
        rounds[left] += 1
        left = np.flatnonzero(~_reached(final, task, accuracy, error))
        if not len(left):
            break
    return Ensemble(
        accuracy_percent=accuracy,
        mse_failed_cycles2=error,
        rounds=rounds,
        reached=_reached(final, task, accuracy, error),
        failed=failed,
    )


def _reached(final: Final, task: Task, accuracy: FloatArray, error: FloatArray) -> BoolArray:
    if task == "classification":
        return np.asarray(accuracy >= final.accuracy_percent)
    return np.asarray(np.isnan(error) | (error < final.mse_failed_cycles2))


def _rng(campaign: Campaign, stream: int) -> np.random.Generator:
    return np.random.default_rng([campaign.seed, stream])
