"""Keyframes with too few satellites for a position: the directions that are known all the same."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, Loss
from fgnav.flight import Flight
from fgnav.frontend.gaps import LOST_S
from fgnav.frontend.matching import nearest
from fgnav.frontend.position.series import VectorSeries
from fgnav.gnss.arc_solution import ArcAdjustment
from fgnav.gnss.code_solution import CodeSolution
from fgnav.gnss.few_satellites import Partial, few_positions, few_velocities


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class RankDeficient:
    """What keyframes know in some directions; see ``Partial``.

    Attributes
    ----------
    position, velocity : Partial
        Of the antenna, and of the accelerometer.
    position_row, velocity_row : ndarray of int, shape (k,)
        Their keyframes.
    """

    position: Partial
    velocity: Partial
    position_row: IntArray
    velocity_row: IntArray

    @property
    def losses(self) -> tuple[Loss, ...]:
        """Epochs that measured something and contradict themselves."""
        reason = "satellites contradict each other"
        parts = (("position", self.position), ("velocity", self.velocity))
        return tuple(
            Loss(what=f"{what} from few satellites", reason=reason, count=part.refused)
            for what, part in parts
            if part.refused
        )


def rank_deficient_of(
    flight: Flight, code: CodeSolution, adjustment: ArcAdjustment | None, t_s: FloatArray
) -> RankDeficient | None:
    """Return what the reference antenna knows at keyframes, (n,), without a position.

    None if positions by phase are not known: code alone, of satellites that change, would be off by
    what the messages leave of each.
    """
    observations = flight.observations
    if observations is None or adjustment is None or len(code.t_s) == len(observations.t_s):
        return None
    position, velocity = few_positions(adjustment), few_velocities(flight, code.t_s)
    position = position[~np.isin(position.t_s, code.t_s)]
    if not (len(position.t_s) or len(velocity.t_s)):
        return None
    position_row, near = nearest(t_s, position.t_s)
    velocity_row, close = nearest(t_s, velocity.t_s)
    return RankDeficient(
        position=position[near],
        velocity=velocity[close],
        position_row=position_row[near],
        velocity_row=velocity_row[close],
    )


def completed(
    position: VectorSeries | None,
    velocity: VectorSeries | None,
    part: RankDeficient | None,
    usable: BoolArray,
) -> tuple[VectorSeries | None, VectorSeries | None, tuple[str, ...]]:
    """Return series that know some directions where they would know nothing; and say where.

    Parameters
    ----------
    position, velocity : VectorSeries or None
    part : RankDeficient or None
    usable : ndarray of bool, shape (n,)
        Keyframes whose gap in positions has an attitude nearby: one direction to millimetres
        between attitudes that are off by radians leads a search astray.
    """
    if part is None:
        return position, velocity, ()
    position, count = _completed(position, part.position_row, part.position, usable)
    velocity, moving = _completed(velocity, part.velocity_row, part.velocity, usable)
    note = (
        f"Too few satellites for a position: {count} keyframes with a position, and {moving} with "
        "a velocity, in one direction or two."
    )
    rows = np.union1d(part.position_row, part.velocity_row)
    lost = int((~usable[rows]).sum())
    if lost:
        note += f" Not used at {lost}, in gaps that have no attitude, either."
    return position, velocity, (note,)


def gaps_with_attitude(position: VectorSeries | None, away_s: FloatArray) -> BoolArray:
    """Return keyframes, (n,), whose gap in positions never is far from an attitude.

    Of a body without a gyroscope, which may stand anyhow two seconds after the last attitude.
    """
    if position is None:
        return np.ones(len(away_s), dtype=np.bool_)
    gap = np.cumsum(position.valid)  # the same number all through
    farthest_s = np.zeros(gap[-1] + 1)
    np.maximum.at(farthest_s, gap, away_s)
    return np.asarray(farthest_s[gap] <= LOST_S)


def _completed(
    timed: VectorSeries | None, row: IntArray, part: Partial, used: BoolArray
) -> tuple[VectorSeries | None, int]:
    if timed is None or not len(row):
        return timed, 0
    missing = np.isnan(timed.value[row, 0]) & used[row]
    row, part = row[missing], part[missing]
    value, partial = timed.value.copy(), np.zeros((len(timed.value), 3, 3))
    value[row], partial[row] = part.value, part.root
    segment = timed.segment
    if segment is not None:  # what is known in part is so of the longest stretch's arcs
        segment = segment.copy()
        segment[row] = 0
    return replace(timed, value=value, partial=partial, segment=segment), len(row)
