"""Keyframes with too few satellites for a position: the directions that are known all the same."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, Loss
from fgnav.flight import Flight
from fgnav.gnss.arc_solution import ArcAdjustment
from fgnav.gnss.code_solution import CodeSolution
from fgnav.gnss.few_satellites import Partial, few_positions, few_velocities
from fgnav.methods.smoother.gaps import LOST_S
from fgnav.methods.smoother.instruments import nearest
from fgnav.methods.smoother.keyframes import Keyframes, Timed
from fgnav.methods.smoother.rates import Rates
from fgnav.rotations import skew, transpose


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Few:
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


def few_of(
    flight: Flight, code: CodeSolution, adjustment: ArcAdjustment | None, t_s: FloatArray
) -> Few | None:
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
    return Few(
        position=position[near],
        velocity=velocity[close],
        position_row=position_row[near],
        velocity_row=velocity_row[close],
    )


def at_accelerometer(few: Few, rates: Rates, R_nb: FloatArray, arm_b_m: FloatArray) -> Few:
    """Take an antenna's swing about the accelerometer off its velocity; see ``Rates``.

    Parameters
    ----------
    few : Few
    rates : Rates
    R_nb : ndarray, shape (n, 3, 3)
        Approximate attitudes.
    arm_b_m : ndarray, shape (3,)
        From the accelerometer to the antenna.
    """
    row, arm = few.velocity_row, skew(arm_b_m[None])[0]
    R_nb = R_nb[row]
    swing_b_mps = np.cross(rates.w_b_radps[row], arm_b_m)
    doubt = R_nb @ (arm @ rates.covariance_rad2ps2 @ arm.T) @ transpose(R_nb)
    swung = few.velocity.with_noise(doubt)
    swing_n_mps = np.einsum("nij,nj->ni", R_nb, swing_b_mps)
    return replace(few, velocity=replace(swung, value=swung.value - swing_n_mps))


def with_few(
    keyframes: Keyframes, few: Few | None, away_s: FloatArray
) -> tuple[Keyframes, tuple[str, ...]]:
    """Return keyframes that know some directions where they would know nothing; and say where.

    Not in a gap in which a body without a gyroscope may be anyhow at some time: one direction to
    millimetres between attitudes that are off by radians leads a search astray.

    Parameters
    ----------
    keyframes : Keyframes
    few : Few or None
    away_s : ndarray, shape (n,)
        How far each keyframe is from one with an attitude of its own.
    """
    if few is None:
        return keyframes, ()
    used = np.ones(len(away_s), dtype=np.bool_)
    if keyframes.preintegrate.imu.w_b_radps is None and keyframes.position is not None:
        gap = np.cumsum(np.isfinite(keyframes.position.value[:, 0]))  # the same number all through
        farthest_s = np.zeros(gap[-1] + 1)
        np.maximum.at(farthest_s, gap, away_s)
        used = farthest_s[gap] <= LOST_S
    position, count = _filled(keyframes.position, few.position_row, few.position, used)
    velocity, moving = _filled(keyframes.velocity, few.velocity_row, few.velocity, used)
    note = (
        f"Too few satellites for a position: {count} keyframes with a position, and {moving} with "
        "a velocity, in one direction or two."
    )
    rows = np.union1d(few.position_row, few.velocity_row)
    lost = int((~used[rows]).sum())
    if lost:
        note += f" Not used at {lost}, in gaps that have no attitude, either."
    return replace(keyframes, position=position, velocity=velocity), (note,)


def _filled(
    timed: Timed | None, row: IntArray, part: Partial, used: BoolArray
) -> tuple[Timed | None, int]:
    if timed is None or not len(row):
        return timed, 0
    missing = np.isnan(timed.value[row, 0]) & used[row]
    row, part = row[missing], part[missing]
    value, partial = timed.value.copy(), np.zeros((len(timed.value), 3, 3))
    value[row], partial[row] = part.value, part.root
    piece = timed.piece
    if piece is not None:  # what is known in part is so of the longest stretch's arcs
        piece = piece.copy()
        piece[row] = 0
    return replace(timed, value=value, partial=partial, piece=piece), len(row)
