"""Monte Carlo: which keys of a scenario are drawn anew for every flight, and by how much."""

import zlib
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from datetime import datetime
from difflib import get_close_matches
from typing import Any, Literal, TypeAlias, TypeVar

import msgspec
import numpy as np

from fgnav.checks import BadInputError, FloatArray

Numbers: TypeAlias = float | tuple[float, ...]
_Tables = TypeVar("_Tables", bound=msgspec.Struct)
_NOT_DRAWN = ("dispersions", "duration_s")  # flights of a batch are of one length


class Spread(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Distribution of a value; just a number is ``{ sigma = number }``.

    One figure moves a whole list by one draw, as thrust or a coefficient errs for all times or
    Mach numbers together; a list of figures moves each element by a draw of its own.
    """

    sigma: Numbers | None = None  # standard deviation in the key's unit
    # standard deviation as a share of the value, in place of ``sigma``
    relative: Numbers | None = None
    # with "uniform" the figure is the greatest deviation
    law: Literal["normal", "uniform"] = "normal"

    def __post_init__(self) -> None:
        """Require one figure that spreads."""
        if (self.sigma is None) == (self.relative is None):
            raise ValueError("must have one of sigma and relative")
        if not (np.isfinite(self.figure).all() and (self.figure >= 0).all() and self.figure.any()):
            raise ValueError("must be finite, not negative, and not all zero")

    @property
    def figure(self) -> FloatArray:
        """The one given of both, () or (k,)."""
        return np.asarray(self.relative if self.sigma is None else self.sigma, dtype=float)


@dataclass(frozen=True, slots=True, kw_only=True)
class Draw:
    """Value of a key in one flight."""

    key: str
    nominal: Numbers
    value: Numbers


def check_spreads(tables: msgspec.Struct, spreads: Mapping[str, Any]) -> None:
    """Raise unless every key to be drawn is a number, or a list of them, that the tables hold.

    Raises
    ------
    BadInputError
        Naming the key, and the nearest one that could be meant.
    """
    content = _content(tables)
    for key, spread in _flat("", spreads):
        _values(content, key, spread)


def disperse(
    tables: _Tables, spreads: Mapping[str, Any], rng: np.random.Generator
) -> tuple[_Tables, tuple[Draw, ...]]:
    """Return tables with values drawn about those they have, and what was drawn.

    Each key draws from a generator of its own: a spread that is added leaves the others as they
    were.

    Parameters
    ----------
    tables : Struct
        A scenario.
    spreads : mapping
        By dotted key, nested or not, what ``Spread`` says.

    Raises
    ------
    BadInputError
        As ``check_spreads``, or if a value that was drawn breaks its key's rule.
    """
    wanted = list(_flat("", spreads))
    if not wanted:
        return tables, ()
    seed, content, draws = int(rng.integers(2**63)), _content(tables), []
    for key, spread in wanted:
        nominal = _values(content, key, spread)
        key_rng = np.random.default_rng([seed, zlib.crc32(key.encode())])
        size = spread.figure.shape
        deviate = (
            key_rng.standard_normal(size)
            if spread.law == "normal"
            else key_rng.uniform(-1.0, 1.0, size)
        )
        scale = nominal if spread.sigma is None else 1.0
        value = nominal + scale * spread.figure * deviate
        draws.append(Draw(key=key, nominal=_plain(nominal), value=_plain(value)))
    values = {draw.key: draw.value for draw in draws}
    return with_values(
        tables, values, "dispersions: a draw breaks a rule, take smaller spreads"
    ), tuple(draws)


def with_values(tables: _Tables, values: Mapping[str, Any], what: str) -> _Tables:
    """Return tables with other values under some dotted keys.

    Raises
    ------
    BadInputError
        If a table on the way is not there, a key is unknown, or a value breaks its rule: what it is
        of, and the key.
    """
    content = _content(tables)
    for key, value in values.items():
        *path, name = key.split(".")
        node: Any = content
        for table in path:
            node = node.get(table) if isinstance(node, dict) else None
        if not isinstance(node, dict):
            raise BadInputError(f"{what}.{key}: the scenario has no table {'.'.join(path)}")
        if name not in node:
            near = get_close_matches(name, node, n=1, cutoff=0.0)
            meant = f"; the nearest known key is {'.'.join([*path, *near])}" if near else ""
            raise BadInputError(f"{what}.{key}: unknown{meant}")
        node[name] = deepcopy(value)  # later keys may change a part of it
    try:
        return msgspec.convert(content, type(tables))
    except msgspec.ValidationError as error:
        raise BadInputError(f"{what}: {error}") from None


def _content(tables: msgspec.Struct) -> dict[str, Any]:
    """Return tables as plain dictionaries."""
    content: dict[str, Any] = msgspec.to_builtins(tables, builtin_types=(datetime,))
    return content


def _flat(where: str, spreads: Mapping[str, Any]) -> Iterator[tuple[str, Spread]]:
    """Yield dotted keys and their spreads, whether the file nests the keys or quotes them."""
    for name, inner in spreads.items():
        key = f"{where}.{name}".lstrip(".")
        if isinstance(inner, Mapping) and not inner.keys() & set(Spread.__struct_fields__):
            yield from _flat(key, inner)
            continue
        try:
            plain = inner if isinstance(inner, Mapping) else {"sigma": inner}
            yield key, msgspec.convert(plain, Spread)
        except msgspec.ValidationError as error:
            raise BadInputError(f"dispersions.{key}: {error}, got {inner!r}") from None


def _values(content: Mapping[str, Any], key: str, spread: Spread) -> FloatArray:
    """Return the values that a spread moves, () or (k,)."""
    leaves = dict(_leaves("", content))
    if key not in leaves:
        near = get_close_matches(key, leaves, n=1, cutoff=0.0)[0]
        raise BadInputError(f"dispersions.{key}: unknown; the nearest known key is {near}")
    if leaves[key] is None:
        raise BadInputError(f"dispersions.{key}: has no value to be drawn about; give it one")
    values = np.asarray(leaves[key], dtype=float)
    if spread.figure.ndim and spread.figure.shape != values.shape:
        raise BadInputError(
            f"dispersions.{key}: must hold a figure, or one for each of {values.size} values, "
            f"got {spread.figure.size}"
        )
    if spread.sigma is None and not values.any():
        raise BadInputError(f"dispersions.{key}: is zero, of which no share moves; give sigma")
    return values


def _leaves(where: str, content: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield dotted keys of numbers, of lists of numbers, and of what has no value."""
    for name, inner in content.items():
        key = f"{where}.{name}".lstrip(".")
        if key in _NOT_DRAWN:
            continue
        if isinstance(inner, Mapping):
            yield from _leaves(key, inner)
        elif inner is None or _are_numbers(inner if isinstance(inner, list | tuple) else [inner]):
            yield key, inner


def _are_numbers(values: Sequence[object]) -> bool:
    numbers = [isinstance(v, int | float) and not isinstance(v, bool) for v in values]
    return bool(numbers) and all(numbers)


def _plain(values: FloatArray) -> Numbers:
    """Return an array as a number, or as a tuple of them."""
    return tuple(values.tolist()) if values.ndim else float(values)
