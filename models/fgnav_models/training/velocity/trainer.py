"""Recipes of kind ``velocity``: body velocity by an inertial unit, released as a factor.

A network learns from windows of many flights. How its errors are correlated is then tuned through
the smoother, by states in outages of GNSS; held-out flights compare that to the correlation that
the errors have by themselves, and to the best constant standard deviations.
"""

from itertools import product

import numpy as np
import torch

from fgnav.evaluation.networks import Calibration, calibration
from fgnav.io.atomic_write import write_text
from fgnav.io.strict_toml import Positive, Table
from fgnav.neural.factor import NeuralFactor
from fgnav.neural.manifest import Input
from fgnav_models import learn
from fgnav_models.training.contract import Release, factor_input, manifest_of
from fgnav_models.training.learning import Learning
from fgnav_models.training.order import Order
from fgnav_models.training.recipes import said, scaled
from fgnav_models.training.release import made_with, release
from fgnav_models.training.velocity.data import SCALE, Drawn, Records, records
from fgnav_models.training.velocity.figures import (
    answer_figures,
    outage_scores,
    outage_table,
)
from fgnav_models.training.velocity.nets import (
    FIGURES,
    VelocityFactor,
    VelocityNet,
    negative_log_likelihood,
)
from fgnav_models.training.velocity.outages import (
    OutageFlight,
    Outages,
    outage_flights,
    tuned,
)
from fgnav_models.training.velocity.vehicles.world import (
    VehiclesWorld,
    drawn_kind,
    vehicle_scenario,
)
from fgnav_sim.ranges import Count
from fgnav_sim.simulate import simulate

_TRAIN, _CALIBRATE, _SMOOTHED, _TEST = range(4)  # streams of random numbers: flights apart
_SENSORS = (("f_b_mps2", "accelerometer"), ("w_b_radps", "gyroscope"))


class Training(Learning, frozen=True):
    """Recipe of the network."""

    # flights, held_out: to learn from, and to calibrate on
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
    outages: Outages = Outages()
    seed: int = 1


def run(order: Order) -> list[str]:
    """Run a recipe; a ``fgnav_models.training.order.Trainer``."""
    recipe = scaled(order, Recipe)
    how, seed, name = recipe.training, recipe.seed, recipe.release.name
    windows, held = (
        records(recipe.world, count, rng=np.random.default_rng([seed, stream]))
        for stream, count in ((_TRAIN, how.flights), (_CALIBRATE, how.held_out))
    )
    net = _trained_alone(recipe, windows, held, order)
    source, table = through_smoother(net, recipe)
    write_text(order.out / "outages.csv", table)
    test = outage_flights_of(recipe, _TEST, recipe.outages.held_out)
    metrics = answer_figures(source, [flight.flight.flight for flight in test])
    _release(net, windows, source, recipe, metrics, order)
    rows = [[name, key, f"{value:.4g}"] for key, value in metrics.items()]
    return order.report(("network", "figure", "value"), rows)


def through_smoother(net: VelocityNet, recipe: Recipe) -> tuple[NeuralFactor, str]:
    """Return a network as the factor that suits outages best, and a table of held-out flights.

    The table is ``outage_table``'s, of no network, of the network's answers at constant sigmas, and
    of the network; with the correlation that its errors have by themselves, and in outages.
    """
    how, answers = recipe.outages, calibration_of(net, recipe)
    measured = factor_of(net, recipe, answers.half_life_s, answers.lasting)
    tried = [factor_of(net, recipe, *pair) for pair in product(how.half_life_s, how.constant_share)]
    best = tuned(tried, outage_flights_of(recipe, _SMOOTHED, how.flights))
    sigma = np.mean(answers.sigmas, axis=0).tolist()
    methods = {
        "no network": (),
        "constant sigmas, measured": (NeuralFactor(measured.network.with_sigma(sigma)),),
        "constant sigmas, tuned": (NeuralFactor(best.network.with_sigma(sigma)),),
        "network, measured": (measured,),
        "network, tuned": (best,),
    }
    test = outage_flights_of(recipe, _TEST, how.held_out)
    return best, outage_table(outage_scores(methods, test))


def _trained_alone(recipe: Recipe, windows: Records, held: Records, order: Order) -> VelocityNet:
    """Return a network trained on windows, its standard deviations calibrated on held-out ones."""
    how, seed, rate_hz = recipe.training, recipe.seed, recipe.world.rate_hz
    window = round(how.window_s * rate_hz)
    net = VelocityNet(window=window, gyroscope=recipe.gyroscope, width=how.width, seed=seed)
    net.to(order.device)
    some = held.on(order.device).windows(*held.every(round(rate_hz), window), window)
    batches = Drawn(flights=windows.on(order.device), window=window, batch=how.batch, seed=seed)
    how.train(order, recipe.release.name, net, batches, negative_log_likelihood, some, seed)
    calibrate(net, held, window)
    return net


def calibrate(net: VelocityNet, held: Records, window: int) -> None:
    """Scale each axis' 1-sigma so that the mean normalised square of held-out errors is 1."""
    *sensed, v_b_mps = held.windows(*held.every(round(held.rate_hz), window), window)
    with torch.no_grad():
        answer, log_sigma = net(*sensed)
        net.log_scale += ((answer - v_b_mps) / log_sigma.exp()).square().mean(dim=0).log() / 2


def calibration_of(net: VelocityNet, recipe: Recipe) -> Calibration:
    """Return a network's calibration on whole flights: constant sigmas, correlation of errors."""
    rngs = np.random.default_rng([recipe.seed, _CALIBRATE]).spawn(recipe.training.held_out)
    scenarios = [vehicle_scenario(recipe.world, drawn_kind(recipe.world, rng), rng) for rng in rngs]
    flights = [simulate(scenario, rng) for scenario, rng in zip(scenarios, rngs, strict=True)]
    source = factor_of(net, recipe, recipe.outages.half_life_s[0], 0.0)
    return calibration([source] * len(flights), flights)


def factor_of(
    net: VelocityNet, recipe: Recipe, half_life_s: float, constant_share: float
) -> NeuralFactor:
    """Return a network as a factor, its errors correlated so."""
    return learn.factor(
        net,
        "velocity",
        _inputs(recipe),
        frame="b",
        half_life_s=round(half_life_s, 2),
        lasting=round(constant_share, 2),
        name=recipe.release.name,
    )


def _inputs(recipe: Recipe) -> tuple[Input, ...]:
    rate_hz = recipe.world.rate_hz
    window = round(recipe.training.window_s * rate_hz)
    return tuple(
        factor_input(port, sensor, rate_hz, window, scale=scale)
        for (port, sensor), scale in zip(
            _SENSORS[: 2 if recipe.gyroscope else 1], SCALE, strict=False
        )
    )


def outage_flights_of(recipe: Recipe, stream: int, count: int) -> list[OutageFlight]:
    """Return flights in outages, of one stream of random numbers."""
    rng = np.random.default_rng([recipe.seed, stream])
    flights = outage_flights(recipe.world, recipe.outages, count, rng=rng)
    return [OutageFlight.of(flight) for flight in flights]


def _release(
    net: VelocityNet,
    windows: Records,
    source: NeuralFactor,
    recipe: Recipe,
    metrics: dict[str, float],
    order: Order,
) -> None:
    module, window = VelocityFactor(net, SCALE).eval(), source.network.manifest.inputs[0].window
    *sensed, _ = windows.windows(*windows.every(window, window), window)
    sensed = sensed[: len(source.network.manifest.inputs)]
    with torch.no_grad():
        figures = [figure[:, 0].numpy() for figure in module(*sensed)[2:]]
    domain = recipe.training.domain(FIGURES, dict(zip(FIGURES, figures, strict=False)))
    content = {key: value for key, value in said(recipe).items() if key != "release"}
    origin = made_with(recipe.seed, content, metrics, order)
    contract = source.network.manifest
    manifest = manifest_of(recipe.release, contract.inputs, contract.output, domain, origin)
    examples = [scale * x.double().numpy() for x, scale in zip(sensed, SCALE, strict=False)]
    release(module, examples, manifest, recipe.release, metrics, order.out)
