"""A released network, checked byte by byte before it runs."""

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fgnav.checks import BadInputError
from fgnav.io.user_files import read_bytes
from fgnav.neural.onnx.scan import scan
from fgnav.neural.onnx.session import Session
from fgnav_models.runtime.manifest import Manifest, Port, read_manifest

_MOST_BYTES = 100_000_000  # released networks have 1 MB at most
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
    _session: Session

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
            If a name, a shape or a value does not fit the manifest, on either side, or the
            network does not end within its bounds.
        """
        ports = self.manifest.inputs
        if inputs.keys() != {port.name for port in ports}:
            wanted, given = ", ".join(port.name for port in ports), ", ".join(inputs) or "nothing"
            raise BadInputError(f"{self.manifest.name}: inputs must be {wanted}, got {given}")
        lengths: dict[str, int] = {}
        name = self.manifest.name
        feed = {p.name: _checked(f"{name}: input", p, inputs[p.name], lengths) for p in ports}
        ports = self.manifest.outputs
        answers = self._session.run([port.name for port in ports], feed)
        return {
            p.name: _checked(f"{name}: output", p, answer, lengths)
            for p, answer in zip(ports, answers, strict=True)
        }


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
    content = read_bytes(path, _MOST_BYTES)
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
    session = Session(path, content, threads)
    _check_ports(path, "input", manifest.inputs, session.inputs)
    _check_ports(path, "output", manifest.outputs, session.outputs)
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


def _checked(side: str, port: Port, value: ArrayLike, lengths: dict[str, int]) -> NDArray[Any]:
    """Return an array as its port states it, and note the lengths that its shape names."""
    array = np.asarray(value)
    known = f" with {lengths}" if lengths else ""  # those that earlier inputs have
    fits = array.ndim == len(port.shape) and all(
        have == (lengths.setdefault(want, have) if isinstance(want, str) else want)
        for have, want in zip(array.shape, port.shape, strict=True)
    )
    if not fits:
        raise BadInputError(
            f"{side} {port.name} must have shape {port.shape}{known}, got {array.shape}"
        )
    if not np.can_cast(array.dtype, port.dtype, "same_kind"):
        raise BadInputError(f"{side} {port.name} must be {port.dtype}, got {array.dtype}")
    array = np.ascontiguousarray(array, dtype=port.dtype)
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        row = int(np.argwhere(~np.isfinite(array))[0][0]) if array.ndim else 0
        raise BadInputError(f"{side} {port.name} is not finite, first at row {row}")
    return array
