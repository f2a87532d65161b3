"""Gradients through the smoother's minimum, against differences of flights that are solved anew."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest
import torch

from fgnav import BadInputError, Batch
from fgnav.graph.build import Layout
from fgnav.graph.keys import Timeline
from fgnav.solve.adjoint import PosteriorCovariance
from fgnav.solve.gauss_newton import elimination_at
from fgnav.solve.linear import linearise
from fgnav_models import learn
from fgnav_models.learn.answers import answers_of, log
from tests.models.learn.sensors import CASES, SIGMA, drawn, sensed
from tests.models.learn.small import flown


def differences(functions, x, step):
    """Return derivatives of some functions by a parameter's numbers, each solved anew."""
    gradients = torch.zeros(2, *x.shape, dtype=x.dtype)
    for i in np.ndindex(*x.shape):
        ends = []
        for h in (step, -step):
            with torch.no_grad():
                x[i] += h
                ends.append(functions().detach())
                x[i] -= h
        gradients[(slice(None), *i)] = (ends[0] - ends[1]) / (2 * step)
    return gradients


UNIT_NOISE = {"accelerometer": 0.2, "position": -0.3}
RATE_PRIOR = {"rate": 2.0, "rate length": 0.3, "position": -0.3}


@pytest.mark.parametrize(
    ("seed", "noise"),
    [*((seed, UNIT_NOISE) for seed in range(len(CASES))), *((seed, RATE_PRIOR) for seed in (0, 6))],
)
def test_gradients_are_differences_of_flights_solved_anew(seed, noise):
    trained, factor, module, rng = drawn(seed, gyroscope=noise is UNIT_NOISE)
    noise = {
        name: torch.tensor(x, dtype=torch.double, requires_grad=True) for name, x in noise.items()
    }
    n = len(trained.prepared.problem.t_s)
    of_mean, of_covariance = (torch.from_numpy(rng.normal(size=s)) for s in ((n, 9), (n, 9, 9)))

    def solved():
        """Solve anew, each search from where the last one ended, until states are rounding."""
        for _ in range(40):
            before, found = trained.states, learn.posterior(trained, [factor], noise)
            sigma = found.covariance.detach().diagonal(dim1=1, dim2=2).sqrt().numpy()
            if before and (abs(before.steps_to(trained.states)[:, :9]) < 1e-8 * sigma).all():
                break
        return found

    start = solved()
    origin = [x.detach() for x in (start.R_nb, start.p_n_m, start.v_n_mps)]
    scale = start.covariance.detach().diagonal(dim1=1, dim2=2).sqrt()

    def mean_and_covariance():
        found = solved()
        turn = log(origin[0].mT @ found.R_nb)
        moved = torch.cat([turn, found.p_n_m - origin[1], found.v_n_mps - origin[2]], dim=1)
        relative = found.covariance / scale[:, :, None] / scale[:, None]
        return torch.stack([(of_mean * moved / scale).sum(), (of_covariance * relative).sum()])

    networks = module.parameters() if "rate" not in noise else ()
    parameters = [*networks, *noise.values()]
    ours = [
        torch.autograd.grad(one, parameters, retain_graph=True) for one in mean_and_covariance()
    ]
    for i, x in enumerate(parameters):
        # What a flight knows hardly answers to an accelerometer's noise.
        step = 3e-3 if x is noise.get("accelerometer") else 1e-3
        expected = differences(mean_and_covariance, x, step)
        for gradient, difference, most in zip(ours, expected, (1e-4, 1e-3), strict=True):
            assert (gradient[i] - difference).norm() < most * difference.norm()


@pytest.mark.parametrize("seed", [2, 4])
def test_gradients_of_the_linearised_flight_are_those_of_a_dense_factorisation(seed):
    trained, factor, _, rng = drawn(seed)
    problem = trained.prepared.problem
    for _ in range(6):
        learn.posterior(trained, [factor])
    states, n, D = trained.states, len(problem.t_s), problem.width
    timeline = Timeline(t_s=problem.t_s, gyroscope=True)
    custom, (term,) = answers_of(factor, trained.flight, timeline, problem.constants)
    custom = [one.factor for one in custom]
    graph, ordering = gtsam.GaussianFactorGraph(), gtsam.Ordering()
    for of in linearise(problem, states).factors:
        for one in of:
            graph.push_back(one)
    for k in range(n):
        for key in Layout.of(problem).keyframe(k):
            ordering.push_back(key)
    others, right = (torch.from_numpy(np.ascontiguousarray(x)) for x in graph.jacobian(ordering))
    given = [x.detach().requires_grad_() for x in (term.value, term.covariance)]
    value, covariance = given
    m = len(value)
    J = torch.zeros(m, 3, n * D, dtype=torch.double)  # of what is measured, in n
    for sign, rows in zip((1.0, -1.0), term.keyframes.T[::-1], strict=False):
        for i, k in enumerate(rows):
            if seed == 2:
                J[i, :, k * D + 6 : k * D + 9] = torch.eye(3)
            else:
                J[i, :, k * D + 3 : k * D + 6] = sign * torch.from_numpy(states.R_nb[k])
    now, *before = (states.at(rows) for rows in term.keyframes.T[::-1])
    at = now.v_n_mps if seed == 2 else now.p_n_m - before[0].p_n_m
    white = torch.linalg.cholesky(term.counted.inflation * covariance)
    rows = torch.linalg.solve_triangular(white, J, upper=False).flatten(0, 1)
    apart = (value - torch.from_numpy(at))[:, :, None]
    apart = torch.linalg.solve_triangular(white, apart, upper=False).flatten()
    # Not by the information: of an inertial unit its rounding is 1e-8.
    Q, R = torch.linalg.qr(torch.cat([others, rows]))
    inverse = torch.linalg.solve_triangular(R, torch.eye(n * D).double(), upper=True)
    x, P = inverse @ (Q.mT @ torch.cat([right, apart])), inverse @ inverse.mT
    a, B = rng.normal(size=(n, D)), rng.normal(size=(n, D, D))
    a, B = a / 1e2, B + B.swapaxes(1, 2)
    blocks = torch.stack([P[k * D : k * D + D, k * D : k * D + D] for k in range(n)])
    loss = (torch.from_numpy(a).ravel() * x).sum() + (torch.from_numpy(B) * blocks).sum()
    expected = torch.autograd.grad(loss, given)
    covariance = PosteriorCovariance(
        elimination_at(problem, states, custom), Layout.of(problem), states
    )
    again = replace(term, value=given[0], covariance=given[1])
    ours = torch.autograd.grad(again.adjoint_value(covariance.adjoint(a, B, ()), states), given)
    for gradient, exact in zip(ours, expected, strict=True):
        assert (gradient - exact).norm() < 1e-8 * exact.norm()


class Attitude(torch.nn.Module):
    """The newest sample, and one logarithm of a standard deviation, to be learned."""

    def __init__(self):
        super().__init__()
        self.log_sigma = torch.nn.Parameter(torch.tensor(-4.5))

    def forward(self, x):
        return x[:, -1] / x[:, -1].norm(dim=1, keepdim=True), self.log_sigma.expand(len(x), 1)


def test_a_network_learns_its_own_sigma_through_the_smoother():
    # The gyroscope tells little from one answer to the next: each counts by itself.
    flight = flown(1, duration_s=10.0, gyroscope_noise_radps_per_sqrt_hz=0.03)
    module = Attitude()
    factor = sensed(module, flight, "attitude", "n", np.random.default_rng(1))
    trained = learn.training_flight(flight, Batch(noise="nominal"))
    optimiser = torch.optim.Adam(module.parameters(), lr=0.3, betas=(0.3, 0.9))
    for _ in range(15):
        optimiser.zero_grad()
        learn.nll(learn.posterior(trained, [factor]), flight.truth, ["attitude"]).backward()
        optimiser.step()
    # A rotation is twice as far as its quaternion. 90 answers, which the gyroscope joins, leave the
    # logarithm open by some tenths; it began 1.3 away.
    assert abs(module.log_sigma.item() - np.log(2 * SIGMA)) < 0.3


def test_what_cannot_be_trained_on_is_rejected_in_one_line():
    flight, method = flown(1, duration_s=6.0), Batch(noise="nominal")
    with pytest.raises(BadInputError, match="training needs its truth"):
        learn.training_flight(replace(flight, truth=None), method)
    imu = replace(flight.imu, position_b_m=np.array([0.1, 0.0, 0.0]))
    with pytest.raises(BadInputError, match=r"key imu\.position_b_m: positions and velocities"):
        learn.training_flight(replace(flight, imu=imu), method)
    trained = learn.training_flight(flight, method)
    with pytest.raises(BadInputError, match=r"'wind' is no noise of flight .*, which has acceler"):
        learn.posterior(trained, [], {"wind": torch.tensor(0.0)})
    with pytest.raises(BadInputError, match="needs a flight and a worker, got 0 and 1"):
        learn.FlightPool([], method, 1)
