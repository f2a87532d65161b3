"""A convolution over a window of an inertial unit, to body velocity and how sure of it."""

import torch
from torch import nn

_SPEED_MPS = 10.0  # unit of the answer inside: of the order of what vehicles do
_LOG_SIGMA = (-4.0, 4.0)  # of m/s
_QUIET = 1e-8  # below the noise of any unit, squared
FIGURES = {
    "specific_force_mps2": "m/s2",
    "shaking_mps2": "m/s2",
    "rate_radps": "rad/s",
}


class VelocityNet(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """Velocity in body axes, m/s, and the logarithms of its 1-sigmas.

    Beside what convolutions find, the dense layers see the window's mean and the logarithm of what
    changes from sample to sample: shaking is faster than the convolutions' steps.

    Parameters
    ----------
    window : int
        Samples.
    gyroscope : bool
        Whether it sees rates, too.
    width, seed : int
        Channels of the convolutions; of the first weights.
    """

    def __init__(self, *, window: int, gyroscope: bool, width: int, seed: int) -> None:
        super().__init__()
        torch.manual_seed(seed)
        self.gyroscope = gyroscope
        channels = 6 if gyroscope else 3
        self.layers = nn.Sequential(
            nn.Conv1d(channels, width, 8, stride=4),
            nn.SiLU(),
            nn.Conv1d(width, width, 5, stride=2),
            nn.SiLU(),
            nn.Conv1d(width, width, 5, stride=2),
            nn.SiLU(),
            nn.Flatten(),
        )
        with torch.no_grad():
            flat = self.layers(torch.zeros(1, channels, window)).shape[1]
        self.dense = nn.Sequential(
            nn.Linear(flat + 2 * channels, 2 * width), nn.SiLU(), nn.Linear(2 * width, 6)
        )
        self.register_buffer("log_scale", torch.zeros(3))

    def forward(self, *sensed: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return velocities, (n, 3), and log sigmas, (n, 3), of scaled windows, (n, window, 3)."""
        x = torch.cat(sensed[: 2 if self.gyroscope else 1], dim=2)
        rough = (x[:, 1:] - x[:, :-1]).square().mean(dim=1).clamp_min(_QUIET).log() / 4
        features = torch.cat([self.layers(x.transpose(1, 2)), x.mean(dim=1), rough], dim=1)
        answer = self.dense(features)
        return _SPEED_MPS * answer[:, :3], answer[:, 3:].clamp(*_LOG_SIGMA) + self.log_scale


class VelocityFactor(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """A network with the figures of its domain: what ``--factors`` runs.

    Parameters
    ----------
    scale : tuple of float
        Of accelerations and rates, by which windows are divided.
    """

    def __init__(self, net: VelocityNet, scale: tuple[float, float]) -> None:
        super().__init__()
        self.net, self.scale = net, scale

    def forward(self, *sensed: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return velocity, (n, 3), log sigma, (n, 3), and figures, (n, 1) each."""
        force = self.scale[0] * sensed[0]
        changes = force[:, 1:] - force[:, :-1]
        figures = [
            force.mean(dim=1).norm(dim=1),
            changes.square().mean(dim=(1, 2)).sqrt(),
            *((self.scale[1] * rate.mean(dim=1)).norm(dim=1) for rate in sensed[1:2]),
        ]
        return *self.net(*sensed), *(figure[:, None] for figure in figures)


def negative_log_likelihood(module: nn.Module, batch: tuple[torch.Tensor, ...]) -> torch.Tensor:
    """Return the mean over windows and axes, but for a constant, of (windows ..., velocities)."""
    *sensed, v_b_mps = batch
    answer, log_sigma = module(*sensed)
    squared = ((answer - v_b_mps) / log_sigma.exp()).square()
    return (squared / 2 + log_sigma).mean()
