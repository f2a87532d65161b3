"""Figures of integers, and the baselines that networks are compared with."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav_models.training.ambiguity.data import Samples


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Figures:
    """Accuracy of integers, for each double difference, (d,)."""

    # share of right ones. NaN where nothing was to be judged, as below.
    accuracy_percent: FloatArray
    # mean squared error of the wrong ones; 1 is a miss by one cycle, the least possible. This is
    # what the paper's threshold of 1.1 can mean; NaN where none is wrong.
    mse_failed_cycles2: FloatArray
    # the same over the square of the range of the true integers: the paper's definition
    mse_failed_normalised: FloatArray
    # mse_total_cycles2, mse_total_normalised: over right and wrong ones
    mse_total_cycles2: FloatArray
    mse_total_normalised: FloatArray
    all_right_percent: float  # epochs with no wrong one

    def to_dict(self) -> dict[str, Any]:
        """Return plain lists; None where a figure does not exist."""
        return {
            field.name: [None if np.isnan(v) else float(v) for v in getattr(self, field.name)]
            for field in fields(self)[:-1]
        } | {"all_right_percent": self.all_right_percent}


def figures(answer: IntArray, cycles: IntArray, is_present: BoolArray) -> Figures:
    """Judge integers, (n, d), against the true ones where there are any."""
    square = np.where(is_present, (answer - cycles).astype(float) ** 2, 0.0)
    wrong = square > 0
    top = np.where(is_present, cycles, -(2**31)).max(axis=0)
    bottom = np.where(is_present, cycles, 2**31).min(axis=0)
    spread2 = np.where(top > bottom, top - bottom, np.nan).astype(float) ** 2
    counts = is_present.sum(axis=0).astype(float)
    failed = _ratio(square.sum(axis=0), wrong.sum(axis=0))
    total = _ratio(square.sum(axis=0), counts)
    return Figures(
        accuracy_percent=100.0 * (1.0 - _ratio(wrong.sum(axis=0), counts)),
        mse_failed_cycles2=failed,
        mse_failed_normalised=failed / spread2,
        mse_total_cycles2=total,
        mse_total_normalised=total / spread2,
        all_right_percent=float(100.0 * (~wrong.any(axis=1)).mean()),
    )


def majority(cycles: IntArray, is_present: BoolArray) -> IntArray:
    """Return each double difference's most frequent integer, (d,): the answer without a look."""
    shifted = np.where(is_present, cycles - cycles.min(), -1)
    counts = [np.bincount(column[column >= 0], minlength=1) for column in shifted.T]
    return np.asarray(np.array([int(count.argmax()) for count in counts]) + cycles.min())


def same_time(samples: Samples, train: IntArray, test: IntArray) -> IntArray:
    """Return, for each test row, the integers of the training row nearest in time, (t, d).

    Nothing is measured here, so whatever share this gets right above the majority's leaks through
    the split.
    """
    order = train[np.argsort(samples.t_s[train], kind="stable")]
    t_s = samples.t_s[order]
    after = np.searchsorted(t_s, samples.t_s[test]).clip(1, len(order) - 1)
    earlier = samples.t_s[test] - t_s[after - 1] <= t_s[after] - samples.t_s[test]
    return np.asarray(samples.cycles[order[after - earlier]])


def of_baselines(samples: Samples, train: IntArray, test: IntArray) -> dict[str, Figures]:
    """Return the figures of the three answers that need no network, on the test rows."""
    cycles, is_present = samples.cycles[test], samples.is_present[test]
    most = majority(samples.cycles[train], samples.is_present[train])
    answers = {
        "majority": np.broadcast_to(most, cycles.shape),
        "rounding": samples.rounded[test],
        "same time": same_time(samples, train, test),
    }
    return {name: figures(answer, cycles, is_present) for name, answer in answers.items()}


def _ratio(part: FloatArray | IntArray, whole: FloatArray | IntArray) -> FloatArray:
    return np.asarray(np.where(whole > 0, part / np.maximum(whole, 1), np.nan))
