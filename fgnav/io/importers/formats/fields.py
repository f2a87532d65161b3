"""Tables of a flight out of the fields of messages.

An importer of messages is a layout, ``Fields`` by the name of the message, and what is peculiar to
its format.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from fgnav.checks import FloatArray
from fgnav.io.flight.columns import NEEDS, Samples, samples

Names: TypeAlias = tuple[str, ...]
Counts: TypeAlias = Counter[tuple[str, str]]  # of what is not used, by what and reason
Message: TypeAlias = Mapping[str, Any]  # arrays, (k,), by the names of fields; times in ``t_s``
Block: TypeAlias = tuple[Names, FloatArray, FloatArray]  # columns, times (k,), values (k, c)


class Fields(NamedTuple):
    """Fields of a message that are columns of a table, and their unit in those."""

    table: str
    columns: Names
    names: Names
    unit: float | tuple[float, ...] = 1.0
    is_variance: bool = False  # whether the fields are squares of the columns

    def values(self, message: Message) -> FloatArray:
        """Return (k, c) values of the columns; NaN of a variance that is not positive."""
        values = np.stack([np.asarray(message[name], np.float64) for name in self.names], axis=1)
        if self.is_variance:
            values = np.sqrt(np.where(values > 0, values, np.nan))
        return np.asarray(values * self.unit)


Layout: TypeAlias = Mapping[str, Sequence[Fields]]


def xyz(pattern: str, axes: Sequence[object] = (0, 1, 2)) -> Names:
    """Return the names of three fields: ``gyro_rad[0]`` and so on."""
    return tuple(pattern.format(axis) for axis in axes)


def tables_of(
    messages: Mapping[str, Message], layout: Layout, counts: Counts
) -> dict[str, Samples]:
    """Return the tables of messages, by kind; of each the first message gives the times."""
    blocks = defaultdict[str, list[Block]](list)
    for name, some in layout.items():
        for fields in some if name in messages else ():
            values = fields.values(messages[name])
            blocks[fields.table].append((fields.columns, messages[name]["t_s"], values))
    return {kind: join_blocks(kind, some, counts) for kind, some in blocks.items()}


def join_blocks(kind: str, blocks: Sequence[Block], counts: Counts) -> Samples:
    """Return the rows of the first block with those of the others that most rows have.

    Rows that lack what most have are left out. These, and what others have besides, are counted.
    """
    names, t_s, values = blocks[0]
    table, kept = {names: values}, np.ones(len(t_s), np.bool_)
    for columns, times_s, others in blocks[1:]:
        block = _at_times(t_s, times_s, others)
        has = np.isfinite(block).all(axis=1)
        counts[columns[0], f"of no time of {kind}"] += int((~np.isin(times_s, t_s)).sum())
        if 2 * has.sum() > len(t_s) and NEEDS.get(columns, names) in table:
            counts[f"{kind} row", f"has no {columns[0]}, as most have"] += int((kept & ~has).sum())
            kept &= has
            table[columns] = block
        else:
            counts[columns[0], f"of {kind}, most of which have none"] += int(has.sum())
    return samples(t_s[kept], *((columns, block[kept]) for columns, block in table.items()))


def _at_times(t_s: FloatArray, times_s: FloatArray, values: FloatArray) -> FloatArray:
    """Return values, (k, c), at equal times, the first of each; NaN where there is none."""
    if times_s is t_s:
        return values
    if not len(times_s):
        return np.full((len(t_s), values.shape[1]), np.nan)
    times_s, first = np.unique(times_s, return_index=True)
    index = np.searchsorted(times_s, t_s).clip(max=len(times_s) - 1)
    is_equal = (times_s[index] == t_s)[:, None]
    return np.where(is_equal, values[first[index]], np.nan)
