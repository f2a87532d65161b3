"""Recipes of kind ``velocity``: body velocity by an inertial unit, released as a factor."""

import numpy as np
import torch

from fgnav.io.strict_toml import Positive, Table
from fgnav.neural.manifest import Covariance, Output
from fgnav_models.training.contract import Release, factor_input, manifest_of
from fgnav_models.training.learning import Learning
from fgnav_models.training.order import Order
from fgnav_models.training.recipes import said, scaled
from fgnav_models.training.release import made_with, release
from fgnav_models.training.velocity.data import SCALE, Drawn, Records, records
from fgnav_models.training.velocity.figures import figures_of, judged, measured_half_life_s
from fgnav_models.training.velocity.nets import (
    FIGURES,
    VelocityFactor,
    VelocityNet,
    negative_log_likelihood,
)
from fgnav_models.training.velocity.vehicles.world import VehiclesWorld
from fgnav_sim.ranges import Count

_TRAIN, _CALIBRATE, _TEST = range(3)  # streams of random numbers: flights apart
_SENSORS = (("f_b_mps2", "accelerometer"), ("w_b_radps", "gyroscope"))


class Training(Learning, frozen=True):
    """How the network is made."""

    # flights, held_out: to learn from; to calibrate on, and as many to test on
    flights: Count = 2500
    held_out: Count = 200
    window_s: Positive = 4.0
    width: Count = 48
    batch: Count = 256


class Recipe(Table, frozen=True):
    """A network, and the vehicles that it learns from; ``gyroscope``: whether it sees rates."""

    world: VehiclesWorld
    release: Release
    gyroscope: bool = True
    training: Training = Training()
    seed: int = 1


def run(order: Order) -> list[str]:
    """Run a recipe; a ``fgnav_models.training.order.Trainer``."""
    recipe = scaled(order, Recipe)
    how, seed, name = recipe.training, recipe.seed, recipe.release.name

    def flights(stream: int, count: int) -> Records:
        return records(recipe.world, count, rng=np.random.default_rng([seed, stream]))

    learn, held = flights(_TRAIN, how.flights), flights(_CALIBRATE, how.held_out)
    window = round(how.window_s * recipe.world.rate_hz)
    net = VelocityNet(window=window, gyroscope=recipe.gyroscope, width=how.width, seed=seed)
    net.to(order.device)
    some = held.on(order.device).windows(*held.every(round(recipe.world.rate_hz), window), window)
    batches = Drawn(flights=learn.on(order.device), window=window, batch=how.batch, seed=seed)
    how.train(order, name, net, batches, negative_log_likelihood, some, seed)
    calibrate(net, held, window)
    found = judged(net, flights(_TEST, how.held_out), window)
    metrics = figures_of(found)
    half_life_s = measured_half_life_s(judged(net, held, window))
    _release(net, learn, recipe, half_life_s, metrics, order)
    rows = [[name, key, f"{value:.4g}"] for key, value in metrics.items()]
    return order.report(("network", "figure", "value"), rows)


def calibrate(net: VelocityNet, held: Records, window: int) -> None:
    """Scale each axis' 1-sigma so that the mean normalised square of held-out errors is 1."""
    of = judged(net, held, window)
    squares = ((of.error_mps / of.sigma_mps) ** 2).mean(axis=0)
    net.log_scale += torch.from_numpy(np.log(squares) / 2).float()


def _release(
    net: VelocityNet,
    learn: Records,
    recipe: Recipe,
    half_life_s: float,
    metrics: dict[str, float],
    order: Order,
) -> None:
    how, words, rate_hz = recipe.training, recipe.release, recipe.world.rate_hz
    window, sensors = round(how.window_s * rate_hz), _SENSORS[: 2 if recipe.gyroscope else 1]
    module = VelocityFactor(net, SCALE).eval()
    *sensed, _ = learn.windows(*learn.every(window, window), window)
    sensed = sensed[: len(sensors)]
    with torch.no_grad():
        figures = [figure[:, 0].numpy() for figure in module(*sensed)[2:]]
    inputs = tuple(
        factor_input(port, sensor, rate_hz, window, scale=scale)
        for (port, sensor), scale in zip(sensors, SCALE, strict=False)
    )
    output = Output(
        name="v_b_mps",
        measures="velocity",
        manifold="R3",
        unit="m/s",
        frame="b",
        covariance=Covariance(form="log_sigma", name="log_sigma"),
        half_life_s=round(half_life_s, 2),
    )
    domain = how.domain(FIGURES, dict(zip(FIGURES, figures, strict=False)))
    content = {key: value for key, value in said(recipe).items() if key != "release"}
    origin = made_with(recipe.seed, content, metrics, order)
    manifest = manifest_of(words, inputs, output, domain, origin)
    examples = [scale * x.double().numpy() for x, scale in zip(sensed, SCALE, strict=False)]
    release(module, examples, manifest, words, metrics, order.out)
