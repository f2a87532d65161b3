"""``fgnav train trust``: draw worlds, train the trust network, judge and release it."""

import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

import numpy as np
import torch
from scipy.optimize import minimize_scalar

from fgnav.campaign.engines import Local
from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.io.atomic_write import atomic_file, made_folder
from fgnav.io.strict_toml import Table, as_table
from fgnav.neural.manifest import Covariance
from fgnav_models.runtime.resolver import GIVEN, posteriors
from fgnav_models.training.contract import (
    Release,
    epoch_input,
    integers_output,
    manifest_of,
    words_and_figures,
)
from fgnav_models.training.order import Order, SliceOver
from fgnav_models.training.recipes import laid_over, said, scaled
from fgnav_models.training.release import made_with, release
from fgnav_models.training.train import Batch, Settings
from fgnav_models.training.trust.data import Draw, TrustSamples, joined, samples_of
from fgnav_models.training.trust.net import TrustNet, loss_of
from fgnav_models.training.trust.trials import Judged, figures, judge, merged, table

T = TypeVar("T")
_CHUNK = 65_536  # rows at a time through the network
_VALIDATION = 6  # every so many arrays, one is for validation and temperature
_FEW = 8  # tasks: processes take longer to start
_COLDEST = 1.0  # logarithm of a temperature


class Trial(Table, frozen=True):
    """Worlds that the network is judged in once it is trained, by what they change of ``draw``."""

    name: str
    draw: dict[str, Any]


class Recipe(Table, frozen=True):
    """Recipe of the trust network."""

    # name, purpose, notes, domain: of the release
    name: str
    purpose: str
    notes: dict[str, str]
    domain: dict[str, Any]
    draw: Draw  # what it learns from
    trials: tuple[Trial, ...]
    training: Settings
    width: int = 64  # of the hidden layers
    batch: int = 512  # epochs per step
    nodes: int = 100_000  # what the search of an epoch may visit
    seed: int = 1


def run(order: Order) -> list[str]:
    """Train, release and judge; a ``fgnav_models.training.order.Trainer``."""
    recipe = scaled(order, Recipe)
    arrays = [(0, k) for k in range(recipe.draw.arrays)]
    parts = _kept(order, "samples", arrays, partial(_samples, recipe), TrustSamples)
    held_out = np.arange(len(parts)) % _VALIDATION == 0
    learned = joined([block for block, out in zip(parts, held_out, strict=True) if not out])
    validation = joined([block for block, out in zip(parts, held_out, strict=True) if out])
    net = TrustNet(recipe.width, seed=recipe.seed)
    net.normalize(torch.from_numpy(learned.features))
    order.train(
        "trust",
        net,
        _Batches(learned, recipe),
        loss_of,
        recipe.training,
        lambda module: {"entropy": entropy(scores(module, validation), validation)},
    )
    net.cold.fill_(1.0 / temperature(scores(net, validation), validation))
    _release(net, recipe, learned, {}, order)
    learned_from = said(recipe.draw)
    draws = [
        as_table(order.recipe, laid_over(learned_from, trial.draw), Draw) for trial in recipe.trials
    ]
    tasks = [(d + 1, k) for d, draw in enumerate(draws) for k in range(draw.arrays)]
    tasks.sort(key=lambda task: task[1])
    work = partial(_judged, recipe, draws, order.out / f"{recipe.name}.json")
    judged = _kept(order, "trials", tasks, work, Judged)
    worlds = {
        trial.name: merged([x for x, (at, _) in zip(judged, tasks, strict=True) if at == d + 1])
        for d, trial in enumerate(recipe.trials)
    }
    _release(net, recipe, learned, worlds, order)
    return table(worlds).split("\n")


def _samples(recipe: Recipe, task: tuple[int, int]) -> TrustSamples:
    return samples_of(recipe.draw, _generator(recipe.seed, task), nodes=recipe.nodes)


def _judged(recipe: Recipe, draws: Sequence[Draw], model: Path, task: tuple[int, int]) -> Judged:
    return judge(draws[task[0] - 1], _generator(recipe.seed, task), model, recipe.nodes)


def _generator(seed: int, task: tuple[int, int]) -> np.random.Generator:
    return np.random.default_rng([seed, *task])


def _kept(
    order: Order,
    name: str,
    tasks: Sequence[tuple[int, int]],
    work: Callable[[tuple[int, int]], T],
    kind: type[T],
) -> list[T]:
    """Return the results of tasks, made now or read; SliceOver where the time was up."""
    folder = made_folder(order.out / name)
    paths = {task: folder / f"{task[0]}-{task[1]}.npz" for task in tasks}
    missing = [task for task in tasks if not paths[task].exists()]
    write = partial(_written, work, folder, order.deadline_s)
    engine = Local(os.cpu_count() or 1)
    for _ in engine(write, missing, _lost) if len(missing) > _FEW else map(write, missing):
        pass
    if not all(path.exists() for path in paths.values()):
        raise SliceOver
    out = []
    for path in paths.values():
        with np.load(path, allow_pickle=False) as file:
            out.append(kind(**file))
    return out


def _written(
    work: Callable[[tuple[int, int]], Any], folder: Path, deadline_s: float, task: tuple[int, int]
) -> None:
    """Do a task and write what comes of it, unless the time is up."""
    if perf_counter() >= deadline_s:
        return
    made = work(task)
    with atomic_file(folder / f"{task[0]}-{task[1]}.npz") as partial, partial.open("wb") as file:
        np.savez_compressed(
            file, **{name: getattr(made, name) for name in made.__dataclass_fields__}
        )


def _lost(task: tuple[int, int]) -> None:
    raise NoSolutionError(f"array {task[1]} of draw {task[0]}: ends its process; less arrays")


class _Batches:
    """Epochs drawn anew at every step, their rows one after the other."""

    def __init__(self, samples: TrustSamples, recipe: Recipe) -> None:
        self.samples, self.recipe = samples, recipe
        self.usable = np.flatnonzero(np.diff(samples.start) > 0)

    def __call__(self, step: int) -> Batch:
        rng = np.random.default_rng([self.recipe.training.seed, step])
        return batch_of(self.samples, rng.choice(self.usable, self.recipe.batch))


def batch_of(samples: TrustSamples, epochs: IntArray) -> Batch:
    """Return the arguments of ``loss_of``, for epochs that have candidates."""
    number = np.diff(samples.start)[epochs]
    first = np.cumsum(number) - number
    rows = np.repeat(samples.start[epochs] - first, number) + np.arange(number.sum())
    arrays = (
        samples.features[rows],
        np.repeat(np.arange(len(epochs)), number),
        first,
        samples.right[rows],
    )
    return tuple(torch.from_numpy(np.ascontiguousarray(array)) for array in arrays)


def scores(net: torch.nn.Module, samples: TrustSamples) -> tuple[FloatArray, FloatArray]:
    """Return score and score of none of every row, (c,)."""
    parts = []
    with torch.no_grad():
        for start in range(0, len(samples.features), _CHUNK):
            rows = torch.from_numpy(samples.features[start : start + _CHUNK])
            parts.append([answer.numpy().astype(np.float64) for answer in net(rows)])
    score, none = (np.concatenate(block) for block in zip(*parts, strict=True))
    return score, none


def entropy(score_and_none: tuple[FloatArray, FloatArray], samples: TrustSamples) -> float:
    """Return the mean cross-entropy of epochs that have candidates."""
    n = len(samples)
    epoch = np.repeat(np.arange(n), np.diff(samples.start))
    probability, of_none, best = posteriors(*score_and_none, epoch, n)
    right = np.bincount(epoch[samples.right], probability[samples.right], n)
    true = np.where(np.bincount(epoch[samples.right], minlength=n) > 0, right, of_none)
    return -float(np.log(np.maximum(true[best >= 0], 1e-12)).mean())


def temperature(score_and_none: tuple[FloatArray, FloatArray], samples: TrustSamples) -> float:
    """Return the temperature that makes the truth likeliest."""
    score, none = score_and_none

    def misfit(logarithm: float) -> float:
        warm = np.exp(logarithm)
        return entropy((score / warm, none / warm), samples)

    search = minimize_scalar(misfit, bounds=(-_COLDEST, _COLDEST), method="bounded")
    return float(np.exp(search.x))


def _release(
    net: TrustNet,
    recipe: Recipe,
    samples: TrustSamples,
    worlds: dict[str, Judged],
    order: Order,
) -> None:
    content = {k: v for k, v in said(recipe).items() if k not in ("notes", "domain")}
    _, domain = words_and_figures(recipe.domain)
    metrics = figures(merged(list(worlds.values()))) if worlds else {}
    notes = {**recipe.notes, "Beside `constrained`": table(worlds)}
    words = Release(name=recipe.name, purpose=recipe.purpose, notes=notes, domain={})
    manifest = manifest_of(
        words,
        tuple(epoch_input("candidate", *sensor, 1) for sensor in GIVEN.items()),
        integers_output("score", Covariance(form="posterior", name="none")),
        domain,
        made_with(recipe.seed, content, metrics, order),
    )
    release(net, [samples.features[:256]], manifest, words, metrics, order.out)
