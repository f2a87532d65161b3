"""The gravity network as a factor: what its estimator prepares is in the graph, the rest stated."""

import warnings
from collections.abc import Mapping
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from fgnav.checks import NoSolutionError
from fgnav.io.atomic_write import atomic_file, made_folder, write_text
from fgnav.neural.manifest import Covariance, Input, Manifest, Output, Statistic, save_manifest
from fgnav.neural.network import load_network
from fgnav_models.gravity_features import SAMPLES, SPAN_S, STEP_S
from fgnav_models.training.ambiguity.released import Release
from fgnav_models.training.gravity.nets import GravityNet
from fgnav_models.training.release import AGREEMENT, markdown_table
from fgnav_sim.data_sets.gravity import GravityEpochs

_FIX_S = 0.1
_VELOCITIES = round(SPAN_S / _FIX_S) + 1  # the oldest and the newest are differenced
_GRAVITY_MPS2 = 9.81  # told to a hundredth, for the domain alone
_OPSET = 17
_MOST = 1e3  # of any channel: what the domain allows is stated by its figures
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


def release_factor(
    net: GravityNet,
    epochs: GravityEpochs,
    words: Release,
    domain: dict[str, Any],
    metrics: Mapping[str, float],
    folder: Path,
) -> None:
    """Write ``NAME.onnx``, ``NAME.json``, as ``--factors`` takes it, and the card ``NAME.md``.

    Parameters
    ----------
    net : GravityNet
    epochs : GravityEpochs
        What both run-times are compared on.
    words : Release
    domain : dict
        Ranges of ``FIGURES``, and ``independent_after_s``.
    metrics : mapping of str to float
        For the card.
    folder : Path

    Raises
    ------
    NoSolutionError
        If onnxruntime and torch differ by more than ``AGREEMENT``.
    """
    module = GravityFactor(net).eval()
    half_mps = epochs.a_n_mps2 * SPAN_S / 2
    v_n_mps = np.stack([epochs.v_n_mps - half_mps, epochs.v_n_mps, epochs.v_n_mps + half_mps], 1)
    examples = tuple(torch.from_numpy(x[:64]).float() for x in (epochs.f_b_mps2, v_n_mps))
    content = _exported(module, examples)
    manifest = Manifest(
        format="fgnav-factor/1",
        name=words.name,
        purpose=words.purpose,
        onnx=f"{words.name}.onnx",
        sha256=sha256(content).hexdigest(),
        licence="BSD-3-Clause",
        inputs=(
            _input("f_b_mps2", "accelerometer", ("m/s2", "b"), 1 / STEP_S, SAMPLES),
            _input("v_n_mps", "velocity", ("m/s", "n"), 1 / _FIX_S, _VELOCITIES),
        ),
        output=Output(
            name="g_b",
            measures="direction",
            manifold="S2",
            unit="rad",
            frame="b",
            covariance=Covariance(form="cholesky", name="cholesky"),
            # A Gauss-Markov process whose mean over a long time varies as much: T = 2 h / ln 2.
            half_life_s=round(float(domain["independent_after_s"]) * float(np.log(2)) / 2, 2),
        ),
        domain=tuple(
            Statistic(name=name, unit=unit, range=tuple(domain[name]))
            for name, unit in FIGURES.items()
        ),
    )
    place = made_folder(folder) / manifest.onnx
    with atomic_file(place) as part:
        part.write_bytes(content)
    save_manifest(manifest, place.with_suffix(".json"))
    write_text(place.with_suffix(".md"), _card(manifest, words, metrics))
    with torch.no_grad():
        expected = module(*examples)
    answers = load_network(place.with_suffix(".json"))([x.double().numpy() for x in examples])
    L = np.zeros((len(expected[1]), 3, 3))
    L[(slice(None), *np.tril_indices(3))] = expected[1].double().numpy()
    for what, ours, theirs in (
        ("g_b", answers.value, expected[0].double().numpy()),
        ("covariance", answers.covariance, L @ L.swapaxes(1, 2)),
    ):
        worst = float(np.abs(ours - theirs).max())
        if not worst <= AGREEMENT:
            raise NoSolutionError(
                f"{words.name}: {what} of onnxruntime differs from torch by {worst:.2g}, allowed "
                f"is {AGREEMENT:g}"
            )


def _card(manifest: Manifest, words: Release, metrics: Mapping[str, float]) -> str:
    domain = [f"{key.replace('_', ' ')}: {value}" for key, value in words.domain.items()]
    domain += [
        f"{one.name.replace('_', ' ')}: {one.range[0]} to {one.range[1]} {one.unit}"
        for one in manifest.domain
    ]
    figures = [(key, f"{value:.6g}") for key, value in metrics.items()]
    sections = {
        **words.notes,
        "Domain": "\n".join(f"- {line}" for line in domain),
        "Measured on data it never saw": markdown_table(("figure", "value"), figures),
        "Origin": f"sha256 `{manifest.sha256}`; half-life of errors "
        f"{manifest.output.half_life_s:g} s; {manifest.licence}.",
    }
    parts = [f"# {manifest.name}", manifest.purpose]
    parts += [f"## {title}\n\n{text.strip()}" for title, text in sections.items()]
    return "\n\n".join(parts) + "\n"


def _input(
    name: str, sensor: str, unit_frame: tuple[str, str], rate_hz: float, window: int
) -> Input:
    unit, frame = unit_frame
    return Input(
        name=name,
        sensor=sensor,
        unit=unit,
        frame=frame,
        rate_hz=round(rate_hz, 6),
        window=window,
        mean=(0.0,) * 3,
        scale=(1.0,) * 3,
        range=((-_MOST, _MOST),) * 3,
    )


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


def _exported(module: nn.Module, examples: tuple[torch.Tensor, ...]) -> bytes:
    buffer, names = BytesIO(), ["f_b_mps2", "v_n_mps", "g_b", "cholesky", *FIGURES]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the tracer's own, see ``training.release``
        torch.onnx.export(
            module,
            examples,
            buffer,
            dynamo=False,
            opset_version=_OPSET,
            input_names=names[:2],
            output_names=names[2:],
            dynamic_axes={name: {0: "n"} for name in names},
        )
    return buffer.getvalue()
