"""Recipes of kind ``gravity``: the source paper's networks, and those that are released."""

from contextlib import suppress
from dataclasses import dataclass, field

import msgspec
import numpy as np
import torch

from fgnav.checks import BadInputError
from fgnav.evaluation.networks import calibration
from fgnav.io.atomic_write import made_folder, write_text
from fgnav.io.strict_toml import Positive, Table
from fgnav.neural import NeuralFactor
from fgnav.neural.manifest import Statistic
from fgnav_models.training.contract import Release
from fgnav_models.training.gravity.data import Drawn, Rows, draw
from fgnav_models.training.gravity.factor import (
    CALM,
    SIGMA,
    UNITS,
    figures_of_windows,
    release_gravity,
)
from fgnav_models.training.gravity.figures import (
    SCENARIOS,
    Answers,
    by_kind,
    calibrated,
    flown_scenario,
    free_flight,
)
from fgnav_models.training.gravity.nets import GravityNet, deviation, negative_log_likelihood
from fgnav_models.training.gravity.paper import PaperStudy, run_paper
from fgnav_models.training.learning import Learning
from fgnav_models.training.order import Order
from fgnav_models.training.recipes import said, scaled
from fgnav_models.training.release import made_with
from fgnav_sim.data_sets.gravity import PHASES, GravityEpochs, gravity_flight
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.ranges import Count

_TRAIN, _CALIBRATE, _TEST = range(3)  # streams of random numbers: flights apart
_FOLLOWED, _SCENARIOS = 10, 11  # 4 is the paper's
_SCALED = 50_000  # windows that inputs are scaled by, and the domain is told by


class Learned(Table, frozen=True):
    """A network with a covariance, to be released as a factor."""

    release: Release  # its name and its card's words
    aided: bool = True  # whether it sees velocities


class Training(Learning, frozen=True):
    """Recipe of the networks to be released."""

    # windows, held_out: to learn from; to calibrate on, and as many to test on, of other flights
    windows: Count = 400_000
    held_out: Count = 40_000
    followed: Count = 200  # flights to tell from how soon errors are new ones
    flown: Count = 30  # flights of each scenario of a flown body, to judge on
    # stated sigma of each axis beyond which no answer is given: an ellipse on a tangent plane says
    # little of a direction that may be anywhere on a ring
    most_sigma_deg: Positive = 10.0


class Recipe(Table, frozen=True):
    """Recipe: the paper's networks, if any, then those to release, all in one world."""

    world: GravityWorld
    paper: PaperStudy | None = None
    training: Training = Training()
    network: tuple[Learned, ...] = ()
    seed: int = 1


def run(order: Order) -> list[str]:
    """Run a recipe; a ``fgnav_models.training.order.Trainer``."""
    recipe = scaled(order, Recipe)
    rows, flights = [], _Flights(recipe)
    if recipe.paper is not None:
        rows = run_paper(recipe.paper, recipe.world, recipe.seed, order)
    rows += [
        record
        for net_recipe in recipe.network
        for record in _learn(net_recipe, recipe, flights, order)
    ]
    return order.report(("network", "tried on", "figure", "value"), rows)


@dataclass(frozen=True, slots=True)
class _Flights:
    """Windows that all networks of a recipe share, drawn when they are first asked for."""

    recipe: Recipe
    drawn: dict[int, GravityEpochs] = field(default_factory=dict)

    def __call__(self, stream: int) -> GravityEpochs:
        """Return the windows to train, to calibrate or to test."""
        if stream not in self.drawn:
            how = self.recipe.training
            count = how.windows if stream == _TRAIN else how.held_out
            self.drawn[stream] = draw(self.recipe.world, count, seed=[self.recipe.seed, stream])
        return self.drawn[stream]


def _learn(learned: Learned, recipe: Recipe, flights: _Flights, order: Order) -> list[list[str]]:
    """Train, calibrate, judge and release one network; return its rows of the report."""
    name = learned.release.name
    done = made_folder(order.out / name) / "metrics.json"
    if done.exists():
        return _rows(name, msgspec.json.decode(done.read_bytes(), type=dict[str, float]))
    net = _trained(learned, recipe, flights, order)
    metrics = _release(net, flights, learned, recipe, order)
    write_text(done, msgspec.json.encode(metrics).decode() + "\n")
    return _rows(name, metrics)


def _trained(learned: Learned, recipe: Recipe, flights: _Flights, order: Order) -> GravityNet:
    """Return a network trained alone and calibrated; where its checkpoint is done, at once."""
    name, how, seed, aided = learned.release.name, recipe.training, recipe.seed, learned.aided
    epochs, held = flights(_TRAIN), flights(_CALIBRATE)
    net = GravityNet(aided=aided, width=how.width, seed=seed)
    net.to(order.device)
    learn, judge = (_tensors(rows, order.device, aided=aided) for rows in (epochs, held))
    net.scale_inputs(*(tensor[:_SCALED] for tensor in learn[:-1]))
    batches = Drawn(tensors=learn, batch=how.batch, seed=seed, mirrored=True)
    how.train(order, name, net, batches, negative_log_likelihood, judge, seed)
    calibrate(net, held, np.radians(how.most_sigma_deg))
    return net


def _rows(name: str, metrics: dict[str, float]) -> list[list[str]]:
    return [[name, "unseen flights", key, f"{value:.4g}"] for key, value in metrics.items()]


def calibrate(net: GravityNet, held: GravityEpochs, most_rad: float) -> None:
    """Scale a network's covariance so that the mean normalised square of held-out errors is 2.

    Of windows whose stated sigma is within the limit, which the scale moves: three rounds.
    """
    for _ in range(3):
        answers = Answers.of(net, held)
        within = answers.sigma_rad <= most_rad
        answer = (torch.from_numpy(x[within]) for x in (answers.g_b, answers.covariance))
        _, squared, _ = deviation(tuple(answer), torch.from_numpy(held.g_b[within]))
        net.variance_scale *= squared.mean().float() / 2


def _tensors(epochs: GravityEpochs, device: str, *, aided: bool) -> tuple[torch.Tensor, ...]:
    rows = Rows.of(epochs)
    return tuple(t.to(device) for t in (*rows.seen(aided=aided), rows.g_b))


def _domain(net: GravityNet, epochs: GravityEpochs, how: Training) -> tuple[Statistic, ...]:
    """Return the range of figures over answered windows, and the largest sigma."""
    rows, most_rad = Rows.of(epochs[:_SCALED]), float(np.radians(how.most_sigma_deg))
    inputs = rows.seen(aided=net.aided)
    with torch.no_grad():
        covariance = net(*inputs)[1]
        figures = figures_of_windows(net, inputs[0], net.motion(*inputs[1:]), covariance)
    within = figures[SIGMA] <= most_rad
    spans = how.domain(UNITS, {k: x[within].numpy() for k, x in figures.items()}, CALM)
    limit = Statistic(name=SIGMA, unit=UNITS[SIGMA], range=(0.0, round(most_rad, 4)))
    return (limit, *spans[1:])


def _release(
    net: GravityNet, drawn: _Flights, learned: Learned, recipe: Recipe, order: Order
) -> dict[str, float]:
    """Release a factor, how long its errors last measured on flights as smoothers have them.

    Returns the figures of its card.
    """
    how, world, words, unseen = recipe.training, recipe.world, learned.release, drawn(_TEST)
    domain = _domain(net, drawn(_CALIBRATE), how)
    table, metrics = by_kind(net, unseen, np.radians(how.most_sigma_deg))
    content = {key: said(getattr(recipe, key)) for key in ("world", "training")}
    origin = made_with(recipe.seed, content | {"aided": net.aided}, metrics, order)

    def write(words: Release, errors: tuple[float, float]) -> None:
        release_gravity(net, unseen, words, errors, domain, metrics, order.out, origin)

    write(words, (0.0, 0.0))
    manifest = order.out / f"{words.name}.json"
    kinds = tuple(kind for kind in PHASES if kind != "vacuum" and getattr(world.phases, kind))
    rngs = np.random.default_rng([recipe.seed, _FOLLOWED]).spawn(how.followed)
    followed = [gravity_flight(world, kinds[k % len(kinds)], rng=rng) for k, rng in enumerate(rngs)]
    measured = calibration([NeuralFactor(manifest)] * len(followed), followed)
    errors = measured.half_life_s, measured.lasting
    write(words, errors)
    evaluated = {"all kinds alike": followed} | {
        name: flown_scenario(name, how.flown, [recipe.seed, _SCENARIOS, index])
        for index, name in enumerate(SCENARIOS)
    }
    bodies = {}
    for name, flights in evaluated.items():
        with suppress(BadInputError):  # of flights of which it answers fewer than three windows
            bodies[name] = calibration([NeuralFactor(manifest)] * len(flights), flights)
    notes = {
        "By kind of flight": table,
        "As a factor, on flights of the world and of the simulator's scenarios": calibrated(bodies),
    }
    if net.aided:
        notes["A coasting rocket"] = free_flight(net, unseen, world)
    words = msgspec.structs.replace(words, notes=words.notes | notes)
    write(words, errors)
    return metrics
