"""Tables of ``flight.toml``, in degrees, and records, in radians, by the names of their fields."""

from dataclasses import fields
from typing import Any, TypeVar

import msgspec
import numpy as np

_T = TypeVar("_T", bound=msgspec.Struct)


def values_of(table: object, record: type[Any]) -> dict[str, Any]:
    """Return the values of a table that a record has fields for, as arrays and in radians."""
    values = {}
    for name in (field.name for field in fields(record)):
        degrees = f"{name.removesuffix('_rad')}_deg"
        if hasattr(table, name):
            value = getattr(table, name)
            values[name] = np.array(value) if isinstance(value, tuple) else value
        elif name.endswith("_rad") and hasattr(table, degrees):
            angle = getattr(table, degrees)
            values[name] = None if angle is None else float(np.radians(angle))
    return values


def table_of(table: type[_T], record: object, **others: Any) -> _T:  # noqa: ANN401  # values of keys
    """Return a table with others' values, and those that a record has; none of usual figures."""
    values: dict[str, Any] = {}
    for name in table.__struct_fields__:
        radians = f"{name.removesuffix('_deg')}_rad"
        if hasattr(record, name) and name not in getattr(record, "unstated", ()):
            value = getattr(record, name)
            values[name] = tuple(value.tolist()) if isinstance(value, np.ndarray) else value
        elif name.endswith("_deg") and getattr(record, radians, None) is not None:
            values[name] = float(np.degrees(getattr(record, radians)))
    return table(**(values | others))
