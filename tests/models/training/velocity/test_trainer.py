"""The recipe of the velocity network, small, through the command."""

import csv
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from onnx import numpy_helper

from fgnav.graph.keys import Timeline
from fgnav.neural import NeuralFactor
from fgnav.neural.network import load_network
from fgnav_models.commands import train
from fgnav_models.runtime.factors import manifest
from fgnav_models.training.release import AGREEMENT, disagreement
from fgnav_models.training.velocity.data import SCALE, records
from fgnav_models.training.velocity.nets import VelocityFactor, VelocityNet, negative_log_likelihood
from fgnav_models.training.velocity.trainer import calibrate
from fgnav_models.training.velocity.vehicles.world import VehiclesWorld, vehicle_scenario
from fgnav_sim.simulate import simulate

RECIPE = (
    Path(__file__).resolve().parents[4] / "models" / "fgnav_models" / "recipes" / "velocity.toml"
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("velocity") / "out"
    train(RECIPE, out=out, scale="smoke")
    return out


def test_the_recipe_leaves_a_factor_with_its_card(whole):
    network = load_network(whole / "velocity.json")
    output = network.manifest.output
    assert (output.measures, output.frame, output.half_life_s > 0) == ("velocity", "b", True)
    card = (whole / "velocity.md").read_text(encoding="utf-8")
    assert "all: NLL, best constant" in card
    rng = np.random.default_rng(1)
    seen = [rng.normal(size=(5, one.window, 3)) for one in network.manifest.inputs]
    assert network(seen).covariance.shape == (5, 3, 3)


def test_held_out_outages_are_judged_with_the_network_and_without(whole):
    with (whole / "outages.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 5 * 3
    assert len({(row["method"], row["state"]) for row in rows}) == len(rows)
    assert {(row["method"], row["nll_less"]) for row in rows[-3:]} == {("network, tuned", "")}


def test_a_calibrated_network_has_a_mean_normalised_square_of_one():
    held = records(VehiclesWorld(flight_s=10.0), 4, rng=np.random.default_rng(1))
    net = VelocityNet(window=100, gyroscope=True, width=4, seed=1)
    calibrate(net, held, 100)
    *sensed, v_b_mps = held.windows(*held.every(100, 100), 100)
    with torch.no_grad():
        answer, log_sigma = net(*sensed)
    squares = ((answer - v_b_mps) / log_sigma.exp()).square().mean(dim=0)
    np.testing.assert_allclose(squares, 1.0, rtol=1e-4)


def test_its_loss_is_that_of_a_gaussian():
    def module(_):
        return torch.tensor([[1.0, 2.0, 3.0]]), torch.log(torch.tensor([[0.5, 1.0, 2.0]]))

    found = negative_log_likelihood(module, (torch.zeros(1, 2, 3), torch.zeros(1, 3)))
    expected = [x**2 / (2 * s**2) + np.log(s) for x, s in ((1, 0.5), (2, 1), (3, 2))]
    assert float(found) == pytest.approx(np.mean(expected))


def test_the_released_network_is_small_and_runs():
    place = manifest("velocity")
    assert place.with_suffix(".onnx").stat().st_size < 1e6
    network = load_network(place)
    still = [np.zeros((2, one.window, 3)) for one in network.manifest.inputs]
    still[0][:, :, 2] = -9.81
    assert np.linalg.norm(network(still).value, axis=1).max() < 60.0


def test_the_installed_factor_answers_a_flight_of_its_world():
    rng = np.random.default_rng(3)
    flight = simulate(vehicle_scenario(VehiclesWorld(flight_s=30.0), "car", rng), rng)
    timeline = Timeline(t_s=np.arange(0.0, 29.0, 0.5), gyroscope=True)
    made = NeuralFactor(manifest("velocity"))(flight, timeline)
    between_s = NeuralFactor(manifest("velocity")).between_s
    assert len(made.factors) == 1 + int((28.5 - 4.0) / between_s)
    assert any("no window of 400 samples" in loss.reason for loss in made.unused)


def test_the_released_network_says_what_torch_says_with_its_weights():
    """Of its scale: single precision leaves 2e-6, of the double's answer as much either way."""
    network = load_network(manifest("velocity"))
    window = network.manifest.inputs[0].window
    module = VelocityFactor(VelocityNet(window=window, gyroscope=True, width=48, seed=1), SCALE)
    graph = onnx.load(str(manifest("velocity").with_suffix(".onnx"))).graph
    weights = {one.name: torch.tensor(numpy_helper.to_array(one)) for one in graph.initializer}
    module.load_state_dict({name: weights[name] for name in module.state_dict()})
    flights = records(VehiclesWorld(), 8, rng=np.random.default_rng(7))
    *sensed, _ = flights.windows(*flights.every(100, window), window)
    with torch.no_grad():
        raw = [x.double().numpy() for x in module.eval()(*sensed)]
    examples = [scale * x.double().numpy() for x, scale in zip(sensed, SCALE, strict=True)]
    assert max(disagreement(network.run(examples), raw)[:2]) < AGREEMENT
