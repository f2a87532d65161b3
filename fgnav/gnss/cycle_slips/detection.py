"""Arcs of continuous carrier phase: where they break by flag, by gap or by an unannounced step."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, Unused, unused_of
from fgnav.gnss.intervals import usual_interval_so_far_s
from fgnav.gnss.single_differences import SingleDifferences
from fgnav.types.observations import LOST_LOCK

NOT_TESTED, FINE, SLIP = range(3)  # what the slip test says of a step
LONGEST_GAP = 5.0  # median intervals without any epoch, after which nothing is continuous


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class PhaseArcs:
    """Continuous carrier phase."""

    # Number of the arc of each antenna's channel, from 0; -1 without phase.
    arc: IntArray  # (n, a, m)
    # Steps from epoch to epoch that the slip test looked at; and that it could not judge, because
    # fewer than five channels, or their geometry, leave nothing to check.
    steps: int
    untested: int
    unused: tuple[Unused, ...]  # breaks, by antenna and cause


def phase_arcs(
    differences: SingleDifferences,
    names: tuple[str, ...],
    *,
    causal: bool = False,
    earlier_s: FloatArray | None = None,
) -> PhaseArcs:
    """Find the arcs of every antenna and channel.

    An arc ends at a loss-of-lock flag, at an epoch without phase and at a gap in time longer than
    ``LONGEST_GAP`` median intervals. A slip nobody announced shows in the step, from one epoch to
    the next, of the phase differenced between antennas: satellite clocks and atmosphere have gone,
    so a step is the baseline's change seen along the line of sight, one change of clocks common to
    all channels (jumps of milliseconds included), and noise. These four unknowns are fitted to all
    channels of a baseline; where the largest normalised residual says a slip of more than 4.5
    sigmas and a quarter of a cycle, that channel has one [1]_, and if one more shows without it,
    all channels of the baseline break: a lost arc is better than a wrong one. It holds for any
    motion and any interval; what the turn of the line of sight does to a baseline of unknown
    direction, 7 mm in 30 s on 1.6 m, is added to the threshold.

    A slip found on most of the baselines, and at least two, is the reference antenna's; with a
    single baseline nothing tells, and the second antenna is blamed. If five channels contradict
    each other none can be singled out, and all five break.

    Parameters
    ----------
    names : tuple of str, length a
        Of the antennas.
    causal : bool
        Each epoch by epochs up to it alone. The slip test looks at an epoch and the one before in
        any case; here the median interval, too, is that of intervals before.
    earlier_s : ndarray, shape (k,), optional
        Epochs before, whose intervals count.

    References
    ----------
    .. [1] Baarda, A testing procedure for use in geodetic networks, 1968.
    """
    t_s, has_phase = differences.t_s, differences.phase_there
    before = np.zeros_like(has_phase)
    before[1:] = has_phase[:-1]
    step_s = np.diff(t_s, prepend=t_s[:1])
    if len(t_s) > 1:
        usual_s = _usual_s(t_s, earlier_s) if causal else np.median(step_s[1:])
        before[step_s > LONGEST_GAP * usual_s] = False
    flagged = has_phase & before & ((differences.lock_flags & LOST_LOCK) != 0)
    unbroken = has_phase & before & ~flagged
    verdict = np.full(differences.phase_m.shape, NOT_TESTED, dtype=np.int8)
    from fgnav.gnss.cycle_slips.kernel import judge  # noqa: PLC0415  # lazy: brings numba

    judge(
        differences.phase_m,
        differences.e_n,
        differences.phase_variance_m2,
        unbroken,
        np.linalg.norm(differences.baselines_b_m, axis=1),
        differences.wavelength_m,
        verdict,
    )
    slipped = _blame(verdict) & unbroken
    broken = has_phase & (~before | flagged | slipped)
    arc = np.where(has_phase, np.cumsum(broken, axis=0, dtype=np.int32) - 1, -1)
    lost: Counter[tuple[str, str]] = Counter()
    gap = has_phase & ~before & (arc > 0)
    for i, name in enumerate(names):
        what = f"{name} phase continuity"
        lost[what, "loss of lock flagged by the receiver"] += int(flagged[:, i].sum())
        lost[what, "gap"] += int(gap[:, i].sum())
        lost[what, "cycle slip found by the time-differenced test"] += int(slipped[:, i].sum())
    both = unbroken[:, 1:] & unbroken[:, :1] & np.isfinite(differences.phase_m)
    return PhaseArcs(
        arc=arc,
        steps=int(both.sum()),
        untested=int((both & (verdict == NOT_TESTED)).sum()),
        unused=unused_of(lost),
    )


def _usual_s(t_s: FloatArray, earlier_s: FloatArray | None) -> FloatArray:
    if earlier_s is None:
        return usual_interval_so_far_s(t_s)
    return usual_interval_so_far_s(np.append(earlier_s, t_s))[len(earlier_s) :]


def _blame(verdict: IntArray) -> BoolArray:
    """Turn verdicts on baselines (n, b, m) into slips of antennas (n, a, m)."""
    slips = verdict == SLIP
    tested = (verdict != NOT_TESTED).sum(axis=1)
    of_reference = (slips.sum(axis=1) >= 2) & (2 * slips.sum(axis=1) > tested)
    return np.concatenate([of_reference[:, None], slips & ~of_reference[:, None]], axis=1)
