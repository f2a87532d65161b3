"""From a trained torch module to what the contract takes: ONNX, manifest and card, compared."""

import platform
import subprocess
import warnings
from collections.abc import Mapping, Sequence
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper

from fgnav.checks import BadInputError, FloatArray, NoSolutionError
from fgnav.io.atomic_write import atomic_file, made_folder, write_text
from fgnav.neural.manifest import UNKNOWN, Manifest, Origin, save_manifest
from fgnav.neural.network import load_network
from fgnav.shipped import shipped
from fgnav_models.training.contract import Release
from fgnav_models.training.order import Order, markdown_table

AGREEMENT = 1e-5  # onnxruntime against torch, of an output's root mean square
_OPSET = 17
_EXAMPLES = 2000  # of those given
_FLOATS = (TensorProto.FLOAT, TensorProto.DOUBLE)
_HALVED_FROM = 256  # numbers; smaller tensors (biases, scales) keep float32


def release(
    module: torch.nn.Module,
    examples: Sequence[FloatArray],
    manifest: Manifest,
    words: Release,
    metrics: Mapping[str, float],
    folder: Path,
    *,
    half: bool = False,
) -> Manifest:
    """Write ``NAME.onnx``, ``NAME.json`` and the card ``NAME.md``.

    Parameters
    ----------
    module : torch.nn.Module
        On the CPU; takes the manifest's inputs, normalised, and returns its outputs in their order,
        and whatever else it likes.
    examples : sequence of ndarray
        In the manifest's units, as the module takes them, two rows or more: what both run-times are
        compared on.
    manifest : Manifest
        But for the hash.
    metrics : mapping of str to float
        For the card.
    folder : Path
        Made if absent.
    half : bool
        Store large weights as float16; it still computes as before. The parameters of ``module``
        are rounded so; its buffers are not.

    Raises
    ------
    NoSolutionError
        If a weight is not finite, or onnxruntime and torch differ by more than ``AGREEMENT`` of an
        answer's root mean square, the scale that single precision rounds at.
    """
    module.eval()
    _check_weights(module, manifest.name)
    given = _tensors([example[:_EXAMPLES] for example in examples], manifest)
    if half:
        _round_to_half(module)
    content = _exported(module, given, manifest)
    if half:
        content = _halved(content)
    manifest = msgspec.structs.replace(manifest, sha256=sha256(content).hexdigest())
    with TemporaryDirectory() as folder_name:
        _check_agreement(module, given, _written(manifest, content, Path(folder_name)))
    _written(manifest, content, made_folder(folder))
    write_text(folder / f"{manifest.name}.md", card(manifest, words, metrics))
    return manifest


def card(manifest: Manifest, words: Release, metrics: Mapping[str, float]) -> str:
    """Return the card of a network, Markdown: purpose, notes, contract, domain, metrics, origin."""
    output = manifest.output
    ports = [
        (
            "in",
            f"`{spec.name}`",
            f"{spec.window} × {len(spec.range)}",
            spec.unit,
            f"{spec.sensor}, frame {spec.frame}"
            + (f", {spec.rate_hz:g} Hz" if spec.rate_hz else ""),
        )
        for spec in manifest.inputs
    ]
    ports.append(("out", f"`{output.name}`", output.manifold, output.unit, output.measures))
    if output.covariance.name:
        ports.append(("out", f"`{output.covariance.name}`", "", "", output.covariance.form))
    domain = [f"{_words(key)}: {_plain(value)}" for key, value in words.domain.items()]
    domain += [
        f"{_words(spec.name)}: {spec.range[0]:g} to {spec.range[1]:g} {spec.unit}".removesuffix(
            " 1"
        )
        for spec in manifest.domain
    ]
    figures = [(_words(key), f"{value:.6g}") for key, value in metrics.items()]
    sections = {
        **words.notes,
        "Inputs and outputs": markdown_table(("", "name", "shape", "unit", "what"), ports),
        "Domain": "\n".join(f"- {line}" for line in domain),
        "Measured on data it never saw": markdown_table(("figure", "value"), figures),
        "Origin": _origin(manifest),
    }
    parts = [f"# {manifest.name}", manifest.purpose]
    parts += [f"## {title}\n\n{text.strip()}" for title, text in sections.items()]
    return "\n\n".join(parts) + "\n"


def disagreement(ours: Sequence[FloatArray], theirs: Sequence[FloatArray]) -> list[float]:
    """Return by how much each output differs at most, of its root mean square."""
    return [
        float(np.abs(a - b).max(initial=0.0) / max(np.sqrt((b**2).mean()), np.finfo(float).tiny))
        for a, b in zip(ours, theirs, strict=True)
    ]


def _origin(manifest: Manifest) -> str:
    """Return whose file a card is of, and what is known of how it was made."""
    output, origin = manifest.output, manifest.origin
    text = f"sha256 `{manifest.sha256}`; {manifest.licence}."
    if output.measure.freedom:
        share = f"{1 - output.lasting:.0%} of their variance"
        text += f"\nHalf-life of errors {output.half_life_s:g} s, of {share}."
    if origin is not None:
        made_with = ", ".join(f"{key} {value}" for key, value in origin.made_with.items())
        text += f"\n`{origin.command}`, commit {origin.commit}, seed {origin.seed}; {made_with}. "
        text += f"The recipe is in the manifest, {manifest.name}.json."
    return text


def made_with(
    seed: int,
    recipe: Mapping[str, object],
    metrics: Mapping[str, float],
    order: Order | None = None,
) -> Origin:
    """Return the provenance of a network: versions of this machine, and the command's order."""
    on_gpu = order is not None and order.device == "cuda"
    versions = {
        "python": platform.python_version(),
        "torch": str(torch.__version__),
        "onnx": str(onnx.__version__),
        "numpy": np.__version__,
        "hardware": torch.cuda.get_device_name() if on_gpu else f"CPU {platform.machine()}",
    }
    return Origin(
        recipe=dict(recipe),
        seed=seed,
        metrics=dict(metrics),
        made_with=versions,
        command=UNKNOWN if order is None else _command(order),
        commit=_commit(),
        scale=UNKNOWN if order is None else order.scale,
    )


def _command(order: Order) -> str:
    """Return the command line of an order, a recipe that comes along by its name."""
    along = order.recipe in shipped("fgnav_models", "recipes").values()
    text = f"fgnav train {order.recipe.stem if along else order.recipe.name} --scale {order.scale}"
    text += "" if order.device == "cpu" else f" --device {order.device}"
    return text + " --plan" * order.plan


def _commit() -> str:
    """Return the commit of this source, ``-dirty`` where files differ; unknown outside of git."""
    file = Path(__file__)
    answers = []
    for arguments in (["ls-files", file.name], ["describe", "--always", "--dirty", "--exclude=*"]):
        command = ["git", "-C", str(file.parent), *arguments]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=True)
        except (OSError, subprocess.CalledProcessError):
            return UNKNOWN
        answers.append(done.stdout.strip())
    return answers[1] if answers[0] else UNKNOWN  # not of a repository that merely lies around it


def _words(name: str) -> str:
    return name.replace("_", " ")


def _plain(value: object) -> str:
    if isinstance(value, list | tuple) and all(isinstance(v, int | float) for v in value):
        return " to ".join(map(str, value)) if len(value) == 2 else ", ".join(map(str, value))
    return str(value)


def _written(manifest: Manifest, content: bytes, folder: Path) -> Path:
    """Write ONNX file and manifest; return where that is."""
    with atomic_file(folder / manifest.onnx) as partial:
        partial.write_bytes(content)
    path = folder / f"{manifest.name}.json"
    save_manifest(manifest, path)
    return path


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


def _exported(
    module: torch.nn.Module, given: tuple[torch.Tensor, ...], manifest: Manifest
) -> bytes:
    """Return the ONNX file of a module, the number of rows left open."""
    inputs, outputs = [spec.name for spec in manifest.inputs], [n for _, n in manifest.outputs()]
    axes = {name: {0: "n"} for name in (*inputs, *outputs)}
    buffer = BytesIO()
    with warnings.catch_warnings():
        # The tracer is on its way out of torch; its successor wants one more package.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            module,
            given,
            buffer,
            dynamo=False,
            opset_version=_OPSET,
            input_names=inputs,
            output_names=outputs,
            dynamic_axes=axes,
        )
    return buffer.getvalue()


def _tensors(examples: Sequence[FloatArray], manifest: Manifest) -> tuple[torch.Tensor, ...]:
    """Return examples as the module is given them."""
    if len(examples) != len(manifest.inputs):
        raise BadInputError(
            f"examples: must be one per input, {len(manifest.inputs)}, got {len(examples)}"
        )
    return tuple(
        torch.from_numpy(np.ascontiguousarray((x - spec.mean) / spec.scale, dtype=np.float32))
        for spec, x in zip(manifest.inputs, examples, strict=True)
    )


def _halved(content: bytes) -> bytes:
    """Return a file that keeps weights as float16 where that loses nothing, and casts them back."""
    model = onnx.load_model_from_string(content)
    graph = model.graph
    casts = []
    for tensor in graph.initializer:
        values = numpy_helper.to_array(tensor)
        if tensor.data_type not in _FLOATS or values.size < _HALVED_FROM:
            continue
        with np.errstate(over="ignore"):
            halves = values.astype(np.float16)
        if (halves != values).any():  # a constant that was not rounded: input scales, tables
            continue
        name, wide = tensor.name, tensor.data_type
        tensor.CopyFrom(numpy_helper.from_array(halves, f"{name}.half"))
        casts.append(helper.make_node("Cast", [f"{name}.half"], [name], to=wide))
    nodes = [*casts, *graph.node]
    del graph.node[:]
    graph.node.extend(nodes)
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())


def _check_agreement(module: torch.nn.Module, given: tuple[torch.Tensor, ...], path: Path) -> None:
    """Raise unless torch and onnxruntime answer alike, on all rows and on the first alone."""
    manifest = msgspec.json.decode(path.read_bytes(), type=Manifest)
    network = load_network(path, integers=not manifest.output.measure.freedom)
    names = [name for key, name in manifest.outputs() if key.startswith("output.")]
    for rows in (slice(None), slice(1)):
        some = tuple(x[rows] for x in given)
        with torch.no_grad():
            answer = module(*some)
        answers = (answer,) if isinstance(answer, torch.Tensor) else answer
        theirs = [x.double().numpy().reshape(len(x), -1) for x in answers[: len(names)]]
        shown = [
            x.numpy().reshape(len(x), spec.window, len(spec.range)) * spec.scale + spec.mean
            for spec, x in zip(manifest.inputs, some, strict=True)
        ]
        ours = network.run(shown)[: len(names)]
        for name, worst in zip(names, disagreement(ours, theirs), strict=True):
            if not worst <= AGREEMENT:
                raise NoSolutionError(
                    f"{manifest.name}: output {name} of onnxruntime differs from torch by "
                    f"{worst:.2g} of its scale, allowed is {AGREEMENT:g}"
                )
