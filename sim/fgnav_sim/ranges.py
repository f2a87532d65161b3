"""Counts, and ranges that figures are drawn from: two of them in order."""

from collections.abc import Callable
from typing import Annotated, TypeAlias

import msgspec
import numpy as np

from fgnav.io.strict_toml import Table

Count: TypeAlias = Annotated[int, msgspec.Meta(ge=1)]
Range: TypeAlias = tuple[float, float]
Draw: TypeAlias = Callable[[Range], float]


def check_ranges(table: Table, *names: str, zero: bool = False) -> None:
    """Raise unless figures of a table, or the ends of ranges in order, are above zero.

    With ``zero`` they may also be zero.
    """
    for name in names:
        value = getattr(table, name)
        ends = value if isinstance(value, tuple) else (value, value)
        if len(ends) != 2 or not 0 <= ends[0] <= ends[1] or not (zero or ends[0]):
            lowest = "zero or more" if zero else "above zero"
            raise ValueError(f"{name}: must be {lowest}, and a range in order, got {value}")


def uniform(rng: np.random.Generator) -> Draw:
    """Return the function that draws uniformly from ranges."""
    return lambda limits: float(rng.uniform(*limits))


def log_uniform(limits: Range, rng: np.random.Generator) -> float:
    """Return a figure whose logarithm is uniform over a range."""
    return float(np.exp(rng.uniform(*np.log(limits))))
