"""A heading network made here: nine photodiodes on a body under the sun and a bright sky.

No model of the library knows photodiodes. The network learns the heading from their currents, and
how well it knows it: where the sun stands high over a banked body, badly.
"""

from dataclasses import dataclass
from functools import cache
from hashlib import sha256

import numpy as np

from fgnav.geometry import rotations
from fgnav.neural.manifest import Covariance, Input, Manifest, Output, save_manifest
from fgnav.neural.records import Record

RATE_HZ, WINDOW, NOISE = 20.0, 5, 0.02
SUN_N = np.array([np.cos(0.6) * np.cos(0.7), np.cos(0.6) * np.sin(0.7), -np.sin(0.6)])
NORMALS_B = np.array(
    [[0.0, 0.0, -1.0]]
    + [
        [np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), -np.sin(e)]
        for e in (0.0, 0.8)
        for a in np.arange(4) * np.pi / 2 + e
    ]
)
NAME, SENSOR, CHANNELS = "sun compass", "photodiodes", len(NORMALS_B)


def currents(R_nb, rng):
    """Return what diodes measure at attitudes, (n, 9): the sun by its cosine, and the sky."""
    normals_n = np.einsum("nij,cj->nci", R_nb, NORMALS_B)
    sun, sky = (normals_n @ SUN_N).clip(0), 0.3 * (1 - normals_n[:, :, 2])
    return sun + sky + NOISE * rng.standard_normal(sun.shape)


def swaying(rng, n):
    """Return attitudes of n windows, (n, WINDOW, 3, 3): any heading, banked up to 25 degrees."""
    t_s = np.arange(1 - WINDOW, 1) / RATE_HZ
    angle = rng.uniform([-0.45, -0.45, -np.pi], [0.45, 0.45, np.pi], (n, 3))
    rate = rng.uniform(-0.5, 0.5, (n, 3))
    euler = (angle[:, None] + rate[:, None] * t_s[:, None]).reshape(-1, 3)
    return rotations.from_euler(*euler.T).reshape(n, WINDOW, 3, 3)


def examples(n, seed):
    """Return windows of currents, (n, WINDOW, 9), and headings at their ends, (n,)."""
    rng = np.random.default_rng(seed)
    R_nb = swaying(rng, n)
    seen = currents(R_nb.reshape(-1, 3, 3), rng).reshape(n, WINDOW, CHANNELS)
    return seen, rotations.to_euler(R_nb[:, -1])[:, 2]


@dataclass(frozen=True)
class Trained:
    """A network's file, and what it was trained on."""

    net: object  # torch's module
    onnx: bytes
    mean: np.ndarray
    scale: np.ndarray
    range: np.ndarray


@cache
def trained(seed=1, steps=800):
    """Return a network: cosine and sine of the heading, and the logarithm of its 1-sigma."""
    import torch
    from torch import nn

    torch.manual_seed(seed)
    torch.set_num_threads(1)
    seen, heading = examples(40_000, seed)
    mean, scale = seen.mean(axis=(0, 1)), seen.std(axis=(0, 1))
    x = torch.tensor((seen - mean) / scale, dtype=torch.float32)
    y = torch.tensor(heading, dtype=torch.float32)

    class Heading(nn.Module):
        """Products of sums of currents, as sun and up make them, then one layer of 64."""

        def __init__(self):
            super().__init__()
            self.a, self.b = (nn.Linear(WINDOW * CHANNELS, 8) for _ in range(2))
            self.linear = nn.Linear(64, 2)
            self.rest = nn.Sequential(nn.Linear(64, 64), nn.ReLU(), nn.Linear(64, 3))

        def forward(self, x):
            x = x.flatten(1)
            products = (self.a(x)[:, :, None] * self.b(x)[:, None, :]).flatten(1)
            out = self.rest(products)
            direction = nn.functional.normalize(out[:, :2] + self.linear(products), dim=1)
            return direction, out[:, 2:] - 2.0

    net = Heading()
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
    limits = np.stack([seen.min(axis=(0, 1)), seen.max(axis=(0, 1))], axis=1)
    onnx = exported(net, (WINDOW, CHANNELS), ("direction", "log_sigma"))
    return Trained(net, onnx, mean, scale, limits)


def exported(net, shape, outputs):
    """Return a torch module as ONNX of standard operators."""
    import io
    import warnings

    import torch

    file = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the exporter's own
        torch.onnx.export(
            net.eval(),
            (torch.zeros(1, *shape),),
            file,
            input_names=["x"],
            output_names=list(outputs),
            dynamic_axes={name: {0: "n"} for name in ("x", *outputs)},
            opset_version=17,
            dynamo=False,
        )
    return file.getvalue()


def written(folder, half_life_s=0.07):
    """Write the network and its manifest; return the manifest's path."""
    net = trained()
    (folder / "sun.onnx").write_bytes(net.onnx)
    manifest = Manifest(
        format="fgnav-factor/1",
        name=NAME,
        purpose="Heading from nine photodiodes.",
        onnx="sun.onnx",
        sha256=sha256(net.onnx).hexdigest(),
        licence="BSD-3-Clause",
        inputs=(
            Input(
                name="x",
                sensor=SENSOR,
                unit="A",
                frame="b",
                rate_hz=RATE_HZ,
                window=WINDOW,
                mean=tuple(net.mean.tolist()),
                scale=tuple(net.scale.tolist()),
                range=tuple(map(tuple, net.range.tolist())),
            ),
        ),
        output=Output(
            name="direction",
            measures="heading",
            manifold="S1",
            unit="rad",
            frame="n",
            covariance=Covariance(form="log_sigma", name="log_sigma"),
            half_life_s=half_life_s,
        ),
    )
    path = folder / "sun.json"
    save_manifest(manifest, path)
    return path


def recorded(truth, seed):
    """Return what the diodes record on a flight."""
    t_s = np.arange(truth.t_s[0], truth.t_s[-1], 1 / RATE_HZ)
    from fgnav.integers.resolvers.truth import attitude_at

    R_nb, covered = attitude_at(truth, t_s)
    values = currents(R_nb[covered], np.random.default_rng(seed))
    return Record(t_s=t_s[covered], values=values, unit="A", frame="b")
