"""A pool of processes has the losses and gradients of its flights."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from fgnav import Batch
from fgnav_models import learn
from tests.models.learn.small import flown


class Level(torch.nn.Module):
    """A velocity in body axes by the accelerometer's mean: nothing but numbers to be learned."""

    def __init__(self):
        super().__init__()
        torch.manual_seed(3)
        self.linear = torch.nn.Linear(3, 6)

    def forward(self, x):
        mean, log_sigma = self.linear(x.mean(dim=1)).split(3, dim=1)
        return mean + torch.tensor([30.0, 0.0, 0.0]), log_sigma


def velocity_nll(posterior, truth):
    return learn.nll(posterior, truth, ["velocity"])


def test_a_pool_has_the_gradients_of_its_flights():
    flights = [flown(seed, duration_s=6.0) for seed in (1, 2, 3)]
    turned = np.diag([-1.0, -1.0, 1.0])
    truth = replace(flights[2].truth, R_nb=turned @ flights[2].truth.R_nb)
    flights[2] = replace(flights[2], truth=truth)
    module, method = Level(), Batch(noise="nominal")
    windows = np.random.default_rng(1).normal(0.0, 30.0, (64, 3, 3))
    seen = learn.input_of("accelerometer", windows, 100.0, margin=1.0)
    factor = learn.factor(module, "velocity", [seen], frame="b")
    noise = {"position": torch.tensor(0.1, dtype=torch.double, requires_grad=True)}
    with learn.FlightPool(flights, method, 2) as pool:
        for _ in range(2):
            module.zero_grad()
            noise["position"].grad = None
            found = pool.losses([factor], velocity_nll, noise, backward=True)
    assert sorted(found.by_flight) == [0, 1]
    assert "degrees from the truth: nothing is learned there" in found.unsolved[2]
    parameters = [*module.parameters(), *noise.values()]
    losses = []
    for flight in flights[:2]:
        trained = learn.training_flight(flight, method)
        learn.posterior(trained, [factor], noise)
        losses.append(velocity_nll(learn.posterior(trained, [factor], noise), flight.truth))
    mean = torch.stack(losses).mean()
    assert found.mean == pytest.approx(float(mean.detach()), rel=1e-6)
    for x, gradient in zip(parameters, torch.autograd.grad(mean, parameters), strict=True):
        torch.testing.assert_close(x.grad, gradient, rtol=1e-4, atol=1e-6)
