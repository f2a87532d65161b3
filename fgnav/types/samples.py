"""Records of sensors: fields with a row for each of their times, cut and joined alike."""

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar, Self

import numpy as np

from fgnav.checks import BoolArray, FloatArray


class Samples:
    """A record with a row for each of its times.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
    columns : tuple of str
        Fields that have k rows, ``t_s`` among them; such a field may be None.
    """

    __slots__ = ()
    columns: ClassVar[tuple[str, ...]]
    t_s: FloatArray

    def __getitem__(self, rows: slice | BoolArray) -> Self:
        """Return some of the samples."""
        values = {name: getattr(self, name) for name in self.columns}
        kept = {name: value[rows] for name, value in values.items() if value is not None}
        return replace(self, **kept)  # type: ignore[type-var]  # all records are dataclasses


def joined(parts: Sequence[Samples]) -> Samples:
    """Return records of one sensor, one after the other."""
    values = {name: [getattr(one, name) for one in parts] for name in parts[0].columns}
    rows = {name: np.concatenate(of) for name, of in values.items() if of[0] is not None}
    return replace(parts[0], **rows)  # type: ignore[type-var]  # all records are dataclasses
