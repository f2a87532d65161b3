# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#       format_version: '1.3'
#       jupytext_version: 1.19.6
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # From an idea to a judged factor
# Nine photodiodes see sun and sky; a network learns the heading from five samples of them. Six
# flights, which have no heading otherwise, show how long its errors last; six others judge it.

# %%
from tempfile import mkdtemp

import msgspec
import numpy as np
import torch

import fgnav
from fgnav.evaluation.networks import calibration, referee
from fgnav.geometry import rotations
from fgnav.neural import Record
from fgnav_models import learn
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

torch.manual_seed(1)
RATE_HZ, WINDOW, SUN_N = 10.0, 5, np.array([0.63, 0.53, -0.56])
AXES_B = rotations.exp(np.random.default_rng(2).uniform(-np.pi, np.pi, (9, 3)))[:, 2]


def currents(R_nb, rng):
    axes_n = np.einsum("nij,cj->nci", R_nb, AXES_B)
    clean = (axes_n @ SUN_N).clip(0) + 0.3 * (1 - axes_n[:, :, 2])
    return clean + 0.01 * rng.standard_normal(clean.shape)


class Heading(torch.nn.Sequential):
    def forward(self, x):  # any multiple of cosine and sine, and the logarithm of the 1-sigma
        return super().forward(x).split([2, 1], dim=1)


rng, n = np.random.default_rng(1), 40_000
end = rng.uniform([-0.45, -0.45, -np.pi], [0.45, 0.45, np.pi], (n, 1, 3))
euler = end + rng.uniform(-0.3, 0.3, (n, 1, 3)) * np.arange(1 - WINDOW, 1)[:, None] / RATE_HZ
seen = currents(rotations.from_euler(*euler.reshape(-1, 3).T), rng).reshape(n, WINDOW, -1)
diodes = learn.input_of("photodiodes", seen, RATE_HZ, unit="A", frame="b")
x, y = (torch.tensor(a).float() for a in ((seen - diodes.mean) / diodes.scale, end[:, 0, 2:]))
hidden = [one for k in (45, 96) for one in (torch.nn.Linear(k, 96), torch.nn.SiLU())]
net = Heading(torch.nn.Flatten(), *hidden, torch.nn.Linear(96, 3))
optimiser = torch.optim.Adam(net.parameters(), 5e-3)
for i in torch.randint(n, (4000, 512)):
    direction, log_sigma = net(x[i])
    error = torch.atan2(direction[:, 1:], direction[:, :1]) - y[i]
    error = torch.atan2(error.sin(), error.cos()) / log_sigma.exp()
    optimiser.zero_grad()
    (error**2 / 2 + log_sigma).mean().backward()
    optimiser.step()

flown = msgspec.structs.replace(load_scenario("surroundings"), duration_s=20.0, magnetometer=None)
flights = [simulate(flown, one) for one in rng.spawn(12)]
values = [currents(flight.truth.R_nb, rng) for flight in flights]
records = [
    {"photodiodes": Record(t_s=flight.truth.t_s, values=seen, unit="A", frame="b")}
    for flight, seen in zip(flights, values, strict=True)
]
first = (learn.factor(net, "heading", [diodes], records=one) for one in records[:6])
found = calibration(tuple(first), flights[:6])
errors = {"half_life_s": found.half_life_s, "lasting": found.lasting}
sun = learn.factor(net, "heading", [diodes], name="sun", **errors)
print(learn.export(sun, mkdtemp()))
print(referee([sun], flights[6:], fgnav.Batch(noise="nominal"), records=records[6:]))
