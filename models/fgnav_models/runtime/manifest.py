"""What a released network says about itself: the JSON file beside its weights."""

from pathlib import Path
from typing import Any, Literal, TypeAlias

import msgspec

from fgnav.checks import BadInputError
from fgnav.io.strict_toml import Table
from fgnav.io.user_files import read_bytes

_MOST_BYTES = 4_000_000
Kind: TypeAlias = Literal["float32", "int64", "bool"]


class Port(Table, frozen=True):
    """One input or output of a network.

    Attributes
    ----------
    name : str
    shape : tuple of int or str
        A word stands for any length, the same wherever it occurs: ``("n", 36)``.
    unit : str
        ``"m"``, ``"cycle"``, ``"1"``.
    meaning : str
        What it holds, in the field's words, with its frame.
    dtype : str
    """

    name: str
    shape: tuple[int | str, ...]
    unit: str
    meaning: str
    dtype: Kind = "float32"


class Manifest(Table, frozen=True):
    """A network's contract and its origin.

    Attributes
    ----------
    name : str
    purpose : str
        One sentence.
    sha256, size_bytes
        Of the ONNX file; anything else is refused.
    inputs, outputs : tuple of Port
    domain : dict
        Where the network may be believed: ranges of what it was trained on, by name.
    recipe : dict
        The training recipe, whole.
    seed : int
        Of data and training.
    metrics : dict of str to float
        Measured on data that it never saw; a name says the unit and the set.
    made_with : dict of str to str
        Versions and hardware.
    """

    format: Literal["fgnav-network/1"]
    name: str
    purpose: str
    sha256: str
    size_bytes: int
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    domain: dict[str, Any]
    recipe: dict[str, Any]
    seed: int
    metrics: dict[str, float]
    made_with: dict[str, str]


def read_manifest(path: Path) -> Manifest:
    """Return the manifest in a JSON file.

    Raises
    ------
    BadInputError
        If the file cannot be read or is no manifest.
    """
    try:
        content = read_bytes(path, _MOST_BYTES)
    except BadInputError as error:
        raise BadInputError(f"{error}; a network is NAME.onnx with NAME.json beside it") from None
    try:
        return msgspec.json.decode(content, type=Manifest)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadInputError(f"{path}: must be a network's manifest, {error}") from None


def manifest_text(manifest: Manifest) -> str:
    """Return a manifest as JSON for people to read."""
    return msgspec.json.format(msgspec.json.encode(manifest), indent=2).decode() + "\n"
