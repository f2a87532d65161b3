"""From a trained torch module to the files that ``runtime.load`` accepts: ONNX, manifest, card."""

import warnings
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec
import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper

from fgnav.checks import BadInputError, FloatArray, NoSolutionError
from fgnav.io.atomic_write import atomic_file, made_folder, write_text
from fgnav_models.runtime.load import load
from fgnav_models.runtime.manifest import Manifest, Port, manifest_text

AGREEMENT = 1e-5  # onnxruntime against torch, absolute, or relative to outputs above 1
_OPSET = 17
_HALVED_FROM = 256  # numbers; smaller tensors (biases, scales) keep float32


class Story(msgspec.Struct, frozen=True, kw_only=True):
    """All of a manifest that its maker tells; the rest is computed from the files."""

    name: str
    purpose: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    domain: dict[str, Any]
    recipe: dict[str, Any]
    seed: int
    metrics: dict[str, float]
    made_with: dict[str, str] = {}


def release(
    module: torch.nn.Module,
    examples: Sequence[FloatArray],
    story: Story,
    folder: Path,
    *,
    notes: Mapping[str, str],
    cards: Path | None = None,
    half: bool = False,
) -> Manifest:
    """Write ``NAME.onnx``, ``NAME.json`` and the model card ``NAME.md``.

    Parameters
    ----------
    module : torch.nn.Module
        On the CPU; takes the inputs of ``story`` in their order, returns its outputs.
    examples : sequence of ndarray
        One array per input, with two rows or more: what both run-times are compared on.
    story : Story
    folder : Path
        For ONNX and manifest; made if absent.
    notes : mapping of str to str
        Sections of the card, title and Markdown text: what the network is for, what it is not.
    cards : Path, optional
        Folder of the card; ``folder`` itself by default.
    half : bool
        Store large weights as float16; it still computes in float32. The parameters of ``module``
        are rounded so; its buffers are not.

    Returns
    -------
    Manifest

    Raises
    ------
    NoSolutionError
        If onnxruntime and torch differ by more than ``AGREEMENT``, or a weight is not finite.
    """
    module.eval()
    _check_weights(module, story.name)
    if half:
        _round_to_half(module)
    content = _exported(module, examples, story)
    if half:
        content = _halved(content)
    own = {"torch": str(torch.__version__), "onnx": str(onnx.__version__)}
    manifest = Manifest(
        format="fgnav-network/1",
        sha256=sha256(content).hexdigest(),
        size_bytes=len(content),
        **msgspec.structs.asdict(story) | {"made_with": own | story.made_with},
    )
    with TemporaryDirectory() as place:
        _write(manifest, content, Path(place))
        _check_agreement(module, examples, story, Path(place) / f"{story.name}.onnx")
    _write(manifest, content, made_folder(folder))
    write_text(made_folder(cards or folder) / f"{story.name}.md", card_text(manifest, notes))
    return manifest


def card_text(manifest: Manifest, notes: Mapping[str, str]) -> str:
    """Return the model card, Markdown: purpose, notes, ports, domain, metrics, origin."""
    ports = [
        (side, f"`{p.name}`", " × ".join(map(str, p.shape)), p.unit, p.meaning)
        for side, group in (("in", manifest.inputs), ("out", manifest.outputs))
        for p in group
    ]
    figures = [(_words(key), f"{value:.6g}") for key, value in manifest.metrics.items()]
    domain = [f"- {_words(key)}: {_plain(value)}" for key, value in manifest.domain.items()]
    made_with = ", ".join(f"{key} {value}" for key, value in manifest.made_with.items())
    sections = {
        **notes,
        "Inputs and outputs": markdown_table(("", "name", "shape", "unit", "meaning"), ports),
        "Domain": "\n".join(domain),
        "Measured on data it never saw": markdown_table(("figure", "value"), figures),
        "Origin": f"Seed {manifest.seed}; {made_with}.\n{manifest.size_bytes} bytes, "
        f"sha256 `{manifest.sha256}`. The recipe is in the manifest, {manifest.name}.json.",
    }
    parts = [f"# {manifest.name}", manifest.purpose]
    parts += [f"## {title}\n\n{text.strip()}" for title, text in sections.items()]
    return "\n\n".join(parts) + "\n"


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _words(name: str) -> str:
    return name.replace("_", " ")


def _plain(value: object) -> str:
    if isinstance(value, list | tuple) and all(isinstance(v, int | float) for v in value):
        return " to ".join(map(str, value)) if len(value) == 2 else ", ".join(map(str, value))
    return str(value)


def _write(manifest: Manifest, content: bytes, folder: Path) -> None:
    with atomic_file(folder / f"{manifest.name}.onnx") as part:
        part.write_bytes(content)
    write_text(folder / f"{manifest.name}.json", manifest_text(manifest))


def _check_weights(module: torch.nn.Module, name: str) -> None:
    for key, value in module.state_dict().items():
        if value.is_floating_point() and not bool(torch.isfinite(value).all()):
            raise NoSolutionError(f"{name}: weights {key} are not all finite; train again")


def _round_to_half(module: torch.nn.Module) -> None:
    """Give large weights the values that float16 can hold."""
    with torch.no_grad():
        for value in module.parameters():
            if value.numel() >= _HALVED_FROM:
                value.copy_(value.half().float())


def _exported(module: torch.nn.Module, examples: Sequence[FloatArray], story: Story) -> bytes:
    """Return the ONNX file of a module, every length that a port names left open."""
    ports = (*story.inputs, *story.outputs)
    axes = {
        p.name: {i: length for i, length in enumerate(p.shape) if isinstance(length, str)}
        for p in ports
    }
    buffer = BytesIO()
    with warnings.catch_warnings():
        # The tracer is on its way out of torch; its successor wants one more package.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            module,
            tuple(_tensors(examples, story.inputs)),
            buffer,
            dynamo=False,
            opset_version=_OPSET,
            input_names=[port.name for port in story.inputs],
            output_names=[port.name for port in story.outputs],
            dynamic_axes={name: named for name, named in axes.items() if named},
        )
    return _with_shapes(buffer.getvalue(), story.outputs)


def _with_shapes(content: bytes, outputs: Sequence[Port]) -> bytes:
    """Return a file that states its outputs' lengths: the tracer gives up on some of them."""
    model = onnx.load_model_from_string(content)
    for value, port in zip(model.graph.output, outputs, strict=True):
        element = value.type.tensor_type.elem_type
        value.CopyFrom(helper.make_tensor_value_info(value.name, element, port.shape))
    return bytes(model.SerializeToString())


def _tensors(arrays: Sequence[FloatArray], ports: Sequence[Port]) -> list[torch.Tensor]:
    if len(arrays) != len(ports):
        raise BadInputError(f"examples: must be one per input, {len(ports)}, got {len(arrays)}")
    return [
        torch.from_numpy(np.ascontiguousarray(array, dtype=port.dtype))
        for array, port in zip(arrays, ports, strict=True)
    ]


def _halved(content: bytes) -> bytes:
    """Return a file that keeps weights as float16 where that loses nothing, and casts them back."""
    model = onnx.load_model_from_string(content)
    graph = model.graph
    casts = []
    for tensor in graph.initializer:
        values = numpy_helper.to_array(tensor)
        if tensor.data_type != TensorProto.FLOAT or values.size < _HALVED_FROM:
            continue
        with np.errstate(over="ignore"):
            halves = values.astype(np.float16)
        if (halves != values).any():  # a constant that was not rounded: input scales, tables
            continue
        name = tensor.name
        tensor.CopyFrom(numpy_helper.from_array(halves, f"{name}.half"))
        casts.append(helper.make_node("Cast", [f"{name}.half"], [name], to=TensorProto.FLOAT))
    nodes = [*casts, *graph.node]
    del graph.node[:]
    graph.node.extend(nodes)
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())


def _check_agreement(
    module: torch.nn.Module, examples: Sequence[FloatArray], story: Story, path: Path
) -> None:
    """Raise unless torch and onnxruntime agree, on all rows and on the first alone."""
    network = load(path)
    names = [port.name for port in story.outputs]
    open_first = [bool(p.shape) and isinstance(p.shape[0], str) for p in story.inputs]
    for rows in (slice(None), slice(1)):
        some = [a[rows] if cut else a for a, cut in zip(examples, open_first, strict=True)]
        with torch.no_grad():
            answer = module(*_tensors(some, story.inputs))
        answers = (answer,) if isinstance(answer, torch.Tensor) else answer
        ours = network(**{p.name: a for p, a in zip(story.inputs, some, strict=True)})
        for name, value in zip(names, answers, strict=True):
            expected = value.numpy()
            error = np.abs(ours[name] - expected) / np.maximum(1.0, np.abs(expected))
            worst = float(error.max(initial=0.0))
            if not worst <= AGREEMENT:
                raise NoSolutionError(
                    f"{story.name}: output {name} of onnxruntime differs from torch by "
                    f"{worst:.2g}, allowed is {AGREEMENT:g}"
                )
