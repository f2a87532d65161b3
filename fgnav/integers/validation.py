"""What is accepted of a search, and the account of what is not."""

from collections.abc import Mapping

import numpy as np

from fgnav.checks import BoolArray, FloatArray, Loss
from fgnav.gnss.differences import DoubleDifferences

WITHOUT_CODE = "phase without code"

_SMALLEST_NORM = 1e-30  # noise-free data can hit the float solution exactly: the ratio stays finite


def ratio(squared_norms: FloatArray) -> FloatArray:
    """Return second-best over best squared norm, (n, b), of (n, b, 2); NaN stays NaN."""
    return np.asarray(squared_norms[..., 1] / np.maximum(squared_norms[..., 0], _SMALLEST_NORM))


def not_fixed(links: Mapping[str, BoolArray]) -> tuple[Loss, ...]:
    """Return one loss for each reason that holds of any link, (n, b, m)."""
    return tuple(
        Loss(what="double difference", reason=reason, count=int(there.sum()))
        for reason, there in links.items()
        if there.any()
    )


def phase_links(differences: DoubleDifferences) -> BoolArray:
    """Return the links, (n, b, m), whose phase has an unknown integer, with or without code."""
    return np.isfinite(differences.phase_m) & ~differences.is_reference[:, None, :]
