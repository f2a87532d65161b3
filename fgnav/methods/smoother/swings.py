"""Gaps crossed as the body moves otherwise: rates foretold from both sides by an autoregression.

A random walk of the rate leads across a gap on a cubic, and a body that swings is off that by its
whole swing. How it swings shows in the rest of the flight. What follows from that for the gap is
what the walk starts from, as from a gyroscope that is as good as pretended gaps say.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.methods.smoother.ahead import array_attitudes
from fgnav.methods.smoother.base import Attitudes
from fgnav.methods.smoother.calibration import Calibrated
from fgnav.methods.smoother.crossing import STEP_S, Around
from fgnav.methods.smoother.density import angular_acceleration_density
from fgnav.methods.smoother.gaps import LONGEST_GAP_S, LOST_S, BridgingPreintegrator, hardly_known
from fgnav.methods.smoother.keyframes import ArrayForm, Keyframes
from fgnav.methods.smoother.preintegration import Foretold
from fgnav.methods.smoother.solution import Solution

_AROUND_S = 60.0  # before and after a gap: what a body did long ago it may do no more
# Beside a gap, where rates lag: taken in, foretold attitudes err five times as much. Or where they
# are told by the attitude across it, too.
_EDGE_S, _EDGE_SPACINGS = 0.4, 2.0
_SAME_S = 1e-6
_ROUNDING = 1.5  # spacings of attitudes: a late one is no gap
_KNOWN_RAD = 0.5  # half-way: beyond, nobody can say where specific force points


def crossed(
    found: Calibrated, solve: Callable[[Keyframes], Solution]
) -> tuple[Calibrated, tuple[str, ...]]:
    """Solve again with gaps crossed as the body moves otherwise, where they are crossed better.

    Returns
    -------
    found : Calibrated
        As it was if none is, or if that ends nowhere.
    notes : tuple of str
        As ``across_gaps`` says.
    """
    keyframes, notes = across_gaps(found.keyframes, found.solution)
    if not notes or not found.solution.converged:
        return found, ()
    solution = solve(keyframes)
    if not solution.converged:
        return found, ()
    return replace(found, keyframes=keyframes, solution=solution), notes


def across_gaps(keyframes: Keyframes, solution: Solution) -> tuple[Keyframes, tuple[str, ...]]:
    """Return keyframes whose gaps are crossed as the body moves otherwise, where that errs less.

    Gaps of more than two seconds between the array's attitudes, of a flight without a gyroscope.
    Rates are then a random walk about foretold ones, its intensity told by pretended gaps as that
    about the cubic is. Beside a gap, where an attitude is told from one side, the walk has the
    intensity that a filter needs: with a smoother's, rates at the edge lag.

    Parameters
    ----------
    keyframes : Keyframes
    solution : Solution
        Of the same keyframes: attitudes and rates outside the gaps are taken from it.

    Returns
    -------
    keyframes : Keyframes
        The same if no gap is crossed better.
    notes : tuple of str
        A sentence on each gap that is.
    """
    pre, attitudes = keyframes.preintegrate, array_attitudes(keyframes)
    if pre.imu.w_b_radps is not None or attitudes is None:
        return keyframes, ()
    if not isinstance(pre, BridgingPreintegrator):
        return keyframes, ()
    spacing_s = float(np.median(np.diff(attitudes[0])))
    edge_s = max(_EDGE_S, _EDGE_SPACINGS * spacing_s)
    gaps = _gaps(keyframes, attitudes[0], max(LONGEST_GAP_S, _ROUNDING * spacing_s))
    solved = replace(
        keyframes,
        R_nb=solution.R_nb,
        p_n_m=solution.p_n_m,
        v_n_mps=solution.v_n_mps,
        slot=solution.slot,
    )
    crossed, notes = _Crossed(solved, pre, edge_s), []
    for gap in gaps[np.diff(keyframes.t_s[gaps], axis=1)[:, 0] > LOST_S]:
        around = _around(solved, gaps, gap, edge_s)
        if around is None:
            continue
        asked, way = around.density(), around.way(around.first, around.last, around.known)
        if asked is None or way is None or not asked.prod() < pre.density[gap[0]].prod():
            continue
        off_rad = crossed.cross(gap, around.t_s[around.first : around.last + 1], way, asked)
        from_s, until_s = keyframes.t_s[gap]
        notes.append(
            f"Across {from_s:.2f} to {until_s:.2f} s it turns as it does otherwise: half-way that "
            f"errs by {np.degrees(off_rad):.1f} degrees about an axis, as pretended gaps say."
        )
    if not notes:
        return keyframes, ()
    return crossed.keyframes(angular_acceleration_density(*attitudes, ahead=True)), tuple(notes)


class _Crossed:
    """Keyframes whose gaps are being crossed."""

    def __init__(self, solved: Keyframes, pre: BridgingPreintegrator, edge_s: float) -> None:
        self._solved, self._pre, self._edge_s = solved, pre, edge_s
        self._R_nb, self._rate_b_radps = solved.R_nb.copy(), solved.rate_b_radps
        self._density, self._loosened = pre.density.copy(), pre.loosened.copy()
        self._foretold: Foretold | None = None
        self._lost = np.zeros(len(solved.t_s), dtype=np.bool_)
        self._beside, self._between = np.zeros((2, len(solved.t_s) - 1), dtype=np.bool_)

    def cross(
        self,
        gap: IntArray,
        way_s: FloatArray,
        way: tuple[FloatArray, FloatArray],
        density: FloatArray,
    ) -> float:
        """Start on a way of rates and attitudes at times, (k,); return how far off it gets, rad."""
        t_s, pre, between = self._solved.t_s, self._pre, slice(gap[0], gap[1])
        rate_b_radps, R_nb = way
        inner = (t_s > way_s[0]) & (t_s < way_s[-1])
        foretold = Foretold(t_s=way_s, w_b_radps=rate_b_radps)
        self._R_nb[inner] = Attitudes(t_s=way_s, R_nb=R_nb).at(t_s[inner])
        self._rate_b_radps[inner] = foretold.at(t_s[inner])
        self._foretold = foretold.after(self._foretold)
        from_s, until_s = t_s[gap]
        first = np.searchsorted(t_s, from_s - self._edge_s - _SAME_S)
        last = np.searchsorted(t_s, until_s + self._edge_s + _SAME_S) - 1
        self._beside[first:last] = self._between[between] = True
        self._density[between] = np.maximum(density, pre.angular_acceleration_density)
        off_rad = np.sqrt(self._density[gap[0]].max() * (until_s - from_s) ** 3 / 192)
        if off_rad < _KNOWN_RAD:
            self._loosened[between] = pre.holed[between]
        self._lost[gap[0] + 1 : gap[1]] = True
        return float(off_rad)

    def keyframes(self, beside: FloatArray) -> Keyframes:
        """Return them, the walk beside gaps with an intensity, (3,), of its own.

        What hardly tells attitudes in gaps tells those where they start, see ``hardly_known``.
        """
        solved, pre, t_s, foretold = self._solved, self._pre, self._solved.t_s, self._foretold
        if foretold is None:
            return solved
        density, near = self._density.copy(), self._beside & ~self._between
        density[near] = np.maximum(density[near], beside)
        everywhere = np.ones(len(t_s), dtype=np.bool_)
        vague = ArrayForm.of(hardly_known(None, self._R_nb, t_s, everywhere), everywhere)
        lost, array, slot = self._lost[:, None, None], solved.array, solved.slot.copy()
        slot[:, 3:] = foretold.at(t_s) - self._rate_b_radps
        return replace(
            solved,
            R_nb=self._R_nb,
            slot=slot,
            array=replace(
                array,
                root=np.where(lost, vague.root, array.root),
                minimum=np.where(lost, vague.minimum, array.minimum),
            ),
            preintegrate=replace(
                pre,
                increments=pre.increments.told(t_s, foretold),
                foretold=foretold,
                loosened=self._loosened,
                density=density,
            ),
        )


def _gaps(keyframes: Keyframes, attitudes_s: FloatArray, longest_s: float) -> IntArray:
    """Return between which keyframes, (g, 2), nothing of the array tells attitudes for long."""
    t_s, floating = keyframes.t_s, keyframes.array.floating
    told = np.isin(t_s, attitudes_s)
    row = np.flatnonzero(told if floating is None else told | (floating >= 0))
    gaps = np.stack([row[:-1], row[1:]], axis=1)
    return np.asarray(gaps[np.diff(t_s[gaps], axis=1)[:, 0] > longest_s])


def _around(keyframes: Keyframes, gaps: IntArray, gap: IntArray, edge_s: float) -> Around | None:
    """Return what is known around one of the gaps, (g, 2), keyframes at its ends.

    None without anything on both sides.
    """
    t_s, (from_s, until_s) = keyframes.t_s, keyframes.t_s[gap] + [-edge_s, edge_s]
    if not t_s[0] <= from_s < until_s <= t_s[-1]:
        return None
    steps = round((until_s - from_s) / STEP_S)
    step_s = (until_s - from_s) / steps
    before, after = (min(s, _AROUND_S) // step_s for s in (from_s - t_s[0], t_s[-1] - until_s))
    grid_s = from_s + step_s * np.arange(-before, steps + after + 1)
    known = np.ones(len(grid_s), dtype=np.bool_)
    for begin_s, end_s in t_s[gaps]:
        known &= (grid_s < begin_s - edge_s) | (grid_s > end_s + edge_s)
    rates = [np.interp(grid_s, t_s, column) for column in keyframes.rate_b_radps.T]
    return Around(
        t_s=grid_s,
        w_b_radps=np.stack(rates, axis=1),
        R_nb=Attitudes(t_s=t_s, R_nb=keyframes.R_nb).at(grid_s),
        known=known,
        first=int(before),
        last=int(before) + steps,
        edge=round(edge_s / step_s),
    )
