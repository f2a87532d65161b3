"""Attitudes of single epochs, and the same at keyframes."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fgnav.alignment.in_motion.windows import EarlierMotion
from fgnav.attitude.imu_rotation import ImuRotation, despun
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BoolArray, FloatArray, IntArray, Unused
from fgnav.types.differences import DoubleDifferences
from fgnav.types.estimate import Rejected
from fgnav.types.integers import Integers

_BY_EPOCH = ("R_nb", "covariance_rad2", "valid", "refused")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Alignment:
    """Attitudes at the flight's GNSS epochs, each from that epoch alone."""

    t_s: FloatArray  # (n,)
    R_nb: FloatArray  # (n, 3, 3)
    covariance_rad2: FloatArray  # (n, 3, 3)
    # Whether the epoch has an attitude that its own residuals do not contradict.
    valid: BoolArray  # (n,)
    refused: BoolArray  # (n,): epochs whose array phases contradict each other
    form: RotationQuadratic | None = None  # of the array's phases; None without an array
    integers: Integers | None = None
    unused: tuple[Unused, ...] = ()
    rejections: tuple[Rejected, ...] = ()
    notes: tuple[str, ...] = ()  # among them the gaps
    # Angles that neither the array nor another vector determines.
    unobservable: tuple[str, ...] = ()
    rough: bool = False  # whether the covariance is a guess
    # The array's own, and what of them its form is of, without integers, whatever the epochs.
    phases: tuple[DoubleDifferences, FloatArray] | None = None
    # How the body turns by its gyroscope, or spins without an array.
    rotation: ImuRotation | None = None
    gyroscope_bias_b_radps: FloatArray | None = None  # (3,): where the search for it starts
    # When information about heading begins, and when it is enough.
    heading_from_s: float = -np.inf
    heading_known_s: float = -np.inf
    motion: EarlierMotion | None = None  # of attitudes that a gyroscope carries, for those to come

    @property
    def R_nu(self) -> FloatArray:
        """Attitudes of axes that do not spin, (n, 3, 3)."""
        return despun(self.rotation, self.t_s, self.R_nb)

    def epochs_of(self, t_s: FloatArray) -> IntArray:
        """Find the index of each keyframe among times (m,): (n,), -1 where there is none."""
        row = np.searchsorted(self.t_s, t_s).clip(max=len(self.t_s) - 1)
        same = np.flatnonzero(self.t_s[row] == t_s)
        epoch = np.full(len(self.t_s), -1, dtype=np.int64)
        epoch[row[same]] = same
        return epoch

    def __getitem__(self, rows: IntArray) -> "Alignment":
        """Select epochs, in their order."""
        if len(rows) == len(self.t_s):
            return self
        columns: dict[str, Any] = {name: getattr(self, name)[rows] for name in _BY_EPOCH}
        form = None if self.form is None else self.form[rows]
        return replace(self, t_s=self.t_s[rows], form=form, **columns)

    def with_rows(self, rows: IntArray, part: "Alignment") -> "Alignment":
        """Return the alignment, that of some epochs, (k,), replaced."""
        columns: dict[str, Any] = {name: getattr(self, name).copy() for name in _BY_EPOCH}
        for name, column in columns.items():
            column[rows] = getattr(part, name)
        form = self.form
        if form is not None and part.form is not None:
            form = form.with_rows(rows, part.form)
        return replace(self, form=form, **columns)


def at_keyframes(start: Alignment, t_s: FloatArray) -> Alignment:
    """Return an alignment at keyframes, (n,), among them all its epochs; the others have none."""
    n = len(t_s)
    if n == len(start.t_s):
        return start
    none, form = np.zeros(n, dtype=np.bool_), start.form
    if form is not None:
        open_form = np.zeros((n, 9, 9)), np.zeros((n, 9)), np.zeros(n), np.zeros(n, dtype=np.int64)
        form = RotationQuadratic(*open_form)
    unaligned = replace(
        start,
        t_s=t_s,
        R_nb=np.tile(np.eye(3), (n, 1, 1)),
        covariance_rad2=np.zeros((n, 3, 3)),
        valid=none,
        refused=none,
        form=form,
    )
    return unaligned.with_rows(np.searchsorted(t_s, start.t_s), start)
