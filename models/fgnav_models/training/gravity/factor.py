"""A gravity network as a factor: what prepares its inputs is in the graph, the rest stated."""

from collections.abc import Mapping
from pathlib import Path

import torch
from torch import nn

from fgnav.neural.manifest import Covariance, Origin, Output, Statistic
from fgnav_models.training.contract import Release, factor_input, manifest_of
from fgnav_models.training.gravity.features import RATE_HZ, SAMPLES, VELOCITIES, VELOCITY_HZ, Motion
from fgnav_models.training.gravity.nets import GravityNet
from fgnav_models.training.release import release
from fgnav_sim.data_sets.gravity import GravityEpochs

SIGMA = "stated_sigma_rad"
UNITS = {
    SIGMA: "rad",
    "input_deviation": "1",
    "specific_force_mps2": "m/s2",
    "specific_force_change_mps2": "m/s2",
    "specific_force_step_mps2": "m/s2",
    "horizontal_speed_mps": "m/s",
    "upward_speed_mps": "m/s",
    "acceleration_mps2": "m/s2",
    "accelerometer_less_velocities_mps2": "m/s2",
}
CALM = (*list(UNITS)[:6], "acceleration_mps2")  # figures that may be as low as 0


def figures_of_windows(
    net: GravityNet, f_b_mps2: torch.Tensor, motion: Motion | None, covariance: torch.Tensor
) -> dict[str, torch.Tensor]:
    """Return, by name, the figures of each row that say whether it is to be believed, (n,).

    ``stated_sigma_rad`` is of each axis across the answer; ``input_deviation`` the root mean square
    of all inputs in standard deviations of training; ``specific_force_mps2`` the largest of the
    window; ``specific_force_step_mps2`` the root mean square from one sample to the next, which
    vibration raises; ``accelerometer_less_velocities_mps2`` the mean size of the specific force
    less that which the mean acceleration asks for.
    """
    size = f_b_mps2.norm(dim=2)
    variance = covariance[:, 0, 0] + covariance[:, 1, 1] + covariance[:, 2, 2]
    figures = [
        (variance / 2).sqrt(),
        net.scaled(f_b_mps2, motion).square().mean(dim=1).sqrt(),
        size.amax(dim=1),
        size.amax(dim=1) - size.amin(dim=1),
        (f_b_mps2[:, 1:] - f_b_mps2[:, :-1]).square().sum(dim=2).mean(dim=1).sqrt(),
    ]
    if motion is not None:
        figures += [
            motion.velocity[:, 0],
            -motion.velocity[:, 2],
            motion.mean_acceleration.norm(dim=1),
            size.mean(dim=1) - motion.mean_force().norm(dim=1),
        ]
    return dict(zip(UNITS, figures, strict=False))


class GravityFactor(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """A network with what its manifest needs: direction, Cholesky factor, domain's figures.

    Along the direction, where the covariance has nothing and nothing counts, it is given the mean
    of the other two variances. All is in double precision: where forces are nearly along the
    velocity, rounding alone would turn the physical pair.
    """

    def __init__(self, net: GravityNet) -> None:
        super().__init__()
        self.net = net

    def forward(
        self, f_b_mps2: torch.Tensor, v_n_mps: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, ...]:
        """Return g_b, (n, 3), L by rows, (n, 6), and figures, (n, 1) each."""
        f_b_mps2 = f_b_mps2.double()
        v_n_mps = None if v_n_mps is None else v_n_mps.double()
        g_b, covariance = self.net(f_b_mps2, v_n_mps)
        figures = figures_of_windows(self.net, f_b_mps2, self.net.motion(v_n_mps), covariance)
        mean = (covariance[:, 0, 0] + covariance[:, 1, 1] + covariance[:, 2, 2]) / 2
        P = covariance + mean[:, None, None] * g_b[:, :, None] * g_b[:, None, :]
        outputs = (g_b, _cholesky(P), *(figure[:, None] for figure in figures.values()))
        return tuple(output.float() for output in outputs)


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
    n_inputs = 2 if net.aided else 1
    inputs = (
        factor_input("f_b_mps2", "accelerometer", RATE_HZ, SAMPLES),
        factor_input("v_n_mps", "velocity", VELOCITY_HZ, VELOCITIES),
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
    manifest = manifest_of(words, inputs[:n_inputs], output, domain, origin)
    examples = [epochs.f_b_mps2, epochs.v_n_mps][:n_inputs]
    release(GravityFactor(net), examples, manifest, words, metrics, folder, half=True)


def _cholesky(P: torch.Tensor) -> torch.Tensor:
    """Return lower triangles by rows, (n, 6), in operators that every run-time has."""
    a = P[:, 0, 0].sqrt()
    b, d = P[:, 1, 0] / a, P[:, 2, 0] / a
    c = (P[:, 1, 1] - b * b).sqrt()
    e = (P[:, 2, 1] - d * b) / c
    return torch.stack([a, b, c, d, e, (P[:, 2, 2] - d * d - e * e).sqrt()], dim=1)
