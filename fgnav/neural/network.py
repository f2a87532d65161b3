"""A network that measures, checked byte by byte before it runs, and what it says in SI."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav.io.user_files import read_bytes
from fgnav.neural.manifest import Covariance, Input, Manifest, Output, read_manifest
from fgnav.neural.onnx.scan import scan
from fgnav.neural.onnx.session import Session

_MOST_BYTES = 100_000_000  # networks that run at a keyframe's rate have a thousandth of it
_AT_ONCE = 4096  # windows
_TURN_RAD = 2 * np.pi * (1 + 1e-6)
_UNIT = (0.5, 2.0)  # norms of what is to be a unit vector; beyond, it is something else
_NO_ANGLE = 1e-6  # of cosine and sine together: their angle is rounding
_LONGEST_LOG = 30.0  # of a 1-sigma: e^30 of any unit is nothing that a network can mean


class Runtime(Protocol):
    """Runtime of a graph: onnxruntime in a process of its own, or a live module."""

    def run(self, names: Sequence[str], feed: Mapping[str, NDArray[Any]]) -> Sequence[NDArray[Any]]:
        """Return the outputs of those names, a row for each window.

        Raises
        ------
        BadInputError
            If the network stops at it.
        """
        ...


@dataclass(frozen=True, eq=False, slots=True)
class Answers:
    """Values, (k, d), and covariances, (k, f, f), in SI and radians, of k windows.

    ``figures`` are those of the manifest's domain, (k,) each.
    """

    value: FloatArray
    covariance: FloatArray
    figures: tuple[FloatArray, ...] = ()


@dataclass(frozen=True, eq=False, slots=True)
class Network:
    """Network with its contract; ``path`` is the manifest's, for errors."""

    path: Path
    manifest: Manifest
    runtime: Runtime
    axes: tuple[tuple[int, ...], ...]  # of each input, that the graph has

    def __call__(self, inputs: Sequence[FloatArray]) -> Answers:
        """Run the network on windows, (k, window, channels) for each input.

        Raises
        ------
        BadInputError
            If an output is not finite, no value of what it is to measure, or its covariance is
            not positive.
        """
        return self.read(self.run(inputs))

    def run(self, inputs: Sequence[FloatArray]) -> list[FloatArray]:
        """Return the outputs that the manifest names, (k, c) each; none of no windows.

        Raises
        ------
        BadInputError
            If one has not a row for each window, or the network stops at it.
        """
        k = len(inputs[0])
        parts = [self._run([x[i : i + _AT_ONCE] for x in inputs]) for i in range(0, k, _AT_ONCE)]
        return [np.concatenate(columns) for columns in zip(*parts, strict=True)]

    def read(self, raw: Sequence[FloatArray]) -> Answers:
        """Decode outputs, (k, c) each: value, covariance, figures; none of no windows.

        Raises
        ------
        BadInputError
            As of a call.
        """
        output, where = self.manifest.output, f"{self.path}: output"
        if not raw:
            none = tuple(np.zeros(0) for _ in self.manifest.domain)
            d, f = min(output.measure.widths), output.measure.freedom
            return Answers(np.zeros((0, d)), np.zeros((0, f, f)), none)
        stated = 2 if output.covariance.name else 1
        return Answers(
            _value(where, output, raw[0]),
            _covariance(where, output, raw[1] if stated == 2 else None, len(raw[0])),
            tuple(map(_figure, self.names[stated:], raw[stated:])),
        )

    @property
    def names(self) -> list[str]:
        """Names of the graph's outputs: the answer's, its covariance's, the domain's figures."""
        return [name for _, name in self.manifest.outputs()]

    def with_sigma(self, sigma: Sequence[float]) -> "Network":
        """Return a copy with constant 1-sigmas, in SI, in place of its covariance."""
        output = self.manifest.output
        stated = Covariance(form="none", sigma=tuple(value / output.in_si for value in sigma))
        output = msgspec.structs.replace(output, covariance=stated)
        return replace(self, manifest=msgspec.structs.replace(self.manifest, output=output))

    def feed(self, inputs: Sequence[FloatArray]) -> dict[str, NDArray[np.float32]]:
        """Return the graph's inputs made from windows, by their names."""
        return {
            spec.name: ((x - spec.mean) / spec.scale)
            .astype(np.float32)
            .reshape([x.shape[axis] for axis in axes])
            for spec, x, axes in zip(self.manifest.inputs, inputs, self.axes, strict=True)
        }

    def _run(self, inputs: list[FloatArray]) -> list[FloatArray]:
        feed, names = self.feed(inputs), self.names
        answers = self.runtime.run(names, feed)
        for name, answer in zip(names, answers, strict=True):
            if answer.shape[:1] != (len(inputs[0]),) or answer.ndim > 3:
                raise BadInputError(
                    f"{self.path}: output {name!r}: must have one row per window, "
                    f"{len(inputs[0])}, got shape {answer.shape}"
                )
        return [answer.astype(np.float64).reshape(len(answer), -1) for answer in answers]


def load_network(path: Path, *, integers: bool = False) -> Network:
    """Return the network of a manifest, ready to run: one that measures states, or integers.

    Raises
    ------
    BadInputError
        If manifest or ONNX file cannot be read, or the hash, content, inputs or outputs are not
        those of the manifest, or it measures the other; nothing of it has been run then.
    """
    manifest = read_manifest(path)
    if integers != (manifest.output.measures == "integers"):
        raise BadInputError(
            f"{path}: key output.measures: must be integers, of a resolver, got "
            f"{manifest.output.measures}; --factors takes it"
            if integers
            else f"{path}: key output.measures: integers are of a resolver, --integers, and no "
            "factor"
        )
    onnx = path.with_name(manifest.onnx)
    content = read_bytes(onnx, _MOST_BYTES)
    digest = sha256(content).hexdigest()
    if digest != manifest.sha256:
        raise BadInputError(
            f"{path}: key sha256: {onnx.name} has {digest}; take the file that the manifest was "
            "made for, or state its hash"
        )
    scan(str(onnx), content)
    session = Session(onnx, content, threads=1)
    return Network(path, manifest, session, _checked_ports(path, manifest, session))


def _checked_ports(path: Path, manifest: Manifest, session: Session) -> tuple[tuple[int, ...], ...]:
    """Check the graph against the manifest; return the axes of each input."""
    have = {port.name: port for port in session.inputs}
    wanted = {spec.name: spec for spec in manifest.inputs}
    if have.keys() != wanted.keys():
        raise BadInputError(
            f"{path}: key inputs: {manifest.onnx} takes {', '.join(have)}, the manifest names "
            f"{', '.join(wanted)}; name each once"
        )
    outputs = [port.name for port in session.outputs]
    for key, name in manifest.outputs():
        if name not in outputs:
            raise BadInputError(
                f"{path}: key {key}: {manifest.onnx} has no output {name!r}; it has "
                f"{', '.join(outputs)}"
            )
    return tuple(
        _checked_axes(f"{path}: key inputs[{index}]", spec, have[spec.name])
        for index, spec in enumerate(manifest.inputs)
    )


def _checked_axes(where: str, spec: Input, port: Any) -> tuple[int, ...]:  # noqa: ANN401  # onnxruntime has no types
    """Return an input's axes less those of length one that the graph leaves out."""
    shape = ("n", spec.window, len(spec.range))
    axes = [0, 1, 2]
    for axis in (1, 2):
        if len(axes) > len(port.shape) and shape[axis] == 1:
            axes.remove(axis)
    fits = len(port.shape) == len(axes) and all(
        not isinstance(have, int) or have == shape[axis]
        for have, axis in zip(port.shape[1:], axes[1:], strict=True)
    )
    if not fits or port.type != "tensor(float)":
        raise BadInputError(
            f"{where}.window: {spec.name!r} takes {port.type} of shape {port.shape}, must "
            f"take float of shape {list(shape)}; export it so"
        )
    return tuple(axes)


def _value(where: str, output: Output, raw: FloatArray) -> FloatArray:
    """Return values in SI: one angle, a rotation matrix (9), a unit vector, a vector, a number."""
    measure = output.measure
    _finite(f"{where}.name {output.name!r}", raw)
    if raw.shape[1] not in measure.widths:
        widths = " or ".join(map(str, measure.widths))
        raise BadInputError(
            f"{where}.name: {output.measures} has {widths} numbers, {output.name!r} has "
            f"{raw.shape[1]}"
        )
    if output.measures == "heading":
        return _heading(where, output, raw)
    if output.measures == "attitude":
        return _rotations(where, raw)
    if output.measures == "direction":
        norm = np.linalg.norm(raw, axis=1, keepdims=True)
        _bounded(where, "direction", norm)
        return np.asarray(raw / norm)
    return raw * output.in_si


def _heading(where: str, output: Output, raw: FloatArray) -> FloatArray:
    if raw.shape[1] == 2:
        if (np.linalg.norm(raw, axis=1) < _NO_ANGLE).any():
            raise BadInputError(
                f"{where}.name: cosine and sine are both zero; normalise the output"
            )
        return np.asarray(np.arctan2(raw[:, 1:], raw[:, :1]))
    heading_rad = raw * output.in_si
    largest = float(np.abs(heading_rad).max())
    if largest > _TURN_RAD:
        mend = "state unit = 'deg'" if output.unit == "rad" else "output an angle"
        raise BadInputError(
            f"{where}.unit: a heading of {largest / output.in_si:.4g} {output.unit} is more than "
            f"a turn; {mend}"
        )
    return heading_rad


def _rotations(where: str, raw: FloatArray) -> FloatArray:
    """Return the nearest rotation matrices, (k, 9)."""
    if raw.shape[1] == 4:
        from scipy.spatial.transform import Rotation  # noqa: PLC0415  # heavy, and seldom used

        _bounded(where, "quaternion", np.linalg.norm(raw, axis=1))
        R = Rotation.from_quat(raw, scalar_first=True).as_matrix()
        return np.asarray(R.reshape(-1, 9))
    U, s, Vt = np.linalg.svd(raw.reshape(-1, 3, 3))
    _bounded(where, "rotation matrix's singular value", s)
    U[:, :, 2] *= np.linalg.det(U @ Vt)[:, None]
    return np.asarray((U @ Vt).reshape(-1, 9))


def _bounded(where: str, what: str, norm: FloatArray) -> None:
    low, high = _UNIT
    wrong = norm[(norm < low) | (norm > high)]
    if len(wrong):
        raise BadInputError(
            f"{where}.manifold: a {what} must have the size 1, got {wrong.flat[0]:.4g}; normalise "
            "the output, or state another quantity"
        )


def _covariance(where: str, output: Output, raw: FloatArray | None, k: int) -> FloatArray:
    """Return covariances in SI, (k, f, f)."""
    form, f = output.covariance.form, output.measure.freedom
    if raw is None:
        sigma = np.broadcast_to(np.array(output.covariance.sigma), (k, f))
        return _diagonal(sigma * output.in_si)
    name = f"{where}.covariance.name {output.covariance.name!r}"
    _finite(name, raw)
    widths = (1, f) if form == "log_sigma" else (f * (f + 1) // 2,)
    if raw.shape[1] not in widths:
        expected = " or ".join(map(str, sorted(set(widths))))
        raise BadInputError(
            f"{name}: {form} of {output.measures} has {expected} numbers, has {raw.shape[1]}"
        )
    if form == "log_sigma":
        if np.abs(raw).max() > _LONGEST_LOG:
            raise BadInputError(
                f"{name}: must be the logarithm of a 1-sigma, within {_LONGEST_LOG:g} of 0, got "
                f"{raw.flat[np.abs(raw).argmax()]:.4g}"
            )
        return _diagonal(np.broadcast_to(np.exp(raw) * output.in_si, (k, f)))
    L: FloatArray = np.zeros((k, f, f))
    L[(slice(None), *np.tril_indices(f))] = raw * output.in_si
    diagonal = np.einsum("nii->ni", L)
    if (diagonal <= 0).any():
        row = int(np.argmax((diagonal <= 0).any(axis=1)))
        raise BadInputError(
            f"{name}: the diagonal of the Cholesky factor must be positive, got "
            f"{(diagonal[row] / output.in_si).min():.4g}; output exp or softplus of it"
        )
    P = L @ L.swapaxes(1, 2)
    return np.asarray((P + P.swapaxes(1, 2)) / 2)


def _figure(name: str, raw: FloatArray) -> FloatArray:
    """Return a figure of the domain, (k,); one that is no number is beyond any range."""
    if raw.shape[1] != 1:
        raise BadInputError(
            f"output {name!r}: a figure of the domain is one number, has {raw.shape[1]}"
        )
    return raw[:, 0]


def _diagonal(sigma: FloatArray) -> FloatArray:
    return np.asarray(sigma[:, :, None] ** 2 * np.eye(sigma.shape[1]))


def _finite(what: str, raw: FloatArray) -> None:
    if not np.isfinite(raw).all():
        rows: IntArray = np.flatnonzero(~np.isfinite(raw).all(axis=1))
        raise BadInputError(f"{what}: not finite in {len(rows)} of {len(raw)} windows")
