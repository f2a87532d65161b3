"""A flight's posterior as torch differentiates it, through the smoother's nonlinear minimum.

    posterior = learn.posterior(flight, [factor], {"accelerometer": log_factor})
    learn.nll(posterior, flight.truth).backward()

Forward is GTSAM's minimum, begun where it was the last time; backward is the implicit function
theorem (``fgnav.solve.adjoint``). The weak priors of the first keyframe, and the method's factors
that are not trained, count as linear.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from fgnav.checks import BadInputError, FloatArray
from fgnav.graph import keys
from fgnav.graph.build import Layout
from fgnav.graph.custom import NamedFactor
from fgnav.graph.keys import Timeline
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.states import States
from fgnav.kernels.one_thread import in_one_thread
from fgnav.methods.smoothing.custom_sources import custom_constants, with_timelines
from fgnav.neural.factor import NeuralFactor
from fgnav.noise.components import NoiseComponents
from fgnav.solve.adjoint import Adjoint, PosteriorCovariance, terms_of
from fgnav.solve.gauss_newton import elimination_at
from fgnav_models.learn.answers import AnswerTerm, Tensor, answers_in_si, skew
from fgnav_models.learn.flights import TrainingFlight
from fgnav_models.learn.modules import module_of

_TANGENT = 9  # rotation, position, velocity


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Posterior:
    """Means and covariances of a flight's keyframes, given all its data.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
    R_nb : tensor, shape (n, 3, 3)
    p_n_m, v_n_mps : tensor, shape (n, 3)
    covariance : tensor, shape (n, 9, 9)
        Of the attitude in body axes, of position and velocity in ``n``.
    """

    t_s: FloatArray
    R_nb: Tensor
    p_n_m: Tensor
    v_n_mps: Tensor
    covariance: Tensor


@dataclass(frozen=True, eq=False, slots=True)
class _Minimum:
    """A flight's minimum, what is known of it, and the answers and noise that it was found with."""

    problem: Problem
    states: States
    covariance: PosteriorCovariance
    marginals: FloatArray  # (n, D, D)
    terms: tuple[AnswerTerm, ...]
    noise: tuple[NoiseComponents, FloatArray] | None  # and logarithms of its factors, (c,)
    names: tuple[str, ...]  # of the parameters

    def adjoint(self, by_step: FloatArray, by_covariance: FloatArray) -> Adjoint:
        """Return the adjoint of a function of the first coordinates of each keyframe."""
        a, B = np.zeros(self.marginals.shape[:2]), np.zeros_like(self.marginals)
        a[:, :_TANGENT] = by_step
        symmetric = (by_covariance + by_covariance.swapaxes(1, 2)) / 2
        B[:, :_TANGENT, :_TANGENT] = symmetric
        terms = [*terms_of(self.problem), *self.terms]
        return self.covariance.adjoint(a, B, terms, terms)

    def by_noise(self, adjoint: Adjoint) -> FloatArray:
        """Return the derivatives by logarithms of standard deviations, in the order of names."""
        if self.noise is None:
            return np.empty(0)
        components, theta = self.noise
        motion, *sensors = (
            adjoint.between_rows(one, self.states) for one in terms_of(self.problem)
        )
        traces = components.traces(theta, self.problem, motion, sensors)
        return -2 * traces[[components.names.index(name) for name in self.names]]


@in_one_thread
def posterior(
    flight: TrainingFlight,
    factors: Sequence[NeuralFactor],
    parameters: Mapping[str, Tensor] | None = None,
) -> Posterior:
    """Return the posterior of a flight given what live modules say, and noise.

    Parameters
    ----------
    flight : TrainingFlight
    factors : sequence of NeuralFactor
        Of ``learn.factor``.
    parameters : mapping of str to tensor, optional
        Logarithms of factors on standard deviations, scalars: ``"accelerometer"``,
        ``"gyroscope"``, their biases, and sensors by name, such as ``"position"``.

    Raises
    ------
    BadInputError
        If an answer breaks the contract, or there is no parameter of that name.
    NoSolutionError
        If the data leave a state open, or the search ends in no minimum.
    """
    parameters = parameters or {}
    problem = flight.prepared.problem.with_constants(custom_constants(factors))
    timeline = Timeline(t_s=problem.t_s, gyroscope=Layout.of(problem).gyroscope)
    first = len(flight.prepared.problem.constants.parts)
    custom, terms = list(flight.fixed), []
    for source, of_source in with_timelines(factors, timeline, first):
        made, found = _asked(source, flight, of_source, problem)
        custom += made
        terms += found
    noise = None
    if parameters:
        noise = _noise(problem, parameters, flight.flight.name)
        components, theta = noise
        problem = components.problem_at(theta)
    states = flight.minimum(problem, custom)
    elimination = elimination_at(problem, states, [one.factor for one in custom])
    solved = _Minimum(
        problem,
        states,
        PosteriorCovariance(elimination, Layout.of(problem), states),
        elimination.marginals().covariance,
        tuple(one.detached() for one in terms),
        noise,
        tuple(parameters),
    )
    answered = [x for term in terms for x in (term.value, term.covariance)]
    step, P = _Differentiated.apply(solved, *answered, *parameters.values())
    turn, moved, faster = step.split(3, dim=1)
    R, p, v = (torch.from_numpy(x) for x in states[:3])
    p_n_m = p + (R @ moved[:, :, None])[:, :, 0]
    R_nb = R @ (torch.eye(3).double() + skew(turn))
    turned = torch.eye(_TANGENT).double().repeat(len(P), 1, 1)
    turned[:, 3:6, 3:6] = R_nb
    return Posterior(
        t_s=problem.t_s,
        R_nb=R_nb,
        p_n_m=p_n_m,
        v_n_mps=v + faster,
        covariance=turned @ P @ turned.mT,
    )


def _asked(
    source: NeuralFactor, flight: TrainingFlight, timeline: Timeline, problem: Problem
) -> tuple[list[NamedFactor], list[AnswerTerm]]:
    """Return the factors of a module's answers, and the same as torch differentiates them."""
    module, network = module_of(source), source.network
    factors, terms = [], []
    for queries in source.queries(flight.flight, timeline):
        if not len(queries.rows):
            continue
        raw = module.outputs_of(network.feed(queries.inputs))
        answers = network.read([x.detach().double().reshape(len(x), -1).numpy() for x in raw])
        factors += source.factors_of(queries, answers)
        value, covariance = answers_in_si(network.manifest.output, raw)
        counted, joins = queries.counted, network.manifest.output.over_s is not None
        lasting = problem.constants.first[keys.index(counted.key)] if counted.key >= 0 else 0
        term = AnswerTerm(
            output=network.manifest.output,
            counted=counted,
            keyframes=queries.rows if joins else queries.rows[:, 1:],
            value=value,
            covariance=covariance,
            lasting=lasting,
        )
        terms.append(term)
    return factors, terms


def _noise(
    problem: Problem, parameters: Mapping[str, Tensor], flight: str
) -> tuple[NoiseComponents, FloatArray]:
    """Return the noise of a problem, and the logarithms of its factors."""
    components = NoiseComponents.of(problem, tuple(one.name for one in problem.sensors), None)
    unknown = [name for name in parameters if name not in components.names]
    if unknown:
        raise BadInputError(
            f"parameters: {unknown[0]!r} is no noise of flight {flight}, which has "
            f"{', '.join(components.names)}"
        )
    given = {name: float(x.detach()) for name, x in parameters.items()}
    return components, np.array([given.get(name, 0.0) for name in components.names])


class _Differentiated(torch.autograd.Function):  # type: ignore[misc]  # mypy skips torch
    """Steps from the minimum, zero, and marginal covariances, as functions of answers and noise."""

    @staticmethod
    def forward(
        ctx: Any,  # noqa: ANN401  # torch's own
        solved: _Minimum,
        *given: Tensor,
    ) -> tuple[Tensor, Tensor]:
        ctx.solved = solved
        ctx.save_for_backward(*given)
        P = solved.marginals[:, :_TANGENT, :_TANGENT].copy()
        return torch.zeros(len(P), _TANGENT, dtype=torch.double), torch.from_numpy(P)

    @staticmethod
    @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]  # as above
    def backward(
        ctx: Any,  # noqa: ANN401  # as above
        by_step: Tensor,
        by_covariance: Tensor,
    ) -> tuple[Tensor | None, ...]:
        solved, given = ctx.solved, ctx.saved_tensors
        adjoint = solved.adjoint(by_step.numpy(), by_covariance.numpy())
        gradients: list[Tensor] = []
        for i, term in enumerate(solved.terms):
            inputs = [x.detach().clone().requires_grad_() for x in given[2 * i : 2 * i + 2]]
            again = replace(term, value=inputs[0], covariance=inputs[1])
            with torch.enable_grad():
                value = again.adjoint_value(adjoint, solved.states)
            gradients += torch.autograd.grad(value, inputs, allow_unused=True)
        thetas = given[2 * len(solved.terms) :]
        by_noise = solved.by_noise(adjoint).tolist()
        gradients += (x.new_tensor(d) for x, d in zip(thetas, by_noise, strict=True))
        return None, *gradients
