"""A flight's posterior as torch differentiates it, through the smoother's nonlinear minimum.

    posterior = learn.posterior(flight, [factor], {"accelerometer": log_factor})
    learn.nll(posterior, flight.truth).backward()

Forward is GTSAM's minimum, begun where it was the last time; backward is the implicit function
theorem (``fgnav.solve.adjoint``). The weak prior of the first keyframe's pose, and the method's
factors that are not trained, count as linear.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from fgnav.checks import BadInputError, FloatArray
from fgnav.graph.build import Layout
from fgnav.graph.keys import Timeline
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.states import AUX, States
from fgnav.kernels.one_thread import in_one_thread
from fgnav.methods.smoothing.custom_sources import custom_constants, with_timelines
from fgnav.neural.factor import NeuralFactor
from fgnav.solve.adjoint import Adjoint, PosteriorCovariance, terms_of
from fgnav.solve.gauss_newton import elimination_at
from fgnav_models.learn.answers import AnswerTerm, Tensor, answers_of, skew
from fgnav_models.learn.flights import TrainingFlight

_STEP = 1e-4  # of logarithms, for differences: about the cube root of rounding


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
    """A flight's minimum, what is known of it, and the answers and parameters that it has."""

    problem_at: Callable[[FloatArray], Problem]  # of parameters
    parameters: FloatArray  # (c,)
    states: States
    covariance: PosteriorCovariance
    marginals: FloatArray  # (n, D, D)
    answers: tuple[AnswerTerm, ...]

    def adjoint(self, by_step: FloatArray, by_covariance: FloatArray) -> Adjoint:
        """Return the adjoint of a function of the first coordinates of each keyframe."""
        a, B = np.zeros(self.marginals.shape[:2]), np.zeros_like(self.marginals)
        a[:, :AUX] = by_step
        B[:, :AUX, :AUX] = (by_covariance + by_covariance.swapaxes(1, 2)) / 2
        terms = terms_of(self.problem_at(self.parameters))
        return self.covariance.adjoint(a, B, [*terms, *self.answers])

    def by_parameters(self, adjoint: Adjoint) -> list[float]:
        """Return the derivatives by parameters."""
        derivatives = []
        for step in _STEP * np.eye(len(self.parameters)):
            ends = (terms_of(self.problem_at(self.parameters + h)) for h in (-step, step))
            pairs = zip(*ends, strict=True)
            changes = (adjoint.change(low, high, self.states) for low, high in pairs)
            derivatives.append(sum(changes) / (2 * _STEP))
        return derivatives


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
        Logarithms of factors, scalars. On standard deviations: ``"accelerometer"``,
        ``"gyroscope"``, their biases, and sensors by name, such as ``"position"``; without a
        gyroscope on those of the rate's process, ``"rate"``, and on its lengths of correlation,
        ``"rate length"``.

    Raises
    ------
    BadInputError
        If an answer breaks the contract, or there is no parameter of that name.
    NoSolutionError
        If the data leave a state open, or the search ends in no minimum.
    """
    parameters = parameters or {}
    asked, hyperparameters = custom_constants(factors), flight.hyperparameters
    unknown = [name for name in parameters if name not in hyperparameters.names]
    if unknown:
        raise BadInputError(
            f"parameters: {unknown[0]!r} is no noise of flight {flight.flight.name}, which has "
            f"{', '.join(hyperparameters.names)}"
        )

    def problem_at(logs: FloatArray) -> Problem:
        given = dict(zip(parameters, logs.tolist(), strict=True))
        return hyperparameters.problem_at(given).with_constants(asked)

    given = np.array([float(x.detach()) for x in parameters.values()])
    problem = problem_at(given)
    timeline = Timeline(t_s=problem.t_s, gyroscope=Layout.of(problem).gyroscope)
    first = len(flight.prepared.problem.constants.parts)
    custom, terms = list(flight.fixed), []
    for source, of_source in with_timelines(factors, timeline, first):
        made, found = answers_of(source, flight.flight, of_source, problem.constants)
        custom += made
        terms += found
    states = flight.minimum(problem, custom)
    elimination = elimination_at(problem, states, [factor.factor for factor in custom])
    solved = _Minimum(
        problem_at,
        given,
        states,
        PosteriorCovariance(elimination, Layout.of(problem), states),
        elimination.marginals().covariance,
        tuple(term.detached() for term in terms),
    )
    answered = [x for term in terms for x in (term.value, term.covariance)]
    step, P = _Differentiated.apply(solved, *answered, *parameters.values())
    turn, moved, faster = step.split(3, dim=1)
    R, p, v = (torch.from_numpy(x) for x in states[:3])
    p_n_m = p + (R @ moved[:, :, None])[:, :, 0]
    R_nb = R @ (torch.eye(3).double() + skew(turn))
    turned = torch.eye(AUX).double().repeat(len(P), 1, 1)
    turned[:, 3:6, 3:6] = R_nb
    return Posterior(
        t_s=problem.t_s,
        R_nb=R_nb,
        p_n_m=p_n_m,
        v_n_mps=v + faster,
        covariance=turned @ P @ turned.mT,
    )


class _Differentiated(torch.autograd.Function):  # type: ignore[misc]  # mypy skips torch
    """Steps from the minimum, zero, and marginal covariances, by answers and parameters."""

    @staticmethod
    def forward(
        ctx: Any,  # noqa: ANN401  # torch's own
        solved: _Minimum,
        *given: Tensor,
    ) -> tuple[Tensor, Tensor]:
        ctx.solved = solved
        ctx.save_for_backward(*given)
        P = solved.marginals[:, :AUX, :AUX].copy()
        return torch.zeros(len(P), AUX, dtype=torch.double), torch.from_numpy(P)

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
        for i, term in enumerate(solved.answers):
            inputs = [x.detach().clone().requires_grad_() for x in given[2 * i : 2 * i + 2]]
            again = replace(term, value=inputs[0], covariance=inputs[1])
            with torch.enable_grad():
                value = again.adjoint_value(adjoint, solved.states)
            gradients += torch.autograd.grad(value, inputs, allow_unused=True)
        parameters = given[2 * len(solved.answers) :]
        by_parameters = solved.by_parameters(adjoint)
        gradients += (x.new_tensor(d) for x, d in zip(parameters, by_parameters, strict=True))
        return None, *gradients
