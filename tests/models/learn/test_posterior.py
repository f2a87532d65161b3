"""Gradients through the smoother's minimum, against differences of flights that are solved anew."""

from dataclasses import replace

import gtsam
import msgspec
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from fgnav import BadInputError, Batch
from fgnav.evaluation.figures import energy_score, negative_log_likelihood
from fgnav.evaluation.reference import truth_at
from fgnav.geometry.rotations import log as rotation_log
from fgnav.geometry.rotations import transpose
from fgnav.graph.build import Layout
from fgnav.graph.keys import Timeline
from fgnav.neural.measures import MEASURES
from fgnav.neural.records import Record
from fgnav.solve.adjoint import PosteriorCovariance
from fgnav.solve.gauss_newton import elimination_at
from fgnav.solve.linear import linearise
from fgnav_models import learn
from fgnav_models.learn.answers import answers_in_si, log
from fgnav_models.learn.posterior import _asked
from tests.models.learn.small import RATE_HZ, flown

OVER_S = 1.0


def said(flight, measures, frame, rng):
    """Return what a perfect sensor of a quantity records, with noise, and its unit."""
    truth = flight.truth
    t_s = np.arange(truth.t_s[0] + OVER_S, truth.t_s[-1], 1 / RATE_HZ)
    now, before = truth_at(truth, t_s), truth_at(truth, t_s - OVER_S)
    R_bn = transpose(now.R_nb)
    if measures == "velocity":
        values = now.v_n_mps if frame == "n" else np.einsum("nij,nj->ni", R_bn, now.v_n_mps)
    elif measures == "displacement":
        values = now.p_n_m - before.p_n_m
        if frame == "b":
            values = np.einsum("nji,nj->ni", before.R_nb, values)
    elif measures == "attitude":
        values = Rotation.from_matrix(now.R_nb).as_quat(scalar_first=True)
    else:
        values = {
            "direction": now.R_nb[:, 2],
            "heading": np.stack([now.R_nb[:, 0, 0], now.R_nb[:, 1, 0]], axis=1),
            "speed": np.linalg.norm(now.v_n_mps, axis=1)[:, None],
            "height": -now.p_n_m[:, 2:],
            "position": now.p_n_m,
        }[measures]
    return t_s, values + 0.02 * rng.standard_normal(values.shape)


class Sensor(torch.nn.Module):
    """The last sample, a little off, and an uncertainty that changes with it."""

    def __init__(self, channels, uncertain, seed, *, unit):
        super().__init__()
        self.unit = unit
        torch.manual_seed(seed)
        self.off = torch.nn.Parameter(0.05 * torch.randn(channels))
        self.gain = torch.nn.Parameter(torch.tensor(1.01))
        self.uncertain = torch.nn.Parameter(0.3 * torch.randn(uncertain) - 1.0)
        self.double()

    def forward(self, x):
        last = x[:, -1]
        uncertain = self.uncertain + 0.3 * torch.tanh(last.mean(dim=1, keepdim=True))
        if len(self.uncertain) == 6:
            diagonal = torch.tensor([True, False, True, False, False, True])
            uncertain = torch.where(diagonal, uncertain.exp(), 0.3 * uncertain)
        answer = self.gain * last + self.off
        return answer / answer.norm(dim=1, keepdim=True) if self.unit else answer, uncertain


CASES = [
    ("velocity", "b", "cholesky", {}),
    ("velocity", "b", "log_sigma", {"lasting": 0.3, "half_life_s": 0.1}),
    ("velocity", "n", "log_sigma", {}),
    ("displacement", "b", "cholesky", {"over_s": OVER_S}),
    ("displacement", "n", "log_sigma", {"over_s": OVER_S, "half_life_s": 0.2}),
    ("direction", "b", "log_sigma", {}),
    ("attitude", "n", "cholesky", {"lasting": 0.2}),
    ("heading", "n", "log_sigma", {}),
    ("speed", "n", "log_sigma", {}),
    ("height", "n", "log_sigma", {}),
    ("position", "n", "cholesky", {}),
]
UNIT = ("attitude", "direction")
FREEDOM = {"heading": 1, "speed": 1, "height": 1}


def drawn(seed):
    """Return a training flight, a factor of a live module, and weights of what is looked at."""
    measures, frame, form, more = CASES[seed]
    flight, rng = (
        flown(seed, duration_s=8.0, accelerometer_noise_mps2_per_sqrt_hz=0.01),
        np.random.default_rng(seed),
    )
    t_s, values = said(flight, measures, frame, rng)
    record = Record(t_s=t_s, values=values, unit="unit", frame=frame)
    seen = learn.input_of("sensor", values[:, None], RATE_HZ, unit="unit", frame=frame)
    d = values.shape[1]
    plain = {"mean": (0.0,) * d, "scale": (1.0,) * d, "range": ((-1e4, 1e4),) * d}
    f = FREEDOM.get(measures, 3)
    module = Sensor(d, f * (f + 1) // 2 if form == "cholesky" else f, seed, unit=measures in UNIT)
    factor = learn.factor(
        module,
        measures,
        [msgspec.structs.replace(seen, **plain)],
        covariance=form,
        frame=frame,
        records={"sensor": record},
        **more,
    )
    trained = learn.training_flight(flight, Batch(noise="nominal"))
    return trained, factor, module, rng


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


@pytest.mark.parametrize("seed", range(len(CASES)))
def test_gradients_are_differences_of_flights_solved_anew(seed):
    trained, factor, module, rng = drawn(seed)
    noise = {"accelerometer": torch.tensor(0.2), "position": torch.tensor(-0.3)}
    noise = {name: x.double().requires_grad_() for name, x in noise.items()}
    n = len(trained.prepared.problem.t_s)
    of_mean, of_covariance = (torch.from_numpy(rng.normal(size=s)) for s in ((n, 9), (n, 9, 9)))

    def solved():
        for _ in range(4):  # each search begins where the last one ended
            learn.posterior(trained, [factor], noise)
        return learn.posterior(trained, [factor], noise)

    start = solved()
    origin = [x.detach() for x in (start.R_nb, start.p_n_m, start.v_n_mps)]
    scale = start.covariance.detach().diagonal(dim1=1, dim2=2).sqrt()

    def mean_and_covariance():
        found = solved()
        turn = log(origin[0].mT @ found.R_nb)
        moved = torch.cat([turn, found.p_n_m - origin[1], found.v_n_mps - origin[2]], dim=1)
        relative = found.covariance / scale[:, :, None] / scale[:, None]
        return torch.stack([(of_mean * moved / scale).sum(), (of_covariance * relative).sum()])

    parameters = [*module.parameters(), *noise.values()]
    ours = [
        torch.autograd.grad(one, parameters, retain_graph=True) for one in mean_and_covariance()
    ]
    for i, x in enumerate(parameters):
        # What a flight knows hardly answers to an accelerometer's noise.
        step = 3e-3 if x is noise["accelerometer"] else 1e-4
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
    custom, (term,) = _asked(factor, trained, timeline, problem)
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
    ours = torch.autograd.grad(again.adjoint_value(covariance.adjoint(a, B, (), ()), states), given)
    for gradient, exact in zip(ours, expected, strict=True):
        assert (gradient - exact).norm() < 1e-8 * exact.norm()


@pytest.mark.parametrize(("measures", "frame", "form", "more"), CASES)
def test_outputs_mean_what_they_mean_to_the_factor(measures, frame, form, more):
    f, rng = FREEDOM.get(measures, 3), np.random.default_rng(1)
    widths = MEASURES[measures].widths
    unit, d = measures in UNIT, widths[-1]
    module = Sensor(d, f * (f + 1) // 2 if form == "cholesky" else f, 1, unit=unit)
    seen = learn.input_of("sensor", np.ones((1, 1, d)), 1.0, unit="unit", frame=frame)
    factor = learn.factor(module, measures, [seen], covariance=form, frame=frame, **more)
    for width in widths:
        raw = rng.normal(size=(5, width))
        if width == 9:
            raw = 0.2 * raw + np.eye(3).ravel()
        elif unit:
            raw /= np.linalg.norm(raw, axis=1, keepdims=True)
        uncertain = np.exp(0.1 * rng.normal(size=(5, len(module.uncertain))))
        answers = factor.network.read([raw, uncertain])
        outputs = [torch.from_numpy(raw), torch.from_numpy(uncertain)]
        value, covariance = answers_in_si(factor.network.manifest.output, outputs)
        np.testing.assert_allclose(value, answers.value, rtol=0, atol=1e-12)
        np.testing.assert_allclose(covariance, answers.covariance, rtol=1e-12)


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


def test_scores_are_those_of_evaluations():
    trained, factor, *_ = drawn(0)
    found = learn.posterior(trained, [factor])
    truth = truth_at(trained.truth, found.t_s)
    error = rotation_log(transpose(found.R_nb.detach().numpy()) @ truth.R_nb)
    covariance = found.covariance.detach().numpy()[:, :3, :3]
    nll, energy = (of(error, covariance) for of in (negative_log_likelihood, energy_score))
    found_nll = learn.nll(found, trained.truth, ["attitude"])
    assert float(found_nll.detach()) == pytest.approx(nll, rel=1e-3)
    found_energy = learn.energy_score(found, trained.truth, "attitude")
    assert float(found_energy.detach()) == pytest.approx(energy, rel=3e-3)  # of nodes


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
