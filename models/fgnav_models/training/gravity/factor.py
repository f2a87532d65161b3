"""A gravity network as a factor: what prepares its inputs is in the graph, the rest stated."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from torch import nn

from fgnav.neural.manifest import Covariance, Origin, Output, Statistic
from fgnav_models.training.contract import Release, factor_input, manifest_of
from fgnav_models.training.gravity.features import SAMPLES, SPAN_S, STEP_S, course_motion
from fgnav_models.training.gravity.nets import GravityNet
from fgnav_models.training.release import release
from fgnav_sim.data_sets.gravity import GravityEpochs

_FIX_S = 0.1
_VELOCITIES = round(SPAN_S / _FIX_S) + 1  # the oldest and the newest are differenced
_GRAVITY_MPS2 = 9.81  # told to a hundredth, for the domain alone
CALM = ("specific_force_change_mps2", "acceleration_mps2")  # figures that may be as low as 0
UNITS = {
    "specific_force_mps2": "m/s2",
    "specific_force_change_mps2": "m/s2",
    "specific_force_along_body_mps2": "m/s2",
    "horizontal_speed_mps": "m/s",
    "upward_speed_mps": "m/s",
    "acceleration_mps2": "m/s2",
    "accelerometer_less_velocities_mps2": "m/s2",
}


def figures_of_windows(
    f_b_mps2: torch.Tensor, motion: torch.Tensor | None
) -> dict[str, torch.Tensor]:
    """Return, by name, the figures of each row that tell whether training has seen its like, (n,).

    Parameters
    ----------
    f_b_mps2 : tensor, shape (n, SAMPLES, 3)
    motion : tensor, shape (n, 5), or None
        ``course_motion``, for networks that see it.
    """
    size = f_b_mps2.norm(dim=2)
    figures = [size[:, -1], size.amax(dim=1) - size.amin(dim=1), f_b_mps2[:, -1, 0]]
    if motion is not None:
        expected = (motion[:, 2:] - motion.new_tensor([0.0, 0.0, _GRAVITY_MPS2])).norm(dim=1)
        figures += [
            motion[:, 0],
            motion[:, 1],
            motion[:, 2:].norm(dim=1),
            size[:, -1] - expected,
        ]
    return dict(zip(UNITS, figures, strict=False))


class GravityFactor(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """A network that sees velocities as they come: direction, Cholesky factor, domain's figures.

    Along the direction, where the covariance has nothing and nothing counts, it is given the mean
    of the other two variances.
    """

    def __init__(self, net: GravityNet) -> None:
        super().__init__()
        self.net = net

    def forward(
        self, f_b_mps2: torch.Tensor, v_n_mps: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, ...]:
        """Return g_b, (n, 3), L by rows, (n, 6), and figures, (n, 1) each."""
        motion = None
        if v_n_mps is not None:
            before, after = v_n_mps[:, 0], v_n_mps[:, -1]
            motion = course_motion((before + after) / 2, (after - before) / SPAN_S)
        g_b, covariance = self.net(f_b_mps2, motion)
        mean = (covariance[:, 0, 0] + covariance[:, 1, 1] + covariance[:, 2, 2]) / 2
        P = covariance + mean[:, None, None] * g_b[:, :, None] * g_b[:, None, :]
        figures = figures_of_windows(f_b_mps2, motion).values()
        return g_b, _cholesky(P), *(figure[:, None] for figure in figures)


def release_gravity(
    net: GravityNet,
    epochs: GravityEpochs,
    words: Release,
    errors: tuple[float, float],
    domain: tuple[Statistic, ...],
    metrics: Mapping[str, float],
    folder: Path,
    origin: Origin | None = None,
) -> None:
    """Write the factor of a network, as ``training.release`` does.

    Parameters
    ----------
    epochs : GravityEpochs
        What both run-times are compared on.
    errors : (float, float)
        Their half-life, s, and the share of their variance that lasts.
    metrics : mapping of str to float
        For the card.
    """
    half_mps = epochs.a_n_mps2 * SPAN_S / 2
    v_n_mps = np.stack([epochs.v_n_mps - half_mps, epochs.v_n_mps, epochs.v_n_mps + half_mps], 1)
    seen = 2 if net.aided else 1
    inputs = (
        factor_input("f_b_mps2", "accelerometer", 1 / STEP_S, SAMPLES),
        factor_input("v_n_mps", "velocity", 1 / _FIX_S, _VELOCITIES),
    )
    output = Output(
        name="g_b",
        measures="direction",
        manifold="S2",
        unit="rad",
        frame="b",
        covariance=Covariance(form="cholesky", name="cholesky"),
        half_life_s=round(errors[0], 2),
        lasting=round(errors[1], 2),
    )
    manifest = manifest_of(words, inputs[:seen], output, domain, origin)
    examples = [epochs.f_b_mps2, v_n_mps][:seen]
    release(GravityFactor(net), examples, manifest, words, metrics, folder)


def _cholesky(P: torch.Tensor) -> torch.Tensor:
    """Return lower triangles by rows, (n, 6), in operators that every run-time has."""
    a = P[:, 0, 0].sqrt()
    b, d = P[:, 1, 0] / a, P[:, 2, 0] / a
    c = (P[:, 1, 1] - b * b).sqrt()
    e = (P[:, 2, 1] - d * b) / c
    return torch.stack([a, b, c, d, e, (P[:, 2, 2] - d * d - e * e).sqrt()], dim=1)
