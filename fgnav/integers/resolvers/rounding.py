"""Integers by rounding code minus phase: the baseline every better resolver must beat."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fgnav.integers.acceptance import WITHOUT_CODE, not_fixed, phase_links
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers


@dataclass(frozen=True, slots=True, kw_only=True)
class Rounding:
    """Round phase minus code of every double difference on its own."""

    name: ClassVar[str] = "rounding"
    looks_ahead: ClassVar[bool] = False

    def __call__(self, differences: DoubleDifferences, flight: Flight) -> Integers:  # noqa: ARG002
        """Resolve every link that has code and phase."""
        fixed = differences.resolvable
        ambiguity = (differences.phase_m - differences.code_m) / differences.wavelength_m
        return Integers(
            resolver=self.name,
            cycles=np.rint(np.where(fixed, ambiguity, 0.0)).astype(np.int64),
            fixed=fixed,
            ratio=np.full(fixed.shape[:2], np.nan),
            unused=not_fixed({WITHOUT_CODE: phase_links(differences) & ~fixed}),
        )
