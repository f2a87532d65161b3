"""``fgnav train trust``: draw worlds, train the trust network, release it."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import torch

from fgnav.checks import FloatArray, IntArray
from fgnav.io.atomic_write import atomic_file, made_folder
from fgnav.io.strict_toml import Table
from fgnav.neural.manifest import Covariance
from fgnav_models.runtime.resolver import GIVEN
from fgnav_models.training.contract import (
    Release,
    epoch_input,
    integers_output,
    manifest_of,
    words_and_figures,
)
from fgnav_models.training.order import Order
from fgnav_models.training.recipes import said, scaled
from fgnav_models.training.release import made_with, markdown_table, release
from fgnav_models.training.train import Batch, Settings, train
from fgnav_models.training.trust.data import TrustSamples, joined, random_world, samples_of
from fgnav_models.training.trust.net import TrustNet, loss_of
from fgnav_models.training.trust.score import judged, posteriors, temperature
from fgnav_sim.data_sets.world import RandomArray, World

_CHUNK = 4096  # rows at a time through the network
_VALIDATION = 6  # every so many arrays, one is for validation and temperature
_TRIAL_NODES = 10**6  # as the resolver
_FIGURES = {  # of a trial, and how the card calls it
    "epochs": "epochs",
    "success_percent": "right, %",
    "coverage_percent": "P > 0.999, %",
    "wrong_of_sure": "wrong of them",
    "wrong_of_sure_bound_percent": "at most so, %",
    "coverage_at_share_percent": "all but 0.1 % right, %",
    "calibration_error": "calibration error",
}


class Draw(Table, frozen=True):
    """One kind of world."""

    name: str
    world: World  # its array is replaced by drawn ones
    # arrays, epochs: how many are drawn, and epochs of each
    arrays: int
    epochs: int
    array: RandomArray = RandomArray()
    # share of links worse than stated, drawn for each array
    outliers: tuple[float, float] = (0.0, 0.2)


class Trial(Table, frozen=True):
    """A world that the network is judged on once it is trained, noise as stated."""

    name: str
    world: World  # with a given array
    epochs: int


class Recipe(Table, frozen=True):
    """What the trust network is made of."""

    # name, purpose, notes, domain: of the release
    name: str
    purpose: str
    notes: dict[str, str]
    domain: dict[str, Any]
    draws: tuple[Draw, ...]
    trials: tuple[Trial, ...]
    training: Settings
    # epochs of so many satellites are left out of what is drawn: not of the trials
    never_seen: tuple[int, ...] = ()
    width: int = 32  # of the hidden layers
    batch: int = 512  # epochs per step
    nodes: int = 100_000  # what the search of an epoch may visit
    # stated over true standard deviation of noise, drawn for each array
    stated: tuple[float, float] = (0.8, 1.25)
    seed: int = 1


def run(order: Order) -> list[str] | None:
    """Train and release; a ``fgnav_models.training.order.Trainer``."""
    recipe = scaled(order, Recipe)
    parts = _parts(recipe, order)
    if parts is None:
        return None
    held_out = np.arange(len(parts)) % _VALIDATION == 0
    learned = joined([part for part, out in zip(parts, held_out, strict=True) if not out])
    kept = joined([part for part, out in zip(parts, held_out, strict=True) if out])
    net = TrustNet(recipe.width, seed=recipe.seed)
    sample = slice(20_000)
    net.scale(
        *(torch.from_numpy(x[sample]) for x in (learned.links, learned.is_present, learned.whole))
    )
    trained = train(
        net,
        _Batches(learned, recipe),
        loss_of,
        recipe.training,
        order.out / "trust.safetensors",
        validate=lambda module: {"entropy": _entropy(module, kept)},
        deadline_s=order.deadline_s,
        watch=lambda progress: order.watch("trust", progress),
    )
    if not trained.finished:
        return None
    score, none = scores(net, kept)
    net.cold.fill_(1.0 / temperature(score, none, kept))
    trials = _tried(net, recipe, order)
    if trials is None:
        return None
    figures = judged(*scores(net, kept), kept)
    _release(net, recipe, kept, figures, trials, _misfit(parts), order)
    return [f"{name}: {value:.6g}" for name, value in figures.items()] + trials.split("\n")


def _parts(recipe: Recipe, order: Order) -> list[TrustSamples] | None:
    """Return the samples of every array, or None where the time was up."""
    parts = []
    for d, draw in enumerate(recipe.draws):
        for k in range(draw.arrays):
            rng = np.random.default_rng([recipe.seed, d, k])
            part = _kept(order, f"{d}-{k}", partial(_drawn, recipe, draw, rng))
            if part is None:
                return None
            parts.append(part.chosen(~np.isin(part.satellites, recipe.never_seen)))
    return parts


def _tried(net: TrustNet, recipe: Recipe, order: Order) -> str | None:
    """Return a table of the trials, Markdown, or None where the time was up."""
    rows = []
    for k, trial in enumerate(recipe.trials):
        rng = np.random.default_rng([recipe.seed, len(recipe.draws), k])
        draw = partial(samples_of, trial.world, rng, trial.epochs, nodes=_TRIAL_NODES)
        part = _kept(order, f"trial-{k}", draw)
        if part is None:
            return None
        found = judged(*scores(net, part), part)
        rows.append((trial.name, *(f"{found[name]:.4g}" for name in _FIGURES)))
    return markdown_table(("world", *_FIGURES.values()), rows)


def _kept(order: Order, name: str, draw: Callable[[], TrustSamples]) -> TrustSamples | None:
    """Return samples, drawn or read, or None where there are none and the time is up."""
    path = made_folder(order.out / "samples") / f"{name}.npz"
    if not path.exists():
        if perf_counter() >= order.deadline_s:
            return None
        _write(path, draw())
    with np.load(path, allow_pickle=False) as file:
        return TrustSamples(**file)


def _drawn(recipe: Recipe, draw: Draw, rng: np.random.Generator) -> TrustSamples:
    world = random_world(draw.world, draw.array, draw.outliers, rng)
    stated = float(np.exp(rng.uniform(*np.log(recipe.stated))))
    return samples_of(world, rng, draw.epochs, nodes=recipe.nodes, stated=stated)


def _write(path: Path, samples: TrustSamples) -> None:
    with atomic_file(path) as part, part.open("wb") as file:
        np.savez(file, **{name: getattr(samples, name) for name in samples.__dataclass_fields__})


class _Batches:
    """Epochs drawn anew at every step, their rows one after the other."""

    def __init__(self, samples: TrustSamples, recipe: Recipe) -> None:
        self.samples, self.recipe = samples, recipe
        self.usable = np.flatnonzero(np.diff(samples.start) > 0)

    def __call__(self, step: int) -> Batch:
        rng = np.random.default_rng([self.recipe.training.seed, step])
        return batch_of(self.samples, rng.choice(self.usable, self.recipe.batch))


def batch_of(samples: TrustSamples, epochs: IntArray) -> Batch:
    """Return what ``loss_of`` takes, for epochs that have candidates."""
    number = np.diff(samples.start)[epochs]
    first = np.cumsum(number) - number
    rows = np.repeat(samples.start[epochs] - first, number) + np.arange(number.sum())
    truth = samples.truth[epochs]
    arrays = (
        samples.links[rows],
        samples.is_present[rows],
        samples.whole[rows],
        samples.outlier[rows],
        np.repeat(np.arange(len(epochs)), number),
        first,
        np.where(truth >= 0, first + truth, -1),
    )
    return tuple(torch.from_numpy(np.ascontiguousarray(array)) for array in arrays)


def scores(net: torch.nn.Module, samples: TrustSamples) -> tuple[FloatArray, FloatArray]:
    """Return score and score of none of every row, (c,)."""
    out: list[list[FloatArray]] = [[], []]
    with torch.no_grad():
        for start in range(0, len(samples.whole), _CHUNK):
            rows = slice(start, start + _CHUNK)
            inputs = (samples.links, samples.is_present, samples.whole)
            answer = net(*(torch.from_numpy(x[rows]) for x in inputs))
            for part, value in zip(out, answer[:2], strict=True):
                part.append(value.numpy().astype(np.float64))
    return np.concatenate(out[0]), np.concatenate(out[1])


def _entropy(net: torch.nn.Module, samples: TrustSamples) -> float:
    return posteriors(*scores(net, samples), samples).entropy


def _misfit(parts: list[TrustSamples]) -> list[float]:
    """Return how far least costs per degree of freedom went: medians of arrays, one in 100 aside.

    Arrays of few degrees of freedom say little and are not asked.
    """
    medians = [
        np.nanmedian(part.cost / part.degrees)
        for part in parts
        if len(part) and part.degrees.min() > 8
    ]
    low, high = np.quantile(medians if medians else np.ones(1), [0.005, 0.995])
    return [round(float(low), 2), round(float(high), 2)]


def _release(
    net: TrustNet,
    recipe: Recipe,
    samples: TrustSamples,
    figures: dict[str, float],
    trials: str,
    misfit: list[float],
    order: Order,
) -> None:
    content = {k: v for k, v in said(recipe).items() if k not in ("notes", "domain")}
    _, domain = words_and_figures({**recipe.domain, "misfit": misfit})
    words = Release(
        name=recipe.name,
        purpose=recipe.purpose,
        notes={**recipe.notes, "On worlds of bad links": trials},
        domain={},
    )
    ports = zip(("links", "there", "whole"), GIVEN.items(), (0, 0, 1), strict=True)
    manifest = manifest_of(
        words,
        tuple(epoch_input(port, *sensor, window) for port, sensor, window in ports),
        integers_output("score", Covariance(form="posterior", name="none"), "outlier"),
        domain,
        made_with(recipe.seed, content, figures, order),
    )
    examples = [x[:256] for x in (samples.links, samples.is_present, samples.whole)]
    release(net, examples, manifest, words, figures, order.out)
