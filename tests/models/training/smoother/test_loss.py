"""The likelihood of the truth as torch's loss: its derivative, and what it teaches."""

import dataclasses

import msgspec
import numpy as np
import pytest
import torch

from fgnav.checks import BadInputError, NoSolutionError
from fgnav.gravity import LowDynamics
from fgnav.methods.smoother import Batch
from fgnav.solve.adjoint import Judged, LinearisedFlight
from fgnav_models.training.smoother.flights import TrainingFlight, training_flight
from fgnav_models.training.smoother.loss import negative_log_likelihood
from fgnav_sim.data_sets.gravity import gravity_flight
from fgnav_sim.data_sets.gravity_world import GravityWorld
from tests.solve.linear_flight import dense, random_problem

N, ATTITUDE = 12, np.arange(3)


def drawn(seed, count=6):
    """Return a flight whose truth is drawn from its posterior, and what the truth's rows are."""
    rng = np.random.default_rng(seed)
    problem = random_problem(N, aux=3, b=2, seed=seed)
    H, g, _ = dense(problem, problem.start)
    truth = -np.linalg.solve(H, g) + np.linalg.solve(
        np.linalg.cholesky(H).T, rng.normal(size=len(H))
    )
    steps = truth[: N * problem.width].reshape(N, -1)
    flight = TrainingFlight(
        name=f"random {seed}",
        t_s=problem.t_s,
        states=problem.start,
        linearised=LinearisedFlight.at(problem, problem.start),
        judged=Judged(np.arange(N), ATTITUDE, steps[:, :3]),
    )
    row, jacobian = np.sort(rng.choice(N, count, replace=False)), np.zeros((count, 2, 12))
    jacobian[:, :, ATTITUDE] = rng.normal(size=(count, 2, 3))
    return flight, row, jacobian, np.einsum("mfd,md->mf", jacobian, steps[row])


def test_torch_has_its_derivative():
    flight, row, jacobian, true = drawn(1)

    def loss(residual, root, shared):
        covariance = root @ root.transpose(1, 2) + 0.1 * torch.eye(2, dtype=root.dtype)
        return negative_log_likelihood(flight, row, jacobian, residual, covariance, shared)

    rng = np.random.default_rng(2)
    inputs = (-true, rng.normal(size=(len(row), 2, 2)), rng.normal(size=(len(row), 2, 2)))
    tensors = tuple(torch.from_numpy(x).requires_grad_() for x in inputs)
    assert torch.autograd.gradcheck(loss, tensors, eps=1e-6, atol=1e-6)


def test_a_network_learns_through_the_smoother_how_sure_it_is():
    """Answers with errors of 0.2 that are stated as 1 and as 0.04."""
    rng, sigma = np.random.default_rng(3), 0.2
    flights = [drawn(seed) for seed in range(20)]
    answers = [true + sigma * rng.normal(size=true.shape) for *_, true in flights]
    for stated in (1.0, 0.04):
        log_sigma = torch.tensor(np.log(stated), requires_grad=True)
        optimiser = torch.optim.LBFGS([log_sigma], line_search_fn="strong_wolfe")

        def loss(optimiser=optimiser, log_sigma=log_sigma):
            covariance = torch.exp(2 * log_sigma) * torch.eye(2, dtype=torch.float64)
            unused = [
                negative_log_likelihood(
                    flight, row, jacobian, -torch.from_numpy(z), covariance.expand(len(row), 2, 2)
                )
                for (flight, row, jacobian, _), z in zip(flights, answers, strict=True)
            ]
            optimiser.zero_grad()
            mean = torch.stack(unused).mean()
            mean.backward()
            return mean

        optimiser.step(loss)
        # 240 errors: 1-sigma of 5 % if they were seen directly, behind a posterior of 0.3 rad more.
        assert abs(float(log_sigma.detach()) - np.log(sigma)) < 0.2


@pytest.fixture(scope="module")
def flight():
    world, rng = GravityWorld(accelerometer_arm_m=(0.0, 0.0, 0.0)), np.random.default_rng(4)
    short = msgspec.structs.replace(world.windows, flight_s=5.0)
    return gravity_flight(msgspec.structs.replace(world, windows=short), "rocket", rng=rng)


def test_a_flight_is_linearised_at_the_batch_and_judged_by_its_truth(flight):
    method = Batch(gravity=LowDynamics(), noise="nominal")
    found = training_flight(flight, method, without="gravity")
    estimate = method(flight)
    np.testing.assert_allclose(found.states.R_nb, estimate.R_nb, rtol=0, atol=1e-3)
    names = {one.name for one in found.linearised.problem.sensors}
    assert names == {"position", "velocity", "aerodynamic angles"}
    assert found.judged.which.tolist() == [0, 1, 2, 6, 7, 8]
    of_truth = flight.truth.v_n_mps[np.searchsorted(flight.truth.t_s, found.t_s - 1e-6)]
    moved = found.states.v_n_mps + found.judged.step[:, 3:]
    np.testing.assert_allclose(moved[found.judged.row], of_truth[found.judged.row], atol=1e-6)
    np.testing.assert_array_equal(found.rows(found.t_s[[3, 7]]), [3, 7])
    np.testing.assert_array_equal(found.rows(found.t_s[[3]] + 0.01), [-1])


def test_a_flight_that_cannot_be_learned_from_is_refused(flight):
    method = Batch(noise="nominal")
    with pytest.raises(BadInputError, match="training needs its truth"):
        training_flight(dataclasses.replace(flight, truth=None), method)
    imu = dataclasses.replace(flight.imu, position_b_m=np.array([0.1, 0.0, 0.0]))
    with pytest.raises(BadInputError, match=r"key imu\.position_b_m: velocities are judged at"):
        training_flight(dataclasses.replace(flight, imu=imu), method)
    turned = np.diag([-1.0, -1.0, 1.0])
    truth = dataclasses.replace(flight.truth, R_nb=turned @ flight.truth.R_nb)
    with pytest.raises(NoSolutionError, match="degrees from the truth: nothing is learned there"):
        training_flight(dataclasses.replace(flight, truth=truth), method)


def rms_deg(estimate, flight):
    from fgnav.geometry.rotations import log, transpose

    R_nb = flight.truth.R_nb[np.searchsorted(flight.truth.t_s, estimate.t_s - 1e-6)]
    return np.degrees(np.sqrt((log(transpose(estimate.R_nb) @ R_nb) ** 2).mean()))
