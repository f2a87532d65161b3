"""Do failures come together? In time, against the same failures shuffled; across the networks."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray

LONGEST = 30  # runs at least this long are counted together


def run_lengths(failed: BoolArray, group: IntArray) -> IntArray:
    """Count runs of consecutive failures by length, (LONGEST + 1,); index 0 stays 0.

    Parameters
    ----------
    failed : ndarray of bool, shape (n, d)
        Epochs in time, one column per network.
    group : ndarray of int, shape (n,)
        A change of it ends a run: another simulation, or a gap.
    """
    ends = np.flatnonzero(np.diff(group)) + 1
    padded = np.insert(failed, ends, False, axis=0)
    silent = np.zeros((1, padded.shape[1]), dtype=bool)
    steps = np.diff(np.concatenate([silent, padded, silent]).astype(np.int8), axis=0).T
    starts, stops = np.nonzero(steps == 1)[1], np.nonzero(steps == -1)[1]
    return np.bincount((stops - starts).clip(max=LONGEST), minlength=LONGEST + 1)


def shuffled_run_lengths(
    failed: BoolArray, group: IntArray, draws: int, *, rng: np.random.Generator
) -> FloatArray:
    """Return the mean of ``run_lengths`` over draws in which every network's failures are moved.

    Each draw moves a network's failures to random epochs, as many as there were.
    """
    total = np.zeros(LONGEST + 1)
    for _ in range(draws):
        total += run_lengths(rng.permuted(failed, axis=0), group)
    return total / draws


def conditional_percent(failed: BoolArray, group: IntArray) -> dict[str, float]:
    """Return P(failure | failure before) and P(failure | success before), percent."""
    together = np.diff(group) == 0
    before, now = failed[:-1][together], failed[1:][together]
    return {
        "after_failure": _percent(now[before]),
        "after_success": _percent(now[~before]),
    }


def joint_failures(failed: BoolArray) -> IntArray:
    """Count epochs by how many of the networks fail in them, (d + 1,)."""
    return np.bincount(failed.sum(axis=1), minlength=failed.shape[1] + 1)


def independent_joint_failures(failed: BoolArray) -> FloatArray:
    """Return the counts that networks of these failure rates would give if they were independent.

    The Poisson binomial distribution, network by network.
    """
    chance = np.array([1.0])
    for rate in failed.mean(axis=0):
        chance = np.convolve(chance, [1.0 - rate, rate])
    return np.asarray(len(failed) * chance)


def _percent(values: BoolArray) -> float:
    return float(100.0 * values.mean()) if len(values) else float("nan")
