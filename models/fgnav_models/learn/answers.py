"""Residuals of a network's outputs in torch, differentiable by the outputs.

Values, covariances and residuals are those of ``neural.network`` and ``neural.outputs``. Jacobians
are by tangents of ``fgnav.graph.keys`` less ``aux``: rotation and position in body axes, velocity
in ``n``; as a factor of a rotation ``1 + skew(d)`` is ``Exp(d)`` to first order.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import torch

from fgnav.checks import FloatArray, IntArray
from fgnav.graph import keys
from fgnav.graph.custom import NamedFactor
from fgnav.graph.keys import Timeline
from fgnav.graph.types.parameters import Parameters
from fgnav.graph.types.states import AUX, States
from fgnav.neural.factor import NeuralFactor
from fgnav.neural.manifest import Output
from fgnav.neural.outputs import Counted
from fgnav.solve.adjoint import Adjoint, states_of
from fgnav.types.flight import Flight
from fgnav_models.learn.modules import module_of

Tensor: TypeAlias = torch.Tensor


def skew(v: Tensor) -> Tensor:
    """Return the matrices of cross products with vectors, (..., 3)."""
    x, y, z = v.unbind(-1)
    none = torch.zeros_like(x)
    return torch.stack([none, -z, y, z, none, -x, -y, x, none], dim=-1).unflatten(-1, (3, 3))


def log(R: Tensor) -> Tensor:
    """Return the rotation vectors of rotations, (..., 3, 3), less than half a turn."""
    S = R - R.mT
    w = torch.stack([S[..., 2, 1], S[..., 0, 2], S[..., 1, 0]], dim=-1) / 2
    squared = (w * w).sum(-1, keepdim=True)
    cosine = (R.diagonal(dim1=-2, dim2=-1).sum(-1, keepdim=True) - 1) / 2
    is_small = (squared < 1e-6) & (cosine > 0)  # where the next term of the series is rounding
    sine = torch.where(is_small, 1.0, squared).sqrt()
    angle = torch.atan2(sine, torch.where(is_small, 1.0, cosine))
    series = 1 + squared / 6 + 3 * squared**2 / 40
    return w * torch.where(is_small, series, angle / sine)


class _Root(torch.autograd.Function):  # type: ignore[misc]  # mypy skips torch
    """The symmetric root; torch's eigenvectors have no derivative where eigenvalues are equal."""

    @staticmethod
    def forward(ctx: Any, P: Tensor) -> Tensor:  # noqa: ANN401  # torch's own
        variance, axes = torch.linalg.eigh(P)
        sigma = variance.clamp_min(0.0).sqrt()
        ctx.save_for_backward(sigma, axes)
        return (axes * sigma[..., None, :]) @ axes.mT

    @staticmethod
    @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]  # as above
    def backward(ctx: Any, by_root: Tensor) -> Tensor:  # noqa: ANN401  # as above
        sigma, axes = ctx.saved_tensors
        inner = axes.mT @ by_root @ axes / (sigma[..., :, None] + sigma[..., None, :])
        return axes @ inner @ axes.mT


def root(P: Tensor) -> Tensor:
    """Return the symmetric roots of covariances, (..., f, f)."""
    found: Tensor = _Root.apply(P)
    return found


def answers_in_si(output: Output, raw: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
    """Return values, (m, d), and covariances, (m, f, f), of outputs that are in the contract."""
    rows, *uncertain = (x.double().reshape(len(x), -1) for x in raw[:2])
    return _value(output, rows), _covariance(output, uncertain, len(rows))


def _value(output: Output, raw: Tensor) -> Tensor:
    if output.measures == "heading" and raw.shape[1] == 2:
        return torch.atan2(raw[:, 1:], raw[:, :1])
    if output.measures == "direction":
        return raw / raw.norm(dim=1, keepdim=True)
    if output.measures != "attitude":
        return raw * output.in_si
    if raw.shape[1] == 4:
        w, *xyz = (raw / raw.norm(dim=1, keepdim=True)).unbind(1)
        v = torch.stack(xyz, dim=1)
        turn = skew(v)
        return (torch.eye(3).double() + 2 * (w[:, None, None] * turn + turn @ turn)).flatten(1)
    A = raw.reshape(-1, 3, 3)
    return torch.linalg.solve(root(A @ A.mT), A).flatten(1)


def _covariance(output: Output, raw: Sequence[Tensor], m: int) -> Tensor:
    f, form = output.measure.freedom, output.covariance.form
    if form == "none":
        sigma = torch.tensor(output.covariance.sigma).double() * output.in_si
        return torch.diag(sigma.expand(f) ** 2).expand(m, f, f)
    if form == "log_sigma":
        return torch.diag_embed((raw[0].exp() * output.in_si).expand(m, f) ** 2)
    L = torch.zeros(m, f, f, dtype=torch.double)
    L[(slice(None), *np.tril_indices(f))] = raw[0] * output.in_si
    return L @ L.mT


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class AnswerTerm:
    """Answers of one network as rows of residuals.

    Attributes
    ----------
    output : Output
    counted : Counted
    keyframes : ndarray of int, shape (m, c)
        Of the window's end; of displacements that of their beginning before.
    value, covariance : tensor, shapes (m, d) and (m, f, f)
        In SI.
    lasting : int
        First column of the constant that lasts among the constants.
    """

    output: Output
    counted: Counted
    keyframes: IntArray
    value: Tensor
    covariance: Tensor
    lasting: int = 0

    def detached(self) -> "AnswerTerm":
        """Return residuals detached from the network."""
        return replace(self, value=self.value.detach(), covariance=self.covariance.detach())

    def linearise(self, states: Sequence[States]) -> tuple[FloatArray, FloatArray]:
        """Return whitened residuals, (m, f), and Jacobians, (m, f, c D + b)."""
        r, J = self._rows(states)
        return r.detach().numpy(), J.detach().numpy()

    def adjoint_value(self, adjoint: Adjoint, states: States) -> Tensor:
        """Return ``Adjoint.value``, which torch differentiates by values and covariances."""
        r, J = self._rows(states_of(self, states))
        step, M = map(torch.from_numpy, adjoint.derivatives(self.keyframes))
        along = torch.einsum("mfw,mw->mf", J, step)
        return (along * r).sum() - torch.einsum("mfw,mwu,mfu->", J, M, J)

    def _rows(self, states: Sequence[States]) -> tuple[Tensor, Tensor]:
        (m, c), D, constants = self.keyframes.shape, states[0].width, states[0].constants
        R, p, v = (
            torch.from_numpy(np.stack([state[i] for state in states], axis=1)) for i in range(3)
        )
        tangent = torch.zeros(m, c, AUX, dtype=torch.double, requires_grad=True)
        with torch.enable_grad():
            turn, moved, faster = tangent.split(3, dim=2)
            p = p + (R @ moved[..., None])[..., 0]
            R, v = R @ (torch.eye(3).double() + skew(turn)), v + faster
            at = _Keyframes(R, p, v)
            r = _RESIDUALS[self.output.measures](self.output, at, self.value)
            blocks = [
                torch.autograd.grad(r[:, i].sum(), tangent, create_graph=True)[0]
                for i in range(r.shape[1])
            ]
        own = torch.nn.functional.pad(torch.stack(blocks, dim=1), (0, D - AUX)).flatten(2)
        across, counted = self._across(), self.counted
        P = across @ self.covariance @ across.mT
        shared = torch.zeros(m, r.shape[1], len(constants), dtype=torch.double)
        if counted.key >= 0:
            by_constant = counted.lasting**0.5 * root(P) @ across
            f = by_constant.shape[2]
            shared[:, :, self.lasting : self.lasting + f] = by_constant
            r = r + by_constant @ torch.from_numpy(constants[self.lasting : self.lasting + f])
        white = torch.linalg.cholesky(counted.inflation * (1 - counted.lasting) * P)
        rows = torch.cat([r[:, :, None], own, shared], dim=2)
        rows = torch.linalg.solve_triangular(white, rows, upper=False)
        return rows[:, :, 0], rows[:, :, 1:]

    def _across(self) -> Tensor:
        """Return the axes of the residual in the tangent of the covariance, (m, f', f)."""
        if self.output.measures == "direction":
            return _across(self.value)
        return torch.eye(self.covariance.shape[1]).double().expand_as(self.covariance)


def answers_of(
    source: NeuralFactor, flight: Flight, timeline: Timeline, constants: Parameters
) -> tuple[list[NamedFactor], list[AnswerTerm]]:
    """Return the factors of a live module's answers, and the same as torch differentiates them.

    Parameters
    ----------
    source : NeuralFactor
    flight : Flight
    timeline : Timeline
        Of the source.
    constants : Parameters
        Of the problem, those of sources among them.
    """
    module, network = module_of(source), source.network
    output = network.manifest.output
    factors, terms = [], []
    for queries in source.queries(flight, timeline):
        if not len(queries.rows):
            continue
        raw = module.outputs_of(network.feed(queries.inputs))
        answers = network.read([x.detach().double().reshape(len(x), -1).numpy() for x in raw])
        factors += source.factors_of(queries, answers)
        value, covariance = answers_in_si(output, raw)
        key = queries.counted.key
        term = AnswerTerm(
            output=output,
            counted=queries.counted,
            keyframes=queries.rows[:, 1:] if output.over_s is None else queries.rows,
            value=value,
            covariance=covariance,
            lasting=constants.first[keys.index(key)] if key >= 0 else 0,
        )
        terms.append(term)
    return factors, terms


def _across(direction: Tensor) -> Tensor:
    """Return two axes across unit vectors, (m, 2, 3), that turn with these the shortest way."""
    at = direction.detach()
    axes = torch.linalg.svd(at[:, None]).Vh[:, 1:]
    between = (at + direction) / (1 + (at * direction).sum(1, keepdim=True))
    return axes - (axes @ direction[:, :, None]) * between[:, None]


class _Keyframes(NamedTuple):
    """States at the keyframes of answers, c of each."""

    R_nb: Tensor  # (m, c, 3, 3)
    p_n_m: Tensor  # (m, c, 3)
    v_n_mps: Tensor  # (m, c, 3)

    def in_body(self, a_n: Tensor) -> Tensor:
        """Return vectors, (m, 3), in the first keyframe's body axes."""
        return (self.R_nb[:, 0].mT @ a_n[:, :, None])[:, :, 0]


_Residual: TypeAlias = Callable[[Output, _Keyframes, Tensor], Tensor]


def _heading(_: Output, at: _Keyframes, value: Tensor) -> Tensor:
    turn = torch.atan2(at.R_nb[:, 0, 1, 0], at.R_nb[:, 0, 0, 0])[:, None] - value
    return torch.atan2(turn.sin(), turn.cos())


def _velocity(output: Output, at: _Keyframes, value: Tensor) -> Tensor:
    v_n_mps = at.v_n_mps[:, 0]
    return (at.in_body(v_n_mps) if output.frame == "b" else v_n_mps) - value


def _displacement(output: Output, at: _Keyframes, value: Tensor) -> Tensor:
    moved_n_m = at.p_n_m[:, 1] - at.p_n_m[:, 0]
    return (at.in_body(moved_n_m) if output.frame == "b" else moved_n_m) - value


_RESIDUALS: Mapping[str, _Residual] = {
    "heading": _heading,
    "attitude": lambda _, at, z: log(z.reshape(-1, 3, 3).mT @ at.R_nb[:, 0]),
    "direction": lambda _, at, z: (_across(z) @ at.R_nb[:, 0, 2, :, None])[:, :, 0],
    "velocity": _velocity,
    "speed": lambda _, at, z: at.v_n_mps[:, 0].norm(dim=1, keepdim=True) - z,
    "height": lambda _, at, z: -at.p_n_m[:, 0, 2:] - z,
    "position": lambda _, at, z: at.p_n_m[:, 0] - z,
    "displacement": _displacement,
}
