"""Some epochs of double differences."""

from dataclasses import fields, replace

import numpy as np

from fgnav.checks import BoolArray, IntArray
from fgnav.types.differences import DoubleDifferences

_OF_EPOCHS = {
    "t_s",
    "reference",
    "e_n",
    "elevation_rad",
    "code_m",
    "phase_m",
    "code_variance_m2",
    "phase_variance_m2",
    "arc",
}


def epochs_at(
    differences: DoubleDifferences, epochs: IntArray, without: BoolArray | None = None
) -> DoubleDifferences:
    """Return some epochs, with the code of some links taken away, so that nobody resolves them.

    Parameters
    ----------
    differences : DoubleDifferences
    epochs : ndarray of int, shape (k,)
        Any, repeated or not; times then count from 0 in steps of 1 s.
    without : ndarray of bool, shape (k, b, m), or None
    """
    parts = {
        field.name: getattr(differences, field.name)[epochs]
        for field in fields(differences)
        if field.name in _OF_EPOCHS
    }
    if without is not None:
        parts["code_m"] = np.where(without, np.nan, parts["code_m"])
    parts["t_s"] = np.arange(float(len(epochs)))
    return replace(differences, **parts)
