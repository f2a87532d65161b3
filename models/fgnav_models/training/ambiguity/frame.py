"""Experiments side by side, each with its baselines, and on worlds it was not trained on.

The honest frame around the paper's figures: what rounding, the majority and a leak give on the same
rows; and the networks that are released.
"""

from typing import Any

import msgspec
import numpy as np

from fgnav.checks import IntArray
from fgnav.io.strict_toml import Table, as_table
from fgnav_models.training.ambiguity.baselines import Figures, figures, majority, of_baselines
from fgnav_models.training.ambiguity.data import Data, Rows, Samples, draw, parts_of
from fgnav_models.training.ambiguity.experiment import (
    Experiment,
    answers_of,
    columns_of,
    network_of,
    read_weights,
    run_experiment,
)
from fgnav_models.training.ambiguity.nets import AmbiguityNet
from fgnav_models.training.ambiguity.released import release_network
from fgnav_models.training.contract import Release
from fgnav_models.training.order import Order
from fgnav_models.training.recipes import laid_over, plain
from fgnav_sim.data_sets.world import World
from fgnav_sim.ranges import Count

ANSWERS = ("network", "rounding", "majority", "same time")
_DATA, _PARTS, _ELSEWHERE = range(3)  # streams of random numbers


class Study(Table, frozen=True):
    """One experiment of a frame."""

    name: str
    world: World
    data: Data
    experiment: Experiment
    question: str = ""  # what it is to show
    # where the trained network is tried, too; nothing of them was seen in training
    elsewhere: dict[str, World] = msgspec.field(default_factory=dict)
    elsewhere_epochs: Count = 20_000
    release: Release | None = None  # release the network
    seed: int = 1


def run(order: Order) -> list[str]:
    """Run the studies of a recipe; a ``fgnav_models.training.order.Trainer``.

    The recipe's ``[base]`` is what every ``[[study]]`` is laid over; the tables under a study's
    ``elsewhere`` are laid over its own world.
    """
    studies = _studies(order)
    rows = [record for study in studies for record in _run(study, order)]
    heads = ("study", "tried on", *ANSWERS, "network, all", "rounding, all")
    notes = [f"- {study.name}: {study.question}\n" for study in studies if study.question]
    units = "Right integers, percent; in the last two columns, epochs with every integer right."
    return order.report(heads, rows, "\n".join([units, "", "".join(notes), ""]))


def _studies(order: Order) -> list[Study]:
    content = plain(order)
    base = content.pop("base", {})
    studies = []
    for table in content.pop("study", []):
        merged = laid_over(base, table)
        around = merged.get("elsewhere", {})
        merged["elsewhere"] = {k: laid_over(merged["world"], v) for k, v in around.items()}
        studies.append(as_table(order.recipe, laid_over(merged, content), Study))
    return studies


def _run(study: Study, order: Order) -> list[list[str]]:
    """Run one study; return its rows of the table."""
    experiment = study.experiment
    samples = _drawn(study, study.world, study.data.epochs, _DATA)
    rng = np.random.default_rng([study.seed, _PARTS])
    parts = parts_of(samples, study.data, experiment.window, rng=rng)
    columns = columns_of(experiment, samples.cycles.shape[1])
    run_experiment(study.name, experiment, samples, parts, order, keep_weights=True)
    net = network_of(experiment, samples, parts, columns)
    read_weights(net, order.out / study.name)

    simulations = study.data.split == "simulations"
    where = "other simulations of the same times" if simulations else "other times and attitudes"
    tried = {where: _judged(net, samples, parts.test, columns)}
    baselines = of_baselines(samples, parts.train, parts.test)
    tried[where] |= {name: _of(columns, f) for name, f in baselines.items()}
    most = majority(samples.cycles[parts.train], samples.is_present[parts.train])
    for k, (name, world) in enumerate(study.elsewhere.items()):
        elsewhere = _drawn(study, world, study.elsewhere_epochs, _ELSEWHERE + k, samples.satellites)
        usable = np.flatnonzero(
            np.arange(len(elsewhere.t_s)) - elsewhere.first >= experiment.window - 1
        )
        tried[name] = _judged(net, elsewhere, usable, columns)
        always = figures(
            np.broadcast_to(most, elsewhere.cycles.shape), elsewhere.cycles, elsewhere.is_present
        )
        tried[name]["majority"] = _of(columns, always)
    if study.release is not None:
        measured = {
            f"{where}: {answer}, % right".replace("_", " "): pair[0]
            for where, answers in tried.items()
            for answer, pair in answers.items()
        }
        example = samples.features[parts.test[:64]]
        release_network(net, example, study.release, _recipe(study), measured, order)
    return [[study.name, where, *_cells(answers)] for where, answers in tried.items()]


def _judged(
    net: AmbiguityNet, samples: Samples, rows: IntArray, columns: IntArray
) -> dict[str, tuple[float, float]]:
    """Return mean accuracy and epochs with all right, percent, of network and rounding."""
    answers = answers_of(net, Rows(samples, columns, net.window, "cpu"), rows)
    truth, is_present = samples.cycles[rows], samples.is_present[rows]
    of_network = figures(answers, truth[:, columns], is_present[:, columns])
    return {
        "network": (float(np.nanmean(of_network.accuracy_percent)), of_network.all_right_percent),
        "rounding": _of(columns, figures(samples.rounded[rows], truth, is_present)),
    }


def _of(columns: IntArray, of: Figures) -> tuple[float, float]:
    return float(np.nanmean(of.accuracy_percent[columns])), of.all_right_percent


def _cells(answers: dict[str, tuple[float, float]]) -> list[str]:
    shown = [f"{answers[name][0]:.2f}" if name in answers else "–" for name in ANSWERS]
    return [*shown, *(f"{answers[name][1]:.2f}" for name in ("network", "rounding"))]


def _drawn(study: Study, world: World, count: int, stream: int, satellites: int = 0) -> Samples:
    rng = np.random.default_rng([study.seed, stream])
    return draw(world, study.data.inputs, count, rng=rng, satellites=satellites)


def _recipe(study: Study) -> dict[str, Any]:
    content: dict[str, Any] = msgspec.to_builtins(study)
    content.pop("elsewhere")
    content.pop("release")
    return content
