"""A released network, checked byte by byte before it runs."""

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fgnav.checks import BadInputError
from fgnav_models.runtime.manifest import Manifest, Port, read_manifest
from fgnav_models.runtime.onnx_scan import scan

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

WEIGHTS = Path(__file__).resolve().parent.parent / "weights"


@dataclass(frozen=True, eq=False, slots=True)
class Model:
    """A network that runs: arrays by name in, arrays by name out, as its manifest says.

    Attributes
    ----------
    manifest : Manifest
        Contract, domain, recipe and metrics.
    """

    manifest: Manifest
    _session: "InferenceSession"

    def __call__(self, **inputs: ArrayLike) -> dict[str, NDArray[Any]]:
        """Run the network once.

        Parameters
        ----------
        **inputs : array_like
            One array per input of the manifest, by name; converted to its type.

        Returns
        -------
        dict of str to ndarray
            One array per output of the manifest.

        Raises
        ------
        BadInputError
            If a name, a shape or a value does not fit the manifest.
        """
        ports = self.manifest.inputs
        if inputs.keys() != {port.name for port in ports}:
            wanted, given = ", ".join(port.name for port in ports), ", ".join(inputs) or "nothing"
            raise BadInputError(f"{self.manifest.name}: inputs must be {wanted}, got {given}")
        lengths: dict[str, int] = {}
        feed = {p.name: _checked(self.manifest.name, p, inputs[p.name], lengths) for p in ports}
        names = [port.name for port in self.manifest.outputs]
        return dict(zip(names, self._session.run(names, feed), strict=True))


def released() -> tuple[str, ...]:
    """Return the names of the networks that come with the package."""
    return tuple(sorted(path.stem for path in WEIGHTS.glob("*.onnx")))


def load(name_or_path: str | Path, *, threads: int = 1) -> Model:
    """Return a network ready to run, after checking its file against its manifest.

    Parameters
    ----------
    name_or_path : str or Path
        A released network's name (``released()``), or an ``.onnx`` file with its manifest,
        ``.json``, beside it.
    threads : int
        For one run of the network.

    Raises
    ------
    BadInputError
        If there is no such network, its hash, its content or its ports are not those of the
        manifest, or a weight is not finite; nothing of it has been run then.
    """
    path = _path(name_or_path)
    manifest = read_manifest(path.with_suffix(".json"))
    try:
        content = path.read_bytes()
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read: {error.strerror}") from None
    if len(content) != manifest.size_bytes:
        raise BadInputError(
            f"{path}: must have {manifest.size_bytes} bytes, has {len(content)}; "
            "take the released file again"
        )
    digest = sha256(content).hexdigest()
    if digest != manifest.sha256:
        raise BadInputError(
            f"{path}: sha256 must be {manifest.sha256}, is {digest}; take the released file again"
        )
    scan(str(path), content)
    session = _session(path, content, threads)
    _check_ports(path, "input", manifest.inputs, session.get_inputs())
    _check_ports(path, "output", manifest.outputs, session.get_outputs())
    return Model(manifest, session)


def _path(name_or_path: str | Path) -> Path:
    path = Path(name_or_path)
    if path.suffix == ".onnx":
        return path
    if str(name_or_path) not in released():
        known = ", ".join(released()) or "none"
        raise BadInputError(
            f"network {str(name_or_path)!r}: not one of {known}, nor a file that ends in .onnx"
        )
    return WEIGHTS / f"{name_or_path}.onnx"


def _session(path: Path, content: bytes, threads: int) -> "InferenceSession":
    """Return onnxruntime's session on one core group, quiet."""
    try:
        import onnxruntime  # noqa: PLC0415  # heavy, and an extra
        from onnxruntime.capi import onnxruntime_pybind11_state as errors  # noqa: PLC0415
    except ModuleNotFoundError:
        raise BadInputError(
            f"{path}: a network needs onnxruntime; pip install 'fgnav[networks]'"
        ) from None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 4  # an error is raised, not printed
    refusals = (
        errors.Fail,
        errors.InvalidArgument,
        errors.InvalidGraph,
        errors.InvalidProtobuf,
        errors.NotImplemented,
        errors.RuntimeException,
    )
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except refusals as error:
        raise BadInputError(f"{path}: onnxruntime refuses it: {error}") from None


def _check_ports(path: Path, side: str, ports: tuple[Port, ...], have: Any) -> None:  # noqa: ANN401  # onnxruntime has no types
    """Raise unless a graph's inputs or outputs are those of the manifest."""
    stated = [(port.name, _onnx_type(port), _shape(port.shape)) for port in ports]
    found = [(arg.name, arg.type, _shape(arg.shape)) for arg in have]
    if stated != found:
        raise BadInputError(f"{path}: {side}s must be {stated} by its manifest, are {found}")


def _onnx_type(port: Port) -> str:
    return {"float32": "tensor(float)", "int64": "tensor(int64)", "bool": "tensor(bool)"}[
        port.dtype
    ]


def _shape(shape: Any) -> tuple[int | None, ...]:  # noqa: ANN401  # as above
    return tuple(length if isinstance(length, int) else None for length in shape)


def _checked(network: str, port: Port, value: ArrayLike, lengths: dict[str, int]) -> NDArray[Any]:
    """Return an input as the network wants it, and note the lengths that its shape names."""
    array = np.asarray(value)
    known = f" with {lengths}" if lengths else ""  # those that earlier inputs have
    fits = array.ndim == len(port.shape) and all(
        have == (lengths.setdefault(want, have) if isinstance(want, str) else want)
        for have, want in zip(array.shape, port.shape, strict=True)
    )
    if not fits:
        raise BadInputError(
            f"{network}: input {port.name} must have shape {port.shape}{known}, got {array.shape}"
        )
    if not np.can_cast(array.dtype, port.dtype, "same_kind"):
        raise BadInputError(f"{network}: input {port.name} must be {port.dtype}, got {array.dtype}")
    array = np.ascontiguousarray(array, dtype=port.dtype)
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        row = int(np.argwhere(~np.isfinite(array))[0][0]) if array.ndim else 0
        raise BadInputError(f"{network}: input {port.name} is not finite, first at row {row}")
    return array
