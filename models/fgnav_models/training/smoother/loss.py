"""The likelihood of a flight's truth as a loss: torch differentiates the network, we the smoother.

    residual, covariance = ...          # torch, of the network's answers at some keyframes
    loss = negative_log_likelihood(flight, row, jacobian, residual, covariance)
    loss.backward()

The derivatives by residuals, covariances and Jacobians by constants are exact for the linearised
flight (``fgnav.solve.adjoint``), one adjoint pass each time; torch goes on from there.
"""

from typing import Any

import torch

from fgnav.checks import FloatArray, IntArray
from fgnav_models.training.smoother.flights import TrainingFlight


def negative_log_likelihood(
    flight: TrainingFlight,
    row: IntArray,
    jacobian: FloatArray,
    residual: torch.Tensor,
    covariance: torch.Tensor,
    shared: torch.Tensor | None = None,
) -> torch.Tensor:
    """Return the mean over keyframes of minus the log density of the truth, a scalar.

    Parameters
    ----------
    row : ndarray of int, shape (m,)
        Keyframes of the answers.
    jacobian : ndarray, shape (m, f, D)
        Of residuals by the keyframe's tangent, where the flight is linearised.
    residual : tensor, shape (m, f)
        Estimate less answer there.
    covariance : tensor, shape (m, f, f)
    shared : tensor, shape (m, f, b), optional
        Jacobian by the flight's constants; none by default.

    Raises
    ------
    NoSolutionError
        If the flight leaves a state open.
    """
    if shared is None:
        width = flight.linearised.problem.constants.width
        shared = residual.new_zeros(*residual.shape, width)
    loss: torch.Tensor = _Likelihood.apply(flight, row, jacobian, residual, covariance, shared)
    return loss


class _Likelihood(torch.autograd.Function):  # type: ignore[misc]  # mypy skips torch
    @staticmethod
    def forward(
        ctx: Any,  # noqa: ANN401  # torch's own
        flight: TrainingFlight,
        row: IntArray,
        jacobian: FloatArray,
        residual: torch.Tensor,
        covariance: torch.Tensor,
        shared: torch.Tensor,
    ) -> torch.Tensor:
        r, C, J = (x.detach().double().cpu().numpy() for x in (residual, covariance, shared))
        likelihood = flight.linearised.likelihood(row, jacobian, r, C, flight.judged, J)
        ctx.save_for_backward(
            torch.from_numpy(likelihood.by_residual).to(residual),
            torch.from_numpy(likelihood.by_covariance).to(covariance),
            torch.from_numpy(likelihood.by_shared).to(shared),
        )
        return residual.new_tensor(likelihood.nll)

    @staticmethod
    @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]  # as above
    def backward(
        ctx: Any,  # noqa: ANN401  # as above
        by_loss: torch.Tensor,
    ) -> tuple[None, None, None, torch.Tensor, torch.Tensor, torch.Tensor]:
        by_residual, by_covariance, by_shared = (by_loss * x for x in ctx.saved_tensors)
        return None, None, None, by_residual, by_covariance, by_shared
