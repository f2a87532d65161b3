"""Columns of a flight as parts of messages, and one table of what several state at the same times.

An importer of messages is a table of ``Part`` and what is peculiar to its format.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from fgnav.checks import FloatArray
from fgnav.io.flight.columns import NEEDS, Samples, samples

Names: TypeAlias = tuple[str, ...]
Timed: TypeAlias = tuple[Names, FloatArray, FloatArray]  # columns, times (k,), values (k, c)


class Part(NamedTuple):
    """Columns of a table, the fields that they are, and their unit in the table's."""

    columns: Names
    fields: Names
    unit: float | tuple[float, ...] = 1.0
    is_variance: bool = False  # whether the fields are squares of the columns

    def of(self, messages: Mapping[str, Any]) -> FloatArray:
        """Return (k, c) values of messages whose fields are arrays, (k,)."""
        values = np.stack([np.asarray(messages[one], np.float64) for one in self.fields], axis=1)
        return np.asarray((np.sqrt(values) if self.is_variance else values) * self.unit)


def xyz(pattern: str, axes: Sequence[object] = (0, 1, 2)) -> Names:
    """Return the names of three fields: ``gyro_rad[0]`` and so on."""
    return tuple(pattern.format(axis) for axis in axes)


def table_of(messages: Mapping[str, Any], t_s: FloatArray, parts: Sequence[Part]) -> Samples:
    """Return a table of messages whose fields are arrays, (k,)."""
    return samples(t_s, *((part.columns, part.of(messages)) for part in parts))


def joined(
    what: str, first: Timed, others: Sequence[Timed], counts: Counter[tuple[str, str]]
) -> Samples:
    """Return the rows of a table with those columns of others that most of them have.

    Rows that lack what most have are left out. These, and what others have besides, are counted.

    Parameters
    ----------
    what : str
        What a row is.
    first, others : tuple
        Names of columns, times and values; of equal times the first counts.
    """
    names, t_s, x = first
    t_s, index = np.unique(t_s, return_index=True)
    counts[what, "another of its time goes before"] += len(x) - len(t_s)
    blocks, kept = {names: x[index]}, np.ones(len(t_s), np.bool_)
    for columns, times_s, values in others:
        if not len(times_s):
            continue
        at_s, index = np.unique(times_s, return_index=True)
        row = np.searchsorted(at_s, t_s).clip(max=len(at_s) - 1)
        has = at_s[row] == t_s
        counts[columns[0], f"of no {what}'s time"] += len(at_s) - int(has.sum())
        if 2 * has.sum() > len(t_s) and NEEDS.get(columns, names) in blocks:
            counts[what, f"has no {columns[0]}, as most have"] += int((kept & ~has).sum())
            kept &= has
            blocks[columns] = values[index][row]
        else:
            counts[columns[0], f"of a {what}; most have none"] += int(has.sum())
    return samples(t_s[kept], *((columns, block[kept]) for columns, block in blocks.items()))
