"""The gravity network as a factor: what its estimator prepares is in the graph, the rest stated."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from fgnav.neural.manifest import FORMAT, Covariance, Manifest, Output, Statistic
from fgnav_models.gravity_features import SAMPLES, SPAN_S, STEP_S
from fgnav_models.training.ambiguity.released import Release
from fgnav_models.training.factor_release import factor_input, release_factor
from fgnav_models.training.gravity.nets import GravityNet
from fgnav_sim.data_sets.gravity import GravityEpochs

_FIX_S = 0.1
_VELOCITIES = round(SPAN_S / _FIX_S) + 1  # the oldest and the newest are differenced
_GRAVITY_MPS2 = 9.81  # told to a hundredth, for the domain alone
_EXAMPLES = 64
FIGURES = {
    "specific_force_mps2": "m/s2",
    "specific_force_change_mps2": "m/s2",
    "specific_force_along_body_mps2": "m/s2",
    "horizontal_speed_mps": "m/s",
    "upward_speed_mps": "m/s",
    "acceleration_mps2": "m/s2",
    "accelerometer_less_velocities_mps2": "m/s2",
}


class GravityFactor(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """A network that sees velocities as they come: direction, Cholesky factor, domain's figures.

    Along the direction, where the covariance has nothing and nothing counts, it is given the mean
    of the other two variances.
    """

    def __init__(self, net: GravityNet) -> None:
        super().__init__()
        self.net = net

    def forward(self, f_b_mps2: torch.Tensor, v_n_mps: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return g_b, (n, 3), L by rows, (n, 6), and figures, (n, 1) each."""
        before, after = v_n_mps[:, 0], v_n_mps[:, -1]
        motion = _course_motion((before + after) / 2, (after - before) / SPAN_S)
        g_b, covariance = self.net(f_b_mps2, motion)
        mean = (covariance[:, 0, 0] + covariance[:, 1, 1] + covariance[:, 2, 2]) / 2
        P = covariance + mean[:, None, None] * g_b[:, :, None] * g_b[:, None, :]
        size = f_b_mps2.norm(dim=2)
        told = (motion[:, 2:] - motion.new_tensor([0.0, 0.0, _GRAVITY_MPS2])).norm(dim=1)
        figures = (
            size[:, -1],
            size.amax(dim=1) - size.amin(dim=1),
            f_b_mps2[:, -1, 0],
            motion[:, 0],
            motion[:, 1],
            motion[:, 2:].norm(dim=1),
            size[:, -1] - told,
        )
        return g_b, _cholesky(P), *(figure[:, None] for figure in figures)


def release_gravity(
    net: GravityNet,
    epochs: GravityEpochs,
    words: Release,
    domain: Mapping[str, Any],
    metrics: Mapping[str, float],
    folder: Path,
) -> None:
    """Write the factor of a network, as ``training.factor_release`` does.

    Parameters
    ----------
    net : GravityNet
    epochs : GravityEpochs
        What both run-times are compared on.
    words : Release
    domain : mapping
        Ranges of ``FIGURES``, and ``half_life_s``.
    metrics : mapping of str to float
        For the card.
    folder : Path
    """
    half_mps = epochs.a_n_mps2 * SPAN_S / 2
    v_n_mps = np.stack([epochs.v_n_mps - half_mps, epochs.v_n_mps, epochs.v_n_mps + half_mps], 1)
    manifest = Manifest(
        format=FORMAT,
        name=words.name,
        purpose=words.purpose,
        onnx=f"{words.name}.onnx",
        sha256="0" * 64,
        licence="BSD-3-Clause",
        inputs=(
            factor_input("f_b_mps2", "accelerometer", 1 / STEP_S, SAMPLES),
            factor_input("v_n_mps", "velocity", 1 / _FIX_S, _VELOCITIES),
        ),
        output=Output(
            name="g_b",
            measures="direction",
            manifold="S2",
            unit="rad",
            frame="b",
            covariance=Covariance(form="cholesky", name="cholesky"),
            half_life_s=float(domain["half_life_s"]),
        ),
        domain=tuple(
            Statistic(name=name, unit=unit, range=tuple(domain[name]))
            for name, unit in FIGURES.items()
        ),
    )
    examples = [epochs.f_b_mps2[:_EXAMPLES], v_n_mps[:_EXAMPLES]]
    release_factor(GravityFactor(net), examples, manifest, words, metrics, folder)


def _course_motion(v_n_mps: torch.Tensor, a_n_mps2: torch.Tensor) -> torch.Tensor:
    """Return ``fgnav_models.gravity_features.course_motion``, (n, 5)."""
    horizontal = v_n_mps[:, :2].norm(dim=1)
    moving = horizontal > 0
    scale = torch.where(moving, horizontal, torch.ones_like(horizontal))
    north = torch.where(moving, v_n_mps[:, 0] / scale, torch.ones_like(scale))
    east = v_n_mps[:, 1] / scale
    along = north * a_n_mps2[:, 0] + east * a_n_mps2[:, 1]
    right = north * a_n_mps2[:, 1] - east * a_n_mps2[:, 0]
    return torch.stack([horizontal, -v_n_mps[:, 2], along, right, a_n_mps2[:, 2]], dim=1)


def _cholesky(P: torch.Tensor) -> torch.Tensor:
    """Return lower triangles by rows, (n, 6), in operators that every run-time has."""
    a = P[:, 0, 0].sqrt()
    b, d = P[:, 1, 0] / a, P[:, 2, 0] / a
    c = (P[:, 1, 1] - b * b).sqrt()
    e = (P[:, 2, 1] - d * b) / c
    return torch.stack([a, b, c, d, e, (P[:, 2, 2] - d * d - e * e).sqrt()], dim=1)
