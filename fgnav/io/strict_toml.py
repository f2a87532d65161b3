"""TOML files as typed tables; what does not fit is one line: file, key, rule, value, the mend."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, TypeAlias, TypeVar

import msgspec
import numpy as np
from msgspec import inspect

from fgnav.checks import BadInputError, quoted
from fgnav.io.user_files import read_bytes

Positive: TypeAlias = Annotated[float, msgspec.Meta(gt=0)]
NotNegative: TypeAlias = Annotated[float, msgspec.Meta(ge=0)]
Vector: TypeAlias = tuple[float, float, float]
T = TypeVar("T")

_MOST_BYTES = 4_000_000  # a flight, a scenario or a recipe is written by hand: theirs have 20 kB
_LEAST = 1e-30  # its inverse, squared and squared again, is still a number
_LARGEST_INTEGER = 2**63  # TOML 1.0: what does not fit into 64 bits is an error
_AT = re.compile(r" - at `\$\.?(?P<key>[^`]*)`$")
_STEP = re.compile(r"\[(\d+)\]|([^.\[\]]+)")
_OWN_RULE = re.compile(r"([\w.\[\]]+): (.*)")
_MISSING = re.compile(r"object missing required field (.*)", re.IGNORECASE)


class Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of all tables: immutable, strict about its keys."""


def read_toml(path: Path) -> dict[str, Any]:
    """Return the plain content of a TOML file."""
    try:
        return tomllib.loads(read_bytes(path, _MOST_BYTES).decode("utf-8-sig"))
    except (RecursionError, ValueError) as error:  # not TOML, not UTF-8, no number, too deep
        if isinstance(error, BadInputError):
            raise
        raise BadInputError(f"{path}: must be TOML, {error!s:.200}") from None


def read_toml_or_json(path: Path) -> dict[str, Any]:
    """Return the plain content of a TOML file, or of JSON where its name ends so."""
    if path.suffix != ".json":
        return read_toml(path)
    try:
        content = msgspec.json.decode(read_bytes(path, _MOST_BYTES))
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadInputError(f"{path}: must be JSON, {error!s:.200}") from None
    if not isinstance(content, dict):
        raise BadInputError(f"{path}: must be a JSON object, got {type(content).__name__}")
    return content


def as_table(path: Path, content: Mapping[str, Any], table: type[T]) -> T:
    """Return plain content as an instance of ``table``, a subclass of ``Table``."""
    try:
        _check_keys("", content, inspect.type_info(table))
        return msgspec.convert(content, table)
    except msgspec.ValidationError as error:
        raise BadInputError(f"{path}: key {_explained(str(error), content)}") from None
    except BadInputError as error:
        raise BadInputError(f"{path}: key {error}") from None


def _fault(value: object, info: inspect.Type) -> str:
    """Return the rule that a value breaks, whatever its key; nothing of one that may be."""
    if isinstance(value, int) and not -_LARGEST_INTEGER <= value < _LARGEST_INTEGER:
        return "must be a number of 64 bits"
    if isinstance(value, float) and not np.isfinite(value):
        return f"must be finite, got {value}"
    if isinstance(value, float) and value and not _LEAST <= abs(value) <= 1 / _LEAST:
        return f"must be 0, or in size between {_LEAST:g} and {1 / _LEAST:g}, got {value}"
    if isinstance(value, str) and "\0" in value:
        return f"must not hold NUL, got {quoted(value)}"
    options = _options(info)
    words = [str(word) for x in options if isinstance(x, inspect.LiteralType) for word in x.values]
    is_free = not words or any(isinstance(option, inspect.StrType) for option in options)
    if isinstance(value, str) and value not in words and not is_free:
        return f"must be {' or '.join(words)}, got {quoted(value)}"
    return ""


def _options(info: inspect.Type) -> Sequence[inspect.Type]:
    return info.types if isinstance(info, inspect.UnionType) else (info,)


def _check_keys(where: str, value: object, info: inspect.Type) -> None:
    """Raise at the first key that its table does not have, or value that breaks a rule."""
    if fault := _fault(value, info):
        raise BadInputError(f"{where}: {fault}")
    if isinstance(value, list):
        item: inspect.Type = inspect.AnyType()
        if isinstance(info, inspect.ListType | inspect.VarTupleType):
            item = info.item_type
        for number, inner in enumerate(value):
            _check_keys(f"{where}[{number}]", inner, item)
    if not isinstance(value, Mapping):
        return
    allowed = _known(where, value, info)
    for key, inner in value.items():
        here = f"{where}.{quoted(key)[1:-1]}".lstrip(".")
        if allowed and key not in allowed:
            near = f"{where}.{get_close_matches(key, allowed, n=1, cutoff=0.0)[0]}".lstrip(".")
            raise BadInputError(f"{here}: unknown; the nearest known key is {near}")
        _check_keys(here, inner, allowed.get(key, inspect.AnyType()))


def _known(where: str, value: Mapping[str, object], info: inspect.Type) -> dict[str, inspect.Type]:
    """Return the keys of the table that ``value`` means; none where any key will do."""
    structs = [option for option in _options(info) if isinstance(option, inspect.StructType)]
    if not structs:
        return {}
    tag = structs[0].tag_field
    if tag is not None:
        by_tag = {str(struct.tag): struct for struct in structs}
        if value.get(tag) not in by_tag:
            got = quoted(value[tag]) if tag in value else "nothing"
            raise BadInputError(f"{where}.{tag}: must be one of {', '.join(by_tag)}, got {got}")
        structs = [by_tag[str(value[tag])]]
    allowed = {field.encode_name: field.type for field in structs[0].fields}
    return allowed if tag is None else {tag: inspect.AnyType(), **allowed}


def _explained(text: str, content: object) -> str:
    """Return msgspec's sentence with the key first and the offending value last."""
    match = _AT.search(text)
    key, rule = (match["key"], text[: match.start()]) if match else ("", text)
    rule = rule.replace("`", "")
    missing = _MISSING.fullmatch(rule)
    if missing:
        return f"{key or 'top level'}: {missing[1]!r} is missing; add it"
    rule_match = _OWN_RULE.fullmatch(rule)
    if rule_match:  # a table's own check of its keys together
        return f"{key}.{rule_match[1]}: {rule_match[2]}".lstrip(".")
    value: Any = content
    for index, name in _STEP.findall(key):
        value = value[int(index)] if index else value[name]
    rule = rule.replace("Expected ", "must be ").replace("Invalid", "invalid")
    return f"{key}: {rule:.120}, got {quoted(value)}"
