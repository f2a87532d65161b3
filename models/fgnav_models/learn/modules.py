"""A live torch module as a source of factors, by the contract that ONNX networks keep."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
import torch
from numpy.typing import NDArray

from fgnav.checks import BadInputError, FloatArray
from fgnav.neural.factor import NeuralFactor
from fgnav.neural.manifest import FORMAT, Input, Manifest, Output
from fgnav.neural.measures import MEASURES, SENSORS, Quantity
from fgnav.neural.network import Network
from fgnav.neural.records import Record
from fgnav_models.training.contract import Release
from fgnav_models.training.release import release

Uncertainty = Literal["log_sigma", "cholesky"] | float | Sequence[float]

_EXAMPLES = 64  # windows that a new factor and an export are tried on
_FLAT = 1e-6  # of a channel's size: training windows that do not vary have no scale
_NOT_YET = "0" * 64  # the hash of a file that is not written


@dataclass(frozen=True, eq=False, slots=True)
class TorchRuntime:
    """A module that answers in the place of an ONNX file; without dropout, without a gradient."""

    module: torch.nn.Module
    inputs: tuple[str, ...]  # in the module's order
    outputs: tuple[str, ...]  # likewise

    def run(self, names: Sequence[str], feed: Mapping[str, NDArray[Any]]) -> list[NDArray[Any]]:
        """Return the outputs of those names; errors as ``outputs_of``."""
        training = self.module.training
        self.module.eval()
        try:
            with torch.no_grad():
                answers = dict(zip(self.outputs, self.outputs_of(feed), strict=True))
        finally:
            self.module.train(training)
        return [answers[name].detach().cpu().numpy() for name in names]

    def outputs_of(self, feed: Mapping[str, NDArray[Any]]) -> tuple[torch.Tensor, ...]:
        """Return the module's outputs, which torch differentiates.

        Raises
        ------
        BadInputError
            If the module stops, or returns other than one tensor for each output.
        """
        what = type(self.module).__name__
        weights = next(self.module.parameters(), torch.zeros(()))
        given = [torch.from_numpy(np.ascontiguousarray(feed[name])) for name in self.inputs]
        try:
            answer = self.module(*(x.to(weights) for x in given))
        except (RuntimeError, TypeError, ValueError, IndexError) as error:
            shapes = ", ".join(f"{name} {tuple(feed[name].shape)}" for name in self.inputs)
            reason = " ".join(str(error).split())[:200]
            raise BadInputError(f"module {what}: stops at windows {shapes}: {reason}") from error
        answers = (answer,) if isinstance(answer, torch.Tensor) else tuple(answer)
        if len(answers) != len(self.outputs) or not all(map(torch.is_tensor, answers)):
            raise BadInputError(
                f"module {what}: must return {len(self.outputs)} tensors "
                f"({', '.join(self.outputs)}), returns {len(answers)}"
            )
        return answers


def input_of(
    sensor: str,
    windows: FloatArray,
    rate_hz: float,
    *,
    unit: str | None = None,
    frame: str | None = None,
    margin: float = 0.0,
) -> Input:
    """Return an input as training windows have it: length, channels, mean, scale and range.

    Parameters
    ----------
    sensor : str
        As of a manifest: ``"accelerometer"``, or the name of a record.
    windows : ndarray, shape (k, window, channels)
        In the unit, the oldest sample first.
    rate_hz : float
    unit, frame : str, optional
        Those that flights have of the sensor; of a record they are to be stated.
    margin : float
        Share of each channel's span that its range is wider at either end.

    Raises
    ------
    BadInputError
        If the windows have another shape, or unit and frame of a record are missing.
    """
    known, x = SENSORS.get(sensor), np.asarray(windows, dtype=np.float64)
    if x.ndim != 3 or not x.size or not np.isfinite(x).all():
        raise BadInputError(
            f"input {sensor!r}: windows must be finite, (k, window, channels), got shape {x.shape}"
        )
    if known is None and (unit is None or frame is None):
        raise BadInputError(f"input {sensor!r}: state unit and frame of this record")
    low, high, scale = x.min(axis=(0, 1)), x.max(axis=(0, 1)), x.std(axis=(0, 1))
    least = _FLAT * np.maximum(np.abs(x).max(axis=(0, 1)), 1.0)
    wider = np.maximum(margin * (high - low), least)
    content = {
        "name": sensor.replace(" ", "_"),
        "sensor": sensor,
        "unit": unit or (known.unit if known else ""),
        "frame": frame or (known.frame if known else ""),
        "rate_hz": rate_hz,
        "window": x.shape[1],
        "mean": x.mean(axis=(0, 1)).tolist(),
        "scale": np.maximum(scale, least).tolist(),
        "range": np.stack([low - wider, high + wider], axis=1).tolist(),
    }
    made: Input = _converted(f"input {sensor!r}", content, Input)
    return made


def factor(  # noqa: PLR0913  # what the manifest of a network says
    module: torch.nn.Module,
    measures: Quantity,
    inputs: Sequence[Input],
    *,
    covariance: Uncertainty = "log_sigma",
    unit: str | None = None,
    frame: str | None = None,
    over_s: float | None = None,
    half_life_s: float = 0.0,
    lasting: float = 0.0,
    records: Mapping[str, Record] | None = None,
    interval_s: float | None = None,
    name: str | None = None,
) -> NeuralFactor:
    """Return a live module as a source of factors; what it learns later, it says at once.

    Parameters
    ----------
    module : torch.nn.Module
        Takes windows, (n, window, channels) float32 each, normalised, and returns the quantity,
        (n, d), and how sure it is of it, as ``covariance`` says.
    measures : str
        ``"velocity"``, ``"displacement"``, ``"direction"`` of gravity, …: see the manifest.
    inputs : sequence of Input
        In the module's order; ``input_of``.
    covariance : {"log_sigma", "cholesky"}, float or sequence of float
        Form of the module's second output; numbers: constant 1-sigmas, and no second output.
    unit, frame : str, optional
        Of the output; the first unit that the quantity has, and the frame of those with one.
    over_s : float, optional
        Of displacements.
    half_life_s, lasting : float
        Of the errors' correlation (``fgnav.neural.correlation``).
    records, interval_s
        As of ``NeuralFactor``.
    name : str, optional
        What reports call it; the module's class by default.

    Raises
    ------
    BadInputError
        If shapes, units or covariance break the contract, in one line; it is tried at once.
    """
    called = name or type(module).__name__
    if measures == "integers" or measures not in MEASURES:
        known = ", ".join(sorted(MEASURES.keys() - {"integers"}))
        raise BadInputError(f"module {called}: measures must be one of {known}, got {measures!r}")
    known_of = MEASURES[measures]
    if frame is None and len(known_of.frames) > 1:
        raise BadInputError(
            f"module {called}: frame: {measures} may be in {' or '.join(known_of.frames)}; state it"
        )
    stated = isinstance(covariance, str)
    sigma = () if stated else tuple(np.atleast_1d(np.asarray(covariance, dtype=float)).tolist())
    output = {
        "name": measures,
        "measures": measures,
        "manifold": known_of.manifold,
        "unit": unit or next(iter(known_of.units)),
        "frame": frame or known_of.frames[0],
        "covariance": {"form": covariance, "name": "uncertainty"}
        if stated
        else {"form": "none", "sigma": sigma},
        "half_life_s": half_life_s,
        "lasting": lasting,
        "over_s": over_s,
    }
    manifest = Manifest(
        format=FORMAT,
        name=called,
        purpose=f"{measures.capitalize()} by {', '.join(spec.sensor for spec in inputs)}.",
        onnx=f"{called}.onnx",
        sha256=_NOT_YET,
        licence="BSD-3-Clause",
        inputs=tuple(inputs),
        output=_converted(f"module {called}", output, Output),
    )
    network = network_of(module, manifest)
    network(_examples(manifest))
    return NeuralFactor(network, records=records, interval_s=interval_s)


def network_of(module: torch.nn.Module, manifest: Manifest) -> Network:
    """Return a module that keeps a manifest's contract as a network that runs."""
    names = tuple(name for _, name in manifest.outputs())
    runtime = TorchRuntime(module, tuple(spec.name for spec in manifest.inputs), names)
    axes = ((0, 1, 2),) * len(manifest.inputs)
    return Network(Path(f"module {manifest.name}"), manifest, runtime, axes)


def module_of(source: NeuralFactor) -> TorchRuntime:
    """Return the module behind a source of factors.

    Raises
    ------
    BadInputError
        If it is a network of a file, which has no gradient.
    """
    runtime = source.network.runtime
    if not isinstance(runtime, TorchRuntime):
        raise BadInputError(f"{source.name}: is a network of a file; give learn.factor(module, …)")
    return runtime


def export(
    source: NeuralFactor,
    folder: Path | str,
    *,
    name: str | None = None,
    purpose: str | None = None,
    licence: str | None = None,
    metrics: Mapping[str, float] | None = None,
) -> Path:
    """Write a module's ONNX file, manifest with its hash, and card; return the manifest's path.

    Raises
    ------
    NoSolutionError
        If a weight is not finite, or onnxruntime and torch do not answer alike.
    """
    runtime, manifest = module_of(source), source.network.manifest
    called = name or manifest.name
    manifest = msgspec.structs.replace(
        manifest,
        name=called,
        onnx=f"{called}.onnx",
        purpose=purpose or manifest.purpose,
        licence=licence or manifest.licence,
    )
    words = Release(name=called, purpose=manifest.purpose, notes={}, domain={})
    given = _examples(manifest)
    release(runtime.module, given, manifest, words, metrics or {}, Path(folder))
    return Path(folder) / f"{called}.json"


def _examples(manifest: Manifest) -> list[FloatArray]:
    """Return windows of noise as wide as training's."""
    rng = np.random.default_rng(0)  # nothing is learned of them
    return [
        np.asarray(spec.mean)
        + np.asarray(spec.scale) * rng.standard_normal((_EXAMPLES, spec.window, len(spec.range)))
        for spec in manifest.inputs
    ]


def _converted(where: str, content: Mapping[str, Any], table: type[Any]) -> Any:  # noqa: ANN401  # of the table
    try:
        return msgspec.convert(content, table)
    except msgspec.ValidationError as error:
        raise BadInputError(f"{where}: {error}") from None
