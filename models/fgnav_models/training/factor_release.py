"""From a trained torch module to a factor: ONNX, manifest and card, held against torch."""

import warnings
from collections.abc import Mapping, Sequence
from hashlib import sha256
from io import BytesIO
from pathlib import Path

import msgspec
import numpy as np
import torch
from torch import nn

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.io.atomic_write import atomic_file, made_folder, write_text
from fgnav.neural.manifest import Input, Manifest, save_manifest
from fgnav.neural.measures import SENSORS
from fgnav.neural.network import Answers, load_network
from fgnav_models.training.ambiguity.released import Release
from fgnav_models.training.release import AGREEMENT, markdown_table

_OPSET = 17
_EXAMPLES = 2000  # of those given
_MOST = 1e3  # of any channel of an input that states no range: the domain's figures do


def factor_input(
    name: str, sensor: str, rate_hz: float, window: int, *, scale: float = 1.0
) -> Input:
    """Return an input of a sensor that flights have; its domain is stated by figures."""
    known = SENSORS[sensor]
    return Input(
        name=name,
        sensor=sensor,
        unit=known.unit,
        frame=known.frame,
        rate_hz=round(rate_hz, 6),
        window=window,
        mean=(0.0,) * known.channels,
        scale=(scale,) * known.channels,
        range=((-_MOST, _MOST),) * known.channels,
    )


def release_factor(
    module: nn.Module,
    examples: Sequence[FloatArray],
    manifest: Manifest,
    words: Release,
    metrics: Mapping[str, float],
    folder: Path,
) -> Manifest:
    """Write ``NAME.onnx``, ``NAME.json``, as ``--factors`` takes it, and the card ``NAME.md``.

    Parameters
    ----------
    module : torch.nn.Module
        On the CPU; takes the manifest's inputs, normalised, and returns its output, the
        covariance's and the domain's figures.
    examples : sequence of ndarray, shape (n, window, channels) each
        In the manifest's units: what both run-times are compared on, the first of them.
    manifest : Manifest
        But for the hash.
    words : Release
    metrics : mapping of str to float
        For the card.
    folder : Path

    Raises
    ------
    NoSolutionError
        If onnxruntime and torch differ by more than ``AGREEMENT``: values of the root mean square
        of all answers, which is the scale that single precision rounds at, covariances of their
        own traces.
    """
    module.eval()
    examples = [one[:_EXAMPLES] for one in examples]
    given = tuple(
        torch.from_numpy((x - one.mean) / one.scale).float()
        for one, x in zip(manifest.inputs, examples, strict=True)
    )
    content = _exported(module, given, manifest)
    manifest = msgspec.structs.replace(manifest, sha256=sha256(content).hexdigest())
    place = made_folder(folder) / manifest.onnx
    with atomic_file(place) as part:
        part.write_bytes(content)
    save_manifest(manifest, place.with_suffix(".json"))
    write_text(place.with_suffix(".md"), card(manifest, words, metrics))
    with torch.no_grad():
        raw = [x.double().numpy().reshape(len(x), -1) for x in module(*given)]
    network = load_network(place.with_suffix(".json"))
    for what, worst in disagreement(network(examples), network.read(raw)).items():
        if not worst <= AGREEMENT:
            raise NoSolutionError(
                f"{words.name}: {what} of onnxruntime differs from torch by {worst:.2g} of its "
                f"scale, allowed is {AGREEMENT:g}"
            )
    return manifest


def disagreement(ours: Answers, theirs: Answers) -> dict[str, float]:
    """Return by how much values and covariances differ at most, of their scale."""
    scale = np.sqrt((theirs.value**2).sum(axis=1).mean())
    trace = np.einsum("kii->k", theirs.covariance)[:, None, None]
    return {
        "value": float(np.abs(ours.value - theirs.value).max() / scale),
        "covariance": float((np.abs(ours.covariance - theirs.covariance) / trace).max()),
    }


def card(manifest: Manifest, words: Release, metrics: Mapping[str, float]) -> str:
    """Return the card of a factor, Markdown."""
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
        f"{manifest.output.half_life_s:g} s, of {1 - manifest.output.lasting:.0%} of their "
        f"variance; {manifest.licence}.",
    }
    parts = [f"# {manifest.name}", manifest.purpose]
    parts += [f"## {title}\n\n{text.strip()}" for title, text in sections.items()]
    return "\n\n".join(parts) + "\n"


def _exported(module: nn.Module, examples: tuple[torch.Tensor, ...], manifest: Manifest) -> bytes:
    inputs = [one.name for one in manifest.inputs]
    output = manifest.output
    names = [name for name in (output.name, output.covariance.name) if name]
    names += [one.name for one in manifest.domain]
    buffer = BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the tracer's own, see ``training.release``
        torch.onnx.export(
            module,
            examples,
            buffer,
            dynamo=False,
            opset_version=_OPSET,
            input_names=inputs,
            output_names=names,
            dynamic_axes={name: {0: "n"} for name in (*inputs, *names)},
        )
    return buffer.getvalue()
