"""Recipes of kind ``gravity``: the source paper's networks, and those that are released."""

from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np
import torch

from fgnav.io.atomic_write import made_folder, write_text
from fgnav.io.strict_toml import Table
from fgnav.methods.smoother import Batch
from fgnav.neural.calibration import calibration
from fgnav.neural.factor import NeuralFactor
from fgnav.neural.manifest import read_manifest
from fgnav_models.training.ambiguity.experiment import SliceOver
from fgnav_models.training.contract import Release
from fgnav_models.training.gravity.data import Drawn, Rows, draw
from fgnav_models.training.gravity.factor import CALM, UNITS, figures_of_windows, release_gravity
from fgnav_models.training.gravity.figures import figures_of, independent_after_s
from fgnav_models.training.gravity.nets import GravityNet, deviation, negative_log_likelihood
from fgnav_models.training.gravity.paper import PaperStudy, run_paper
from fgnav_models.training.gravity.through import (
    DrawnFlights,
    Errors,
    Through,
    flown,
    gravity_flights,
)
from fgnav_models.training.learning import Count, Learning, validated
from fgnav_models.training.order import Order
from fgnav_models.training.recipes import said, scaled
from fgnav_models.training.release import made_with, markdown_table
from fgnav_models.training.smoother.judging import compared, judged, report_rows, text
from fgnav_models.training.train import train
from fgnav_sim.data_sets.gravity import GravityEpochs
from fgnav_sim.data_sets.gravity_motions import PHASES
from fgnav_sim.data_sets.gravity_world import GravityWorld

_TRAIN, _CALIBRATE, _TEST, _TIME = range(4)  # streams of random numbers: flights apart
_THROUGH, _VALIDATE, _HELD_OUT, _INTERVAL, _FOLLOWED = range(10, 15)  # 4 is the paper's
_VALIDATIONS = 20  # through the smoother
_WAIT = "independent after, s"


class Learned(Table, frozen=True):
    """A network with a covariance, to be released as a factor."""

    release: Release  # its name and its card's words
    aided: bool = True  # whether it sees a receiver's motion


class Training(Learning, frozen=True):
    """How the networks to be released are made."""

    # windows, held_out: to learn from; to calibrate on, and as many to test on, of other flights
    windows: Count = 400_000
    held_out: Count = 40_000
    followed: Count = 200  # flights to tell from how soon errors are new ones


class Recipe(Table, frozen=True):
    """What to train: the paper's networks, if any, then those to release, all in one world."""

    world: GravityWorld
    paper: PaperStudy | None = None
    training: Training = Training()
    through: Through = Through()
    network: tuple[Learned, ...] = ()
    seed: int = 1


def run(order: Order) -> list[str] | None:
    """Run a recipe; a ``fgnav_models.training.order.Trainer``."""
    recipe = scaled(order, Recipe)
    try:
        rows = []
        if recipe.paper is not None and order.through == "alone":
            rows = run_paper(recipe.paper, recipe.world, recipe.seed, order)
        flights = _Flights(recipe)
        rows += [row for one in recipe.network for row in _learn(one, recipe, flights, order)]
        if order.through == "smoother":
            rows += [row for one in recipe.network for row in _through(one, recipe, flights, order)]
    except SliceOver:
        return None
    heads = ("network", "tried on", "figure", "value")
    text = markdown_table(heads, rows)
    write_text(order.out / "report.md", text + "\n")
    return [*(" | ".join(row) for row in rows), f"the table is in {order.out / 'report.md'}"]


@dataclass(frozen=True, slots=True)
class _Flights:
    """Windows that all networks of a recipe share, drawn when they are first asked for."""

    recipe: Recipe
    drawn: dict[int, GravityEpochs] = field(default_factory=dict)

    def __call__(self, stream: int) -> GravityEpochs:
        """Return the windows to train, to calibrate or to test."""
        if stream not in self.drawn:
            how, rng = self.recipe.training, np.random.default_rng([self.recipe.seed, stream])
            count = how.windows if stream == _TRAIN else how.held_out
            self.drawn[stream] = draw(self.recipe.world, count, rng=rng)
        return self.drawn[stream]


def _learn(learned: Learned, recipe: Recipe, flights: _Flights, order: Order) -> list[list[str]]:
    """Train, calibrate, judge and release one network; return its rows of the report."""
    name, seed = learned.release.name, recipe.seed
    done = made_folder(order.out / name) / "metrics.json"
    if done.exists():
        return _rows(name, msgspec.json.decode(done.read_bytes(), type=dict[str, float]))
    net, apart = _trained(learned, recipe, flights, order), flights(_TEST)
    rng = np.random.default_rng([seed, _TIME])
    wait_s = independent_after_s(net, recipe.world, recipe.training.followed, rng=rng)
    metrics = figures_of(net, apart) | {_WAIT: wait_s}
    _release(net, flights, learned, recipe, metrics, order)
    write_text(done, msgspec.json.encode(metrics).decode() + "\n")
    return _rows(name, metrics)


def _trained(learned: Learned, recipe: Recipe, flights: _Flights, order: Order) -> GravityNet:
    """Return a network trained alone and calibrated; where its checkpoint is done, at once."""
    name, how, seed, aided = learned.release.name, recipe.training, recipe.seed, learned.aided
    epochs, held = flights(_TRAIN), flights(_CALIBRATE)
    net = GravityNet(aided=aided, width=how.width, seed=seed)
    net.to(order.device)
    trained = train(
        net,
        Drawn(tensors=_tensors(epochs, order.device, aided=aided), batch=how.batch, seed=seed),
        negative_log_likelihood,
        how.settings(seed),
        made_folder(order.out / name) / "checkpoint.safetensors",
        validate=lambda module: validated(
            negative_log_likelihood, module, _tensors(held, order.device, aided=aided)
        ),
        deadline_s=order.deadline_s,
        watch=lambda progress: order.watch(name, progress),
    )
    if not trained.finished:
        raise SliceOver
    net.cpu()
    calibrate(net, held)
    return net


def _through(learned: Learned, recipe: Recipe, flights: _Flights, order: Order) -> list[list[str]]:
    """Train a network on through the smoother, compare both; return its rows of the report."""
    name, how, seed, world = learned.release.name, recipe.through, recipe.seed, recipe.world
    folder = made_folder(order.out / name / "through")
    done = folder / "report_rows.json"
    if done.exists():
        return msgspec.json.decode(done.read_bytes(), type=list[list[str]])
    net = _trained(learned, recipe, flights, order)
    factor = NeuralFactor(order.out / f"{name}.json")
    alone, stated = Batch(factors=(factor,)), read_manifest(factor.manifest).output
    errors = Errors.of(factor, stated.half_life_s, stated.lasting)

    def drawn(stream: int, count: int) -> DrawnFlights:
        flights = flown(world, how.phases, count, how.duration_s, [seed, stream])
        return DrawnFlights(
            flights=gravity_flights(flights, alone, aided=learned.aided),
            batch=how.batch,
            errors=errors,
            seed=seed,
        )

    learn, held = drawn(_THROUGH, how.flights), drawn(_VALIDATE, how.validated)
    trained = train(
        net,
        learn,
        learn.loss,
        how.settings(seed, _VALIDATIONS),
        folder / "checkpoint.safetensors",
        validate=lambda module: {"negative_log_likelihood": held.of_all(module)},
        deadline_s=order.deadline_s,
        watch=lambda progress: order.watch(f"{name} through the smoother", progress),
    )
    if not trained.finished:
        raise SliceOver
    found = figures_of(net, flights(_TEST))
    _release(net, flights, learned, recipe, found, order, folder)
    unseen = flown(world, how.phases, how.held_out, how.duration_s, [seed, _HELD_OUT])
    through = Batch(factors=(NeuralFactor(folder / f"{name}.json"),))
    before, after = (judged(one, unseen) for one in (alone, through))
    both = compared(before, after, np.random.default_rng([seed, _INTERVAL]))
    words = learned.release
    with_both = msgspec.structs.replace(
        words, notes=words.notes | {"Trained through the smoother": text(both)}
    )
    learned = msgspec.structs.replace(learned, release=with_both)
    _release(net, flights, learned, recipe, found, order, folder)
    rows = report_rows(name, both)  # as text: an interval of few flights is none, which JSON lacks
    write_text(done, msgspec.json.encode(rows).decode() + "\n")
    return rows


def _rows(name: str, metrics: dict[str, float]) -> list[list[str]]:
    return [[name, "unseen flights", key, f"{value:.4g}"] for key, value in metrics.items()]


def calibrate(net: GravityNet, held: GravityEpochs) -> None:
    """Scale a network's covariance so that the mean normalised square of held-out errors is 2."""
    rows = Rows.of(held)
    with torch.no_grad():
        _, squared, _ = deviation(net(*rows.seen(aided=net.aided)), rows.g_b)
        net.variance_scale *= squared.mean() / 2


def _tensors(epochs: GravityEpochs, device: str, *, aided: bool) -> tuple[torch.Tensor, ...]:
    rows = Rows.of(epochs)
    return tuple(t.to(device) for t in (*rows.seen(aided=aided), rows.g_b))


def _release(
    net: GravityNet,
    flights: _Flights,
    learned: Learned,
    recipe: Recipe,
    metrics: dict[str, float],
    order: Order,
    folder: Path | None = None,
) -> None:
    """Release a factor, how long its errors last measured on flights as smoothers have them."""
    words, how, rows = learned.release, recipe.training, Rows.of(flights(_TRAIN))
    seen = figures_of_windows(rows.f_b_mps2, rows.motion if net.aided else None)
    domain = how.domain(UNITS, {name: x.numpy() for name, x in seen.items()}, CALM)
    apart, seed = flights(_TEST), [recipe.seed, _FOLLOWED]
    made = ("world", "training", *(("through",) if order.through == "smoother" else ()))
    content = {key: said(getattr(recipe, key)) for key in made} | {"aided": learned.aided}
    origin = made_with(recipe.seed, content, metrics, order)
    folder = folder or order.out
    release_gravity(net, apart, words, (0.0, 0.0), domain, metrics, folder, origin)
    followed = flown(recipe.world, PHASES, how.followed, recipe.through.duration_s, seed)
    found = calibration(folder / f"{words.name}.json", [(one, {}) for one in followed])
    errors = found.half_life_s, found.lasting
    release_gravity(net, apart, words, errors, domain, metrics, folder, origin)
