"""Recipes of kind ``gravity``: the source paper's networks, and those that are released."""

import platform
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import msgspec
import numpy as np
import torch

from fgnav.checks import BadInputError
from fgnav.io.atomic_write import made_folder, write_text
from fgnav.io.strict_toml import Positive, Table
from fgnav.methods.smoother import Batch
from fgnav.neural.calibration import calibration
from fgnav_models.gravity_features import CALM, SAMPLES, domain_values
from fgnav_models.runtime.gravity import NetworkGravity
from fgnav_models.runtime.load import load
from fgnav_models.runtime.manifest import Port
from fgnav_models.training.ambiguity.experiment import SliceOver
from fgnav_models.training.ambiguity.released import Release
from fgnav_models.training.gravity.data import Drawn, Rows, draw
from fgnav_models.training.gravity.factor import release_gravity
from fgnav_models.training.gravity.figures import figures_of, independent_after_s
from fgnav_models.training.gravity.nets import GravityNet, deviation, negative_log_likelihood
from fgnav_models.training.gravity.paper import PaperStudy, run_paper
from fgnav_models.training.gravity.through import DrawnFlights, Through, flown, gravity_flights
from fgnav_models.training.order import Order
from fgnav_models.training.recipes import said, scaled
from fgnav_models.training.release import Story, markdown_table, release
from fgnav_models.training.smoother.judging import Compared, compared, judged, report_rows, text
from fgnav_models.training.train import Settings, train
from fgnav_sim.data_sets.gravity import GravityEpochs
from fgnav_sim.data_sets.gravity_motions import PHASES
from fgnav_sim.data_sets.gravity_world import GravityWorld

Count = Annotated[int, msgspec.Meta(ge=1)]
_TRAIN, _CALIBRATE, _TEST, _TIME = range(4)  # streams of random numbers: flights apart
_THROUGH, _VALIDATE, _HELD_OUT, _INTERVAL, _FOLLOWED = range(10, 15)  # 4 is the paper's
_EXAMPLES = 64
_Comparison: TypeAlias = tuple[Compared, ...]


class Learned(Table, frozen=True):
    """A network with a covariance, to be released.

    Attributes
    ----------
    release : Release
        Its name and its card's words; the domain gains the bounds of what it was trained on.
    aided : bool
        Whether it sees a receiver's motion.
    factor : bool
        Whether it is released as the manifest of a factor, in place of an estimator's.
    """

    release: Release
    aided: bool = True
    factor: bool = False


class Training(Table, frozen=True):
    """How the networks to be released are made.

    Attributes
    ----------
    windows, held_out : int
        To learn from; to calibrate on, and as many to test on, of other flights.
    followed : int
        Flights to tell from how soon errors are new ones.
    width, steps, batch : int
    learning_rate : float
    domain_percent : float
        Of the training windows that lie beyond each bound of the declared domain.
    """

    windows: Count = 400_000
    held_out: Count = 40_000
    followed: Count = 200
    width: Count = 128
    steps: Count = 8000
    batch: Count = 1024
    learning_rate: Positive = 2e-3
    domain_percent: Positive = 0.02


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
    if order.through == "smoother" and any(one.factor for one in recipe.network):
        raise BadInputError(
            f"{order.recipe}: key network.factor: --train-through smoother takes estimators alone"
        )
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
    name, world, seed = learned.release.name, recipe.world, recipe.seed
    how, aided = recipe.training, learned.aided
    done = made_folder(order.out / name) / "metrics.json"
    if done.exists():
        return _rows(name, msgspec.json.decode(done.read_bytes(), type=dict[str, float]))
    net, epochs, apart = _trained(learned, recipe, flights, order), flights(_TRAIN), flights(_TEST)
    wait_s = independent_after_s(net, world, how.followed, rng=np.random.default_rng([seed, _TIME]))
    metrics = figures_of(net, apart) | {"independent after, s": wait_s}
    domain = (
        learned.release.domain | {"independent_after_s": wait_s} | _bounds(how, epochs, aided=aided)
    )
    if learned.factor:
        _release_factor(net, apart, learned, recipe, domain, metrics, order.out)
    else:
        _release(net, apart, learned, recipe, domain, metrics, order.out)
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
        Settings(
            steps=how.steps,
            learning_rate=how.learning_rate,
            clip_norm=1.0,
            seed=seed,
            validate_every=max(1, how.steps // 10),
        ),
        made_folder(order.out / name) / "checkpoint.safetensors",
        validate=lambda module: _validation(module, _tensors(held, order.device, aided=aided)),
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
    done = folder / "comparison.json"
    if done.exists():
        return report_rows(name, msgspec.json.decode(done.read_bytes(), type=_Comparison))
    net = _trained(learned, recipe, flights, order)
    alone = NetworkGravity(network=order.out / f"{name}.onnx")
    domain = load(alone.network).manifest.domain

    def drawn(stream: int, count: int) -> DrawnFlights:
        flights = flown(world, how.phases, count, how.duration_s, [seed, stream])
        return DrawnFlights(
            flights=gravity_flights(flights, alone, aided=learned.aided),
            batch=how.batch,
            every=round(10 * domain["independent_after_s"]),
            seed=seed,
        )

    learn, held = drawn(_THROUGH, how.flights), drawn(_VALIDATE, how.validated)
    trained = train(
        net,
        learn,
        learn.loss,
        Settings(
            steps=how.steps,
            learning_rate=how.learning_rate,
            clip_norm=1.0,
            seed=seed,
            validate_every=max(1, how.steps // 20),
        ),
        folder / "checkpoint.safetensors",
        validate=lambda module: {"negative_log_likelihood": held.of_all(module)},
        deadline_s=order.deadline_s,
        watch=lambda progress: order.watch(f"{name} through the smoother", progress),
    )
    if not trained.finished:
        raise SliceOver
    apart = flights(_TEST)
    metrics = figures_of(net, apart)
    _release(net, apart, learned, recipe, domain, metrics, folder)
    unseen = flown(world, how.phases, how.held_out, how.duration_s, [seed, _HELD_OUT])
    through = NetworkGravity(network=folder / f"{name}.onnx")
    before, after = (judged(Batch(gravity=one), unseen) for one in (alone, through))
    found = compared(before, after, np.random.default_rng([seed, _INTERVAL]))
    words = learned.release
    told = msgspec.structs.replace(
        words, notes=words.notes | {"Trained through the smoother": text(found)}
    )
    learned = msgspec.structs.replace(learned, release=told)
    _release(net, apart, learned, recipe, domain, metrics, folder)
    write_text(done, msgspec.json.encode(found).decode() + "\n")
    return report_rows(name, found)


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


def _validation(module: torch.nn.Module, tensors: tuple[torch.Tensor, ...]) -> dict[str, float]:
    with torch.no_grad():
        return {"negative_log_likelihood": float(negative_log_likelihood(module, tensors))}


def _bounds(how: Training, epochs: GravityEpochs, *, aided: bool) -> dict[str, list[float]]:
    """Return what the domain's figures span over the training windows, but for a few."""
    rows = Rows.of(epochs)
    seen = domain_values(rows.f_b_mps2.numpy(), rows.motion.numpy() if aided else None)
    edges = (how.domain_percent, 100.0 - how.domain_percent)
    bounds = {k: [float(f"{x:.4g}") for x in np.percentile(v, edges)] for k, v in seen.items()}
    return bounds | {k: [0.0, bounds[k][1]] for k in bounds if k in CALM}


def _release_factor(
    net: GravityNet,
    apart: GravityEpochs,
    learned: Learned,
    recipe: Recipe,
    domain: dict[str, Any],
    metrics: dict[str, float],
    folder: Path,
) -> None:
    """Release a factor, its half-life measured on flights as smoothers have them."""
    words = learned.release
    release_gravity(net, apart, words, domain | {"half_life_s": 0.0}, metrics, folder)
    how = recipe.through
    seed = [recipe.seed, _FOLLOWED]
    flights = flown(recipe.world, PHASES, recipe.training.followed, how.duration_s, seed)
    found = calibration(folder / f"{words.name}.json", [(one, {}) for one in flights])
    domain |= {"half_life_s": round(found.half_life_s, 2)}
    release_gravity(net, apart, words, domain, metrics, folder)


def _release(
    net: GravityNet,
    apart: GravityEpochs,
    learned: Learned,
    recipe: Recipe,
    domain: dict[str, Any],
    metrics: dict[str, float],
    folder: Path,
) -> None:
    words = learned.release
    inputs = [
        Port(
            name="f_b_mps2",
            shape=("n", SAMPLES, 3),
            unit="m/s2",
            meaning="specific force in body axes, 0.01 s apart, oldest first",
        ),
        Port(
            name="motion",
            shape=("n", 5),
            unit="m/s, m/s2",
            meaning="fgnav_models.gravity_features.course_motion of a receiver's velocities",
        ),
    ][: 2 if learned.aided else 1]
    outputs = (
        Port(
            name="g_b",
            shape=("n", 3),
            unit="1",
            meaning="direction of gravity in body axes at the newest sample",
        ),
        Port(name="covariance", shape=("n", 3, 3), unit="rad2", meaning="of g_b, across it"),
    )
    content = said({"world": recipe.world, "aided": learned.aided, "training": recipe.training})
    story = Story(
        name=words.name,
        purpose=words.purpose,
        inputs=tuple(inputs),
        outputs=outputs,
        domain=domain,
        recipe=content | {"seed": recipe.seed},
        seed=recipe.seed,
        metrics=metrics,
        made_with={"hardware": f"CPU {platform.machine()}"},
    )
    examples = [t[:_EXAMPLES].numpy() for t in Rows.of(apart).seen(aided=learned.aided)]
    release(net, examples, story, folder, notes=words.notes)
