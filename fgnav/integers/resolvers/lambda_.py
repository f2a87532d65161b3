"""Integers by LAMBDA: exact integer least squares of an epoch's float solution."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.integers.acceptance import WITHOUT_CODE, not_fixed, phase_links, ratio
from fgnav.integers.ils.affine import ILL, WEAK, search_array
from fgnav.integers.ils.search import OK, UNFINISHED
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers


@dataclass(frozen=True, slots=True, kw_only=True)
class Lambda:
    """Integer least squares, one epoch at a time.

    Attributes
    ----------
    joint : bool
        All baselines of an epoch together, under the affine model of the array that its antennas
        span; otherwise every baseline on its own. The two agree for one baseline.
    ratio_min : float or None
        The ratio test: a search whose second-best squared norm is less than this times its best is
        not accepted. None accepts every search. Passing is no proof: of single-frequency epochs of
        two real antennas above 25 degrees of elevation, 8 of 12 that pass at 3 are wrong.
    success_min : float or None
        Least success rate, by the stated noise, of what is fixed: of an epoch's integers after
        decorrelation, as many as reach it are searched, and the links that these determine are
        fixed; the others stay float. None fixes all or nothing.
    """

    name: ClassVar[str] = "lambda"
    looks_ahead: ClassVar[bool] = False
    joint: bool = True
    ratio_min: float | None = None
    success_min: float | None = None

    def __post_init__(self) -> None:
        """Reject thresholds that accept everything or nothing."""
        if self.ratio_min is not None and not (np.isfinite(self.ratio_min) and self.ratio_min >= 1):
            raise BadInputError(f"ratio_min: must be 1 or more, or None, got {self.ratio_min}")
        if self.success_min is not None and not 0.0 < self.success_min < 1.0:
            raise BadInputError(
                f"success_min: must be between 0 and 1, or None, got {self.success_min}"
            )

    def __call__(self, differences: DoubleDifferences, flight: Flight) -> Integers:  # noqa: ARG002
        """Resolve every link with code and phase, where the epoch's code determines the array."""
        result = search_array(differences, joint=self.joint, success_min=self.success_min or 0.0)
        ratios = ratio(result.squared_norms)
        accepted = result.status == OK
        links, status = differences.resolvable, result.status[:, :, None]
        reasons = {
            WITHOUT_CODE: phase_links(differences) & ~links,
            "too few satellites, or badly placed ones, for a float solution": links
            & (status == WEAK),
            "integer search given up: float solution too vague": links & (status == UNFINISHED),
            "covariance of the float solution is not positive definite": links & (status == ILL),
        }
        if self.success_min is not None:
            vague = f"too vague for a success rate of {self.success_min:g}"
            reasons[vague] = links & accepted[:, :, None] & ~result.fixed
        if self.ratio_min is not None:
            failed = accepted & ~(ratios >= self.ratio_min)
            reasons[f"ratio below {self.ratio_min:g}"] = result.fixed & failed[:, :, None]
            accepted = accepted & ~failed
        fixed = result.fixed & accepted[:, :, None]
        return Integers(
            resolver=self.name,
            cycles=np.where(fixed, result.cycles, 0),
            fixed=fixed,
            ratio=np.where(result.fixed.any(axis=2), ratios, np.nan),
            wrong_probability=self._wrong(result.success),
            unused=not_fixed(reasons),
        )

    def _wrong(self, success: FloatArray) -> FloatArray:
        """Return the chance, (n,), that an epoch's integers are not all right; at most that."""
        resolved = np.isfinite(success)
        rate = np.where(resolved, success, 1.0)
        chance = rate.min(axis=1, initial=1.0) if self.joint else rate.prod(axis=1)
        return np.where(resolved.any(axis=1), 1.0 - chance, 1.0)
