"""Small flights with truth, and small modules that say something of them."""

import msgspec
import numpy as np
import torch

from fgnav.neural.records import Record
from fgnav_models.learn import input_of
from fgnav_sim.scenario import FixesTable
from tests.turns import turning

RATE_HZ, WINDOW = 10.0, 3


def flown(seed, duration_s=12.0, rate_hz=5.0, **imu):
    """Return a turn, with fixes of a rate."""
    return turning(np.random.default_rng(seed), duration_s, FixesTable(rate_hz=rate_hz), **imu)


def wind(flight, seed):
    """Return a record of airspeeds in body axes, with noise."""
    truth, rng = flight.truth, np.random.default_rng(seed)
    t_s = np.arange(truth.t_s[0], truth.t_s[-1], 1 / RATE_HZ)
    rows = np.searchsorted(truth.t_s, t_s).clip(0, len(truth.t_s) - 1)
    v_b = np.einsum("nji,nj->ni", truth.R_nb[rows], truth.v_n_mps[rows])
    noisy = v_b + 0.5 * rng.standard_normal(v_b.shape)
    return Record(t_s=t_s, values=noisy, unit="m/s", frame="b")


class Sensor(torch.nn.Module):
    """The last sample, a little off, and an uncertainty that changes with it."""

    def __init__(self, channels=3, uncertain=3, seed=1, *, unit=False):
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


def plain_input():
    """Return windows as they are: mean 0, scale 1, any range."""
    seen = input_of("wind", np.ones((1, WINDOW, 3)), RATE_HZ, unit="m/s", frame="b")
    return msgspec.structs.replace(
        seen, mean=(0.0,) * 3, scale=(1.0,) * 3, range=((-99.0, 99.0),) * 3
    )
