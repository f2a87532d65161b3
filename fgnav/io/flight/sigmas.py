"""Columns of standard deviations."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.io.flight.local_frame import columns_to_vectors

LEAST_SIGMA = 1e-6  # m, m/s, deg: no receiver knows its place or velocity better


def stated_sigma(
    where: Path | str, samples: Mapping[str, FloatArray], names: tuple[str, ...]
) -> FloatArray | None:
    """Return standard deviations, (k, c); None where the samples have none.

    Raises
    ------
    BadInputError
        If one is not positive.
    """
    if names[0] not in samples:
        return None
    sigma = columns_to_vectors(samples, names)
    wrong = sigma < LEAST_SIGMA
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise BadInputError(
            f"{where}: line {row + 2}: {names[column]} must be {LEAST_SIGMA:g} or more, "
            f"got {sigma[row, column]:.9g}"
        )
    return sigma
