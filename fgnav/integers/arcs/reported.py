"""Each arc's integer, the chance that it is wrong, and who says so."""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.types.differences import DoubleDifferences
from fgnav.types.integers import SOURCES, ArcInteger, Integers

APART_S = 20.0  # after which errors are new ones; a choice, the time constant of scenario rough


def reported_arcs(
    differences: DoubleDifferences, integers: Integers, antennas: tuple[str, ...]
) -> tuple[ArcInteger, ...]:
    """Return the integers of all arcs.

    Epochs that err alike say together what one of them says: of each ``APART_S`` the median of the
    log odds counts, and those of all these add up.

    Parameters
    ----------
    integers : Integers
        In the layout of ``differences``.
    antennas : tuple of str
        Names, the reference first.
    """
    wrong, source = integers.wrong_probability, integers.source
    if wrong is not None:
        wrong = wrong.clip(1e-300, 1 - 1e-16)
    log_odds = None if wrong is None else np.log1p(-wrong) - np.log(wrong)  # that they are right
    out = []
    for i, j in np.argwhere(integers.fixed.any(axis=0)).tolist():
        rows = np.flatnonzero(integers.fixed[:, i, j])
        labels = np.stack([differences.arc[rows, i, j], integers.cycles[rows, i, j]])
        ends = np.flatnonzero((np.diff(labels, axis=1) != 0).any(axis=0)) + 1
        for part in np.split(rows, ends):
            by = np.zeros(1, dtype=np.int64) if source is None else source[part, i, j]
            t_s = differences.t_s[part]
            out.append(
                ArcInteger(
                    link=f"{antennas[i + 1]} {differences.satellites[j]} {differences.signals[j]}",
                    from_s=float(t_s[0]),
                    until_s=float(t_s[-1]),
                    cycles=int(integers.cycles[part[0], i, j]),
                    wrong_probability=None if log_odds is None else _wrong(t_s, log_odds[part]),
                    by=SOURCES[int(np.bincount(by).argmax())],
                )
            )
    return tuple(out)


def _wrong(t_s: FloatArray, log_odds: FloatArray) -> float:
    """Return the chance of an arc by the log odds of its epochs, (k,)."""
    block = ((t_s - t_s[0]) // APART_S).astype(np.int64)
    total = sum(float(np.median(log_odds[block == one])) for one in np.unique(block))
    return float(1 / (1 + np.exp(np.clip(total, -700.0, 700.0))))
