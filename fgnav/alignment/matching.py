"""Times of measurements matched with times of keyframes."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, Unused, unused_of

SAME_S = 1e-4  # measurements this close to a keyframe are of that keyframe


def nearest(have_s: FloatArray, want_s: FloatArray) -> tuple[IntArray, BoolArray]:
    """Return the row of the time nearest to each wanted time, and whether it is the same time."""
    after = np.searchsorted(have_s, want_s).clip(1, max(len(have_s) - 1, 1))
    after = after.clip(max=len(have_s) - 1)
    before = np.maximum(after - 1, 0)
    index = np.where(want_s - have_s[before] < have_s[after] - want_s, before, after)
    return index, np.abs(have_s[index] - want_s) < SAME_S


def unmatched(what: str, count: int, matched: BoolArray) -> tuple[Unused, ...]:
    """Return the loss of measurements, ``count`` of them, that are at no keyframe."""
    return unused_of({(what, "not at a keyframe"): count - int(matched.sum())})
