"""Verdicts: sensors whose normalised innovations leave the chi-square band of their noise.

The innovations of a sensor are tested over the record, over blocks of five seconds and of one, and
by the correlation of neighbours, which late timestamps raise where noise that was estimated too
large hides them from all else [1]_. The false-alarm rate is 1 % a flight over all tests
(Bonferroni). Real noise is neither white nor the same all along, so that a ratio has to leave a
tolerance as well.

References
----------
.. [1] Bar-Shalom, Li, Kirubarajan: Estimation with Applications to Tracking and Navigation, 2001,
   section 5.4.2.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import chdtri
from scipy.stats import norm

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.correlation import SHOWN_BY, correlated
from fgnav.graph.innovations import InnovationSeries
from fgnav.types.estimate import Verdict

FALSE_ALARM = 0.01  # of a flight
# Variances that noise of recorded flights reaches: a standard deviation off by half; multipath,
# receivers that filter, and a faint beacon, for seconds and for one.
TOLERATED, _TOLERATED_BLOCK = 2.25, {5.0: 6.0, 1.0: 16.0}
_TOLERATED_CORRELATION = 0.55
_MINIMUM = 5  # measurements of a block
_MOST = 5  # verdicts of a sensor: the largest


def judge(
    series: Sequence[InnovationSeries],
    implausible: Mapping[str, float],
    span_s: tuple[float, float],
) -> tuple[Verdict, ...]:
    """Return the sensors that contradict the others, each by its largest verdicts first.

    Parameters
    ----------
    series : sequence of InnovationSeries
    implausible : mapping of str to float
        What was identified of noise and set-up over the largest plausible value, above 1.
    span_s : tuple of float
        First and last keyframe.
    """
    tested = [one for one in series if int(one.freedom.sum())]
    tests = sum(2 + sum(len(_blocks(one.t_s, s)) for s in _TOLERATED_BLOCK) for one in tested)
    rate = FALSE_ALARM / max(tests, 1)
    verdicts = [
        Verdict(
            sensor=name,
            from_s=span_s[0],
            until_s=span_s[1],
            ratio=float(ratio) ** 2,
            limit=1.0,
            test="plausibility",
        )
        for name, ratio in implausible.items()
    ]
    for one in tested:
        blocks = _of_blocks(one, rate)
        others = np.ones(len(one.t_s), dtype=np.bool_)
        for block in blocks:
            others &= (one.t_s < block.from_s) | (one.t_s > block.until_s)
        remainder = one._replace(squared=one.squared[others], freedom=one.freedom[others])
        verdicts += _of_record(one, remainder, rate) or blocks or _of_correlation(one, rate)
    return tuple(verdicts)


def _of_record(one: InnovationSeries, remainder: InnovationSeries, rate: float) -> list[Verdict]:
    """Return a verdict of all of a record if ``remainder``, without its worst blocks, has one."""
    if not int(remainder.freedom.sum()):
        remainder = one
    limit = max(TOLERATED, limit_of(remainder.squared, remainder.freedom, rate))
    if remainder.nis <= limit:
        return []
    return [_verdict(one, (0, len(one.t_s)), one.nis, limit, "record")]


def limit_of(squared: FloatArray, freedom: IntArray, rate: float) -> float:
    """Return the largest mean square of innovations, (k,), that noise explains, correlated as is.

    All of them are worth one where they are too few for any correlation to show.
    """
    total = int(freedom.sum())
    normalised = (squared - freedom) / np.sqrt(2 * freedom.clip(1))
    longer = (
        correlated((normalised - normalised.mean())[:, None])
        if len(normalised) > SHOWN_BY
        else len(normalised)
    )
    effective = max(total / longer, 1.0)
    return float(chdtri(effective, rate) / effective)


def _of_blocks(one: InnovationSeries, rate: float) -> list[Verdict]:
    """Return runs of blocks beyond their band, of the shorter blocks first."""
    for length_s in sorted(_TOLERATED_BLOCK):
        begins = _blocks(one.t_s, length_s)
        freedom = np.add.reduceat(one.freedom, begins).clip(1)
        ratio = np.add.reduceat(one.squared, begins) / freedom
        limit = np.maximum(_TOLERATED_BLOCK[length_s], chdtri(freedom, rate) / freedom)
        beyond = ratio > limit
        edges = np.flatnonzero(np.diff(np.concatenate([[0], beyond.astype(np.int8), [0]])))
        ends = np.append(begins[1:], len(one.t_s))
        runs = [
            _verdict(
                one,
                (begins[a], ends[b - 1]),
                float(ratio[a:b].max()),
                float(limit[a:b].min()),
                f"{length_s:.0f} s",
            )
            for a, b in zip(edges[::2], edges[1::2], strict=True)
        ]
        if runs:
            return sorted(runs, key=lambda run: -run.ratio)[:_MOST]
    return []


def _of_correlation(one: InnovationSeries, rate: float) -> list[Verdict]:
    correlation = one.correlation
    if correlation is None:
        return []
    limit = max(_TOLERATED_CORRELATION, norm.isf(rate) / np.sqrt(int(one.freedom[1:].sum())))
    if correlation <= limit:
        return []
    return [_verdict(one, (0, len(one.t_s)), correlation, float(limit), "correlation")]


def _blocks(t_s: FloatArray, length_s: float) -> IntArray:
    """Return where blocks of a length begin, of five measurements at least."""
    k = len(t_s)
    step_s = max(float(np.median(np.diff(t_s))) if k > 1 else 1.0, 1e-9)
    return np.arange(0, k, max(_MINIMUM, round(length_s / step_s)))


def _verdict(
    one: InnovationSeries, of: tuple[int, int], ratio: float, limit: float, test: str
) -> Verdict:
    return Verdict(
        sensor=one.name,
        from_s=float(one.t_s[of[0]]),
        until_s=float(one.t_s[of[1] - 1]),
        ratio=ratio,
        limit=limit,
        test=test,
    )
