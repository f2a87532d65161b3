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


class Airspeed(torch.nn.Module):
    """The window's mean, a little off, and what is asked for of how sure it is."""

    def __init__(self, uncertain=3, seed=1):
        super().__init__()
        torch.manual_seed(seed)
        self.off = torch.nn.Linear(3, 3)
        self.uncertain = torch.nn.Linear(3, uncertain)
        self.off.weight.data *= 0.05
        self.uncertain.weight.data *= 0.1
        self.double()

    def forward(self, x):
        mean = x.mean(dim=1)
        uncertain = self.uncertain(mean) - 0.5
        if uncertain.shape[1] == 6:  # the diagonal of a Cholesky factor
            diagonal = torch.tensor([True, False, True, False, False, True])
            uncertain = torch.where(diagonal, uncertain.exp(), 0.3 * uncertain)
        return mean + self.off(mean), uncertain


def plain_input():
    """Return windows as they are: mean 0, scale 1, any range."""
    seen = input_of("wind", np.ones((1, WINDOW, 3)), RATE_HZ, unit="m/s", frame="b")
    return msgspec.structs.replace(
        seen, mean=(0.0,) * 3, scale=(1.0,) * 3, range=((-99.0, 99.0),) * 3
    )
