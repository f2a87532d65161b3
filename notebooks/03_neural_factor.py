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
# # A network of one's own as a factor
#
# Nine photodiodes on a vehicle see the sun and the sky. No model of the library knows photodiodes,
# so a network learns the heading from their currents, and how well it knows it. Its file and a
# manifest make a factor; its covariance is held against flights that it has never seen, and then it
# tells a single-antenna flight the heading that nothing else does.

# %%
import io
import warnings
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from tempfile import mkdtemp

import msgspec
import numpy as np
import torch
from fgnav.neural.calibration import calibration
from torch import nn

import fgnav
from fgnav.geometry import rotations
from fgnav.integers.resolvers.truth import attitude_at
from fgnav.neural import Manifest, NeuralFactor, Record, save_manifest
from fgnav.neural.manifest import Covariance, Input, Output
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

torch.manual_seed(1)
torch.set_num_threads(1)
folder = Path(mkdtemp())

# %% [markdown]
# ## What it sees
# A current is the cosine of the sun's angle, and 0.3 of the share of the sky in view, with white
# noise. A window is five samples at 20 Hz; the heading asked for is that of its end.

# %%
RATE_HZ, WINDOW, NOISE = 20.0, 5, 0.02
SUN_N = np.array([np.cos(0.6) * np.cos(0.7), np.cos(0.6) * np.sin(0.7), -np.sin(0.6)])
ring = [(a, e) for e in (0.0, 0.8) for a in np.arange(4) * np.pi / 2 + e]
AXES_B = [[np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), -np.sin(e)] for a, e in ring]
AXES_B = np.array([[0.0, 0.0, -1.0], *AXES_B])


def currents(R_nb, rng):
    axes_n = np.einsum("nij,cj->nci", R_nb, AXES_B)
    clean = (axes_n @ SUN_N).clip(0) + 0.3 * (1 - axes_n[:, :, 2])
    return clean + NOISE * rng.standard_normal(clean.shape)


def windows(n, rng):
    t_s = np.arange(1 - WINDOW, 1) / RATE_HZ
    angle = rng.uniform([-0.45, -0.45, -np.pi], [0.45, 0.45, np.pi], (n, 3))
    rate = rng.uniform(-0.5, 0.5, (n, 3))
    euler = (angle[:, None] + rate[:, None] * t_s[:, None]).reshape(-1, 3)
    seen = currents(rotations.from_euler(*euler.T), rng).reshape(n, WINDOW, -1)
    return seen, angle[:, 2]


seen, heading = windows(40_000, np.random.default_rng(1))
mean, scale = seen.mean(axis=(0, 1)), seen.std(axis=(0, 1))


# %% [markdown]
# ## The network
# Twenty lines: products of sums of currents, one layer, cosine and sine of the heading and the
# logarithm of its 1-sigma; trained by the negative log-likelihood.


# %%
class Heading(nn.Module):
    def __init__(self):
        super().__init__()
        self.a, self.b = (nn.Linear(WINDOW * len(AXES_B), 8) for _ in range(2))
        self.linear = nn.Linear(64, 2)
        self.rest = nn.Sequential(nn.Linear(64, 64), nn.ReLU(), nn.Linear(64, 3))

    def forward(self, x):
        x = x.flatten(1)
        products = (self.a(x)[:, :, None] * self.b(x)[:, None, :]).flatten(1)
        out = self.rest(products)
        direction = nn.functional.normalize(out[:, :2] + self.linear(products), dim=1)
        return direction, out[:, 2:] - 2.0


net, steps = Heading(), 800
x, y = (torch.tensor(part, dtype=torch.float32) for part in ((seen - mean) / scale, heading))
optimiser = torch.optim.Adam(net.parameters(), 1e-2)
schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
for _ in range(steps):
    which = torch.randint(len(x), (512,))
    direction, log_sigma = net(x[which])
    error = torch.atan2(direction[:, 1], direction[:, 0]) - y[which]
    error = torch.atan2(torch.sin(error), torch.cos(error))
    loss = (0.5 * (error / log_sigma[:, 0].exp()) ** 2 + log_sigma[:, 0]).mean()
    optimiser.zero_grad()
    loss.backward()
    optimiser.step()
    schedule.step()

# %% [markdown]
# ## ONNX and manifest
# The manifest says what goes in and what comes out, with units, frames, rate and the ranges that
# training has seen. The half-life of its errors is not known yet: it is measured below.

# %%
file = io.BytesIO()
with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    torch.onnx.export(
        net.eval(),
        (torch.zeros(1, WINDOW, len(AXES_B)),),
        file,
        input_names=["x"],
        output_names=["direction", "log_sigma"],
        dynamic_axes={name: {0: "n"} for name in ("x", "direction", "log_sigma")},
        opset_version=17,
        dynamo=False,
    )
(folder / "sun.onnx").write_bytes(file.getvalue())

limits = np.stack([seen.min(axis=(0, 1)), seen.max(axis=(0, 1))], axis=1)
manifest = Manifest(
    format="fgnav-factor/1",
    name="sun compass",
    purpose="Heading from nine photodiodes.",
    onnx="sun.onnx",
    sha256=sha256(file.getvalue()).hexdigest(),
    licence="BSD-3-Clause",
    inputs=(
        Input(
            name="x",
            sensor="photodiodes",
            unit="A",
            frame="b",
            rate_hz=RATE_HZ,
            window=WINDOW,
            mean=tuple(mean.tolist()),
            scale=tuple(scale.tolist()),
            range=tuple(map(tuple, limits.tolist())),
        ),
    ),
    output=Output(
        name="direction",
        measures="heading",
        manifold="S1",
        unit="rad",
        frame="n",
        covariance=Covariance(form="log_sigma", name="log_sigma"),
        half_life_s=0.0,
    ),
)
save_manifest(manifest, folder / "sun.json")

# %% [markdown]
# ## Calibration
# Flights of one antenna, straight and swaying by ten degrees, none of them seen in training. Beside
# the network's own sigma stands the constant one that the likelihood fits to these very flights. A
# network that is no better has nothing to say of its errors there, and its table says so: these
# flights sway less than those it was trained on, and all windows are about as good.

# %%
scenario = load_scenario("surroundings")
scenario = msgspec.structs.replace(scenario, duration_s=20.0, barometer=None, magnetometer=None)


def flown(seed):
    flight = simulate(scenario, np.random.default_rng(seed))
    t_s = np.arange(flight.truth.t_s[0], flight.truth.t_s[-1], 1 / RATE_HZ)
    R_nb, covered = attitude_at(flight.truth, t_s)
    seen = currents(R_nb[covered], np.random.default_rng(100 + seed))
    return flight, Record(t_s=t_s[covered], values=seen, unit="A", frame="b")


flights = [flown(seed) for seed in range(2, 8)]
table = calibration(folder / "sun.json", [(f, {"photodiodes": r}) for f, r in flights])
print(table)

# %% [markdown]
# How long its errors last goes into the manifest: what lasts as long as a flight is a constant of
# the graph; of the rest, outputs closer than two half-lives are left out, and the others'
# covariance is that much larger.

# %%
output = msgspec.structs.replace(
    manifest.output, half_life_s=table.half_life_s, lasting=table.lasting
)
save_manifest(msgspec.structs.replace(manifest, output=output), folder / "sun.json")

# %% [markdown]
# ## Smoothing
# Without it the heading of this flight is open; with it, known.

# %%
flight, record = flown(1)
factor = NeuralFactor(folder / "sun.json", records={"photodiodes": record})
without = fgnav.Smoother(noise="nominal")(flight)
estimate = replace(fgnav.Smoother(noise="nominal"), factors=(factor,))(flight)
for name, one in (("without", without), ("with", estimate)):
    R_nb, _ = attitude_at(flight.truth, one.t_s)
    error = rotations.log(rotations.transpose(one.R_nb) @ R_nb)
    nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(one.attitude_covariance_rad2), error)
    yaw_deg = np.degrees(rotations.wrap(rotations.to_euler(R_nb) - rotations.to_euler(one.R_nb)))
    rmse_deg = np.sqrt((yaw_deg[:, 2] ** 2).mean())
    print(
        f"{name:8} yaw {rmse_deg:6.2f} deg, stated {one.sigma_deg[:, 2].mean():6.2f} deg;", end=""
    )
    print(f" NEES of the attitude {nees.mean():.1f} of 3")

# %%
for test in estimate.consistency:
    print(f"{test.what:20} {test.count:5} answers, NIS {test.nis:.2f}")
for lost in estimate.unused:
    print(f"{lost.what}: {lost.count}, {lost.reason}")
assert estimate.sigma_deg[:, 2].max() < 3.0
