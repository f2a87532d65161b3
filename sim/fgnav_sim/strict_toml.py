"""Read a TOML file into typed tables; what does not fit is one line: file, key, rule, value."""

import difflib
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeAlias, TypeVar

import msgspec
import numpy as np
from msgspec import inspect

from fgnav.checks import BadInputError

Positive: TypeAlias = Annotated[float, msgspec.Meta(gt=0)]
NotNegative: TypeAlias = Annotated[float, msgspec.Meta(ge=0)]
Vector: TypeAlias = tuple[float, float, float]
T = TypeVar("T")

_AT = re.compile(r" - at `\$\.?(?P<key>[^`]*)`$")
_STEP = re.compile(r"\[(\d+)\]|([^.\[\]]+)")


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of all tables of a scenario: immutable, strict about its keys."""


def read_table(path: Path, table: type[T]) -> T:
    """Return the file's content as an instance of ``table``, a subclass of ``Table``.

    Raises
    ------
    BadInputError
        If the file cannot be read, is not TOML, has a key nobody knows (the text names the nearest
        known one) or a value that breaks the rule of its key.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadInputError(f"{path}: not a TOML file: {error}") from None
    try:
        _check_keys("", data, inspect.type_info(table))
        return msgspec.convert(data, table)
    except msgspec.ValidationError as error:
        raise BadInputError(f"{path}: {_explained(str(error), data)}") from None
    except BadInputError as error:
        raise BadInputError(f"{path}: {error}") from None


def _check_keys(where: str, value: object, info: inspect.Type) -> None:
    """Raise at the first key that its table does not have, or number that is not finite."""
    if isinstance(value, float) and not np.isfinite(value):
        raise BadInputError(f"{where}: must be finite, got {value}")
    if isinstance(value, list):
        for row, item in enumerate(value):
            _check_keys(f"{where}[{row}]", item, inspect.AnyType())
    if not isinstance(value, Mapping):
        return
    known = _known(where, value, info)
    for key, inner in value.items():
        here = f"{where}.{key}".lstrip(".")
        if known and key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.0)[0]
            raise BadInputError(f"{here}: unknown key; the nearest known one is {near!r}")
        _check_keys(here, inner, known.get(key, inspect.AnyType()))


def _known(where: str, value: Mapping[str, object], info: inspect.Type) -> dict[str, inspect.Type]:
    """Return the keys of the table that ``value`` means; none where any key will do."""
    options = info.types if isinstance(info, inspect.UnionType) else (info,)
    structs = [option for option in options if isinstance(option, inspect.StructType)]
    if not structs:
        return {}
    tag = structs[0].tag_field
    if tag is not None:
        by_tag = {str(struct.tag): struct for struct in structs}
        if value.get(tag) not in by_tag:
            got = repr(value[tag]) if tag in value else "nothing"
            raise BadInputError(f"{where}.{tag}: must be one of {', '.join(by_tag)}, got {got}")
        structs = [by_tag[str(value[tag])]]
    known = {field.encode_name: field.type for field in structs[0].fields}
    return known if tag is None else {tag: inspect.AnyType(), **known}


def _explained(text: str, data: object) -> str:
    """Return msgspec's sentence with the key first and the offending value last."""
    found = _AT.search(text)
    if not found:
        return text
    key, rule = found["key"], text[: found.start()].replace("`", "")
    value: Any = data
    for index, name in _STEP.findall(key):
        value = value[int(index)] if index else value[name]
    return f"{key}: {rule[0].lower() + rule[1:]}, got {value!r}"
