"""TOML files as typed tables; what does not fit is one line: file, key, rule, value, the mend."""

import re
import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, TypeAlias, TypeVar

import msgspec
import numpy as np
from msgspec import inspect

from fgnav.checks import BadInputError
from fgnav.io.rinex_text import read_bytes

Positive: TypeAlias = Annotated[float, msgspec.Meta(gt=0)]
NotNegative: TypeAlias = Annotated[float, msgspec.Meta(ge=0)]
Vector: TypeAlias = tuple[float, float, float]
T = TypeVar("T")

_AT = re.compile(r" - at `\$\.?(?P<key>[^`]*)`$")
_STEP = re.compile(r"\[(\d+)\]|([^.\[\]]+)")
_OWN_RULE = re.compile(r"([\w.\[\]]+): (.*)")
_MISSING = re.compile(r"object missing required field (.*)", re.IGNORECASE)


class Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of all tables: immutable, strict about its keys."""


def read_toml(path: Path) -> dict[str, Any]:
    """Return the plain content of a TOML file.

    Raises
    ------
    BadInputError
        If the file cannot be read or is not TOML.
    """
    try:
        return tomllib.loads(read_bytes(path).decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadInputError(f"{path}: must be TOML, {error}") from None


def as_table(path: Path, content: Mapping[str, Any], table: type[T]) -> T:
    """Return plain content as an instance of ``table``, a subclass of ``Table``.

    Raises
    ------
    BadInputError
        At the first key that nobody knows (the text names the nearest known one), number that is
        not finite, or value that breaks the rule of its key.
    """
    try:
        _check_keys("", content, inspect.type_info(table))
        return msgspec.convert(content, table)
    except msgspec.ValidationError as error:
        raise BadInputError(f"{path}: key {_explained(str(error), content)}") from None
    except BadInputError as error:
        raise BadInputError(f"{path}: key {error}") from None


def _check_keys(where: str, value: object, info: inspect.Type) -> None:
    """Raise at the first key that its table does not have, or number that is not finite."""
    if isinstance(value, float) and not np.isfinite(value):
        raise BadInputError(f"{where}: must be finite, got {value}")
    if isinstance(value, list):
        item: inspect.Type = inspect.AnyType()
        if isinstance(info, inspect.ListType | inspect.VarTupleType):
            item = info.item_type
        for row, inner in enumerate(value):
            _check_keys(f"{where}[{row}]", inner, item)
    if not isinstance(value, Mapping):
        return
    known = _known(where, value, info)
    for key, inner in value.items():
        here = f"{where}.{key}".lstrip(".")
        if known and key not in known:
            near = f"{where}.{get_close_matches(key, known, n=1, cutoff=0.0)[0]}".lstrip(".")
            raise BadInputError(f"{here}: unknown; the nearest known key is {near}")
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


def _explained(text: str, content: object) -> str:
    """Return msgspec's sentence with the key first and the offending value last."""
    found = _AT.search(text)
    key, rule = (found["key"], text[: found.start()]) if found else ("", text)
    rule = rule.replace("`", "")
    missing = _MISSING.fullmatch(rule)
    if missing:
        return f"{key or 'top level'}: {missing[1]!r} is missing; add it"
    own = _OWN_RULE.fullmatch(rule)
    if own:  # a table's own check of its keys together
        return f"{key}.{own[1]}: {own[2]}".lstrip(".")
    value: Any = content
    for index, name in _STEP.findall(key):
        value = value[int(index)] if index else value[name]
    rule = rule.replace("Expected ", "must be ").replace("Invalid", "invalid")
    return f"{key}: {rule}, got {value!r}"
