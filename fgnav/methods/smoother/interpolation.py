"""Any time within a flight as a keyframe: estimates between GNSS epochs, by the motion model.

A time that is asked for enters the graph as a keyframe that measures nothing. What comes out for
it is what inertial samples say from the keyframes on both sides, with the covariance of that.
"""

from dataclasses import replace

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav.methods.smoother.collect import Collected
from fgnav.methods.smoother.gaps import BridgingPreintegrator
from fgnav.methods.smoother.keyframes import ArrayForm, Keyframes, Timed
from fgnav.methods.smoother.preintegration import Preintegrator, increments
from fgnav.rotations import exp, log, transpose

_SAME_S = 1e-4  # a time this close to a keyframe is that keyframe


def with_times(
    collected: Collected, t_s: FloatArray | float, sub_steps: int
) -> tuple[Collected, IntArray]:
    """Return keyframes with some more among them, and the rows that times, (m,), have become.

    A number for times is a rate, Hz: multiples of its period from first keyframe to last.

    Raises
    ------
    BadInputError
        If there are no times, they do not increase, or one lies outside the keyframes.
    """
    have = collected.keyframes.t_s
    wanted = _regular(have, t_s) if isinstance(t_s, float) else np.asarray(t_s, dtype=float)
    if wanted.ndim != 1 or not len(wanted) or not (np.diff(wanted) > _SAME_S).all():
        raise BadInputError(f"t_s: must be one or more times, each {_SAME_S} s after the last")
    if not (wanted[0] >= have[0] - _SAME_S and wanted[-1] <= have[-1] + _SAME_S):
        raise BadInputError(
            f"t_s: must lie within the keyframes, {have[0]:.3f} to {have[-1]:.3f}, "
            f"got {wanted[0]:.3f} to {wanted[-1]:.3f}"
        )
    new = wanted[np.abs(wanted - have[_nearest(have, wanted)]) > _SAME_S]
    dense_s = np.union1d(have, new)
    nearest = _nearest(have, dense_s)
    dense = replace(
        collected,
        keyframes=_dense(collected.keyframes, dense_s, sub_steps),
        epochs=len(wanted),
        common_position_m2=collected.common_position_m2[nearest],
        common_velocity_m2ps2=collected.common_velocity_m2ps2[nearest],
    )
    return dense, _nearest(dense_s, wanted)


def _regular(have_s: FloatArray, rate_hz: float) -> FloatArray:
    """Return multiples of a rate's period within the keyframes."""
    first, last = np.ceil(have_s[0] * rate_hz - _SAME_S), np.floor(have_s[-1] * rate_hz + _SAME_S)
    return np.asarray(np.arange(first, last + 1) / rate_hz)


def _nearest(have_s: FloatArray, want_s: FloatArray) -> IntArray:
    after = np.searchsorted(have_s, want_s).clip(1, len(have_s) - 1)
    return np.asarray(after - (want_s - have_s[after - 1] < have_s[after] - want_s))


def _dense(keyframes: Keyframes, t_s: FloatArray, sub_steps: int) -> Keyframes:
    """Return keyframes at more times; where there was none, they only have a start."""
    have, row = keyframes.t_s, np.searchsorted(t_s, keyframes.t_s)
    before = (np.searchsorted(have, t_s, side="right") - 1).clip(0, len(have) - 2)
    share = ((t_s - have[before]) / (have[before + 1] - have[before]))[:, None]
    first, last = keyframes.R_nb[before], keyframes.R_nb[before + 1]

    def between(values: FloatArray) -> FloatArray:
        return np.asarray((1 - share) * values[before] + share * values[before + 1])

    def timed(part: Timed | None) -> Timed | None:
        if part is None:
            return None
        value = np.full((len(t_s), 3), np.nan)
        value[row] = part.value
        covariance = part.covariance[before + (share[:, 0] == 1)]
        partial = None
        if part.partial is not None:
            partial = np.zeros((len(t_s), 3, 3))
            partial[row] = part.partial
        piece = None
        if part.piece is not None:
            piece = np.full(len(t_s), -1)
            piece[row] = part.piece
        return replace(part, value=value, covariance=covariance, partial=partial, piece=piece)

    gravity_n_mps2 = between(keyframes.gravity_n_mps2)
    return replace(
        keyframes,
        t_s=t_s,
        array=_array(keyframes.array, row, len(t_s)),
        baselines=keyframes.baselines and keyframes.baselines.at(row, len(t_s)),
        heights=keyframes.heights and keyframes.heights.at(row, t_s, have),
        field=keyframes.field and keyframes.field.at(row, len(t_s)),
        R_nb=first @ exp(share * log(transpose(first) @ last)),
        p_n_m=between(keyframes.p_n_m),
        v_n_mps=between(keyframes.v_n_mps),
        slot=between(keyframes.slot),
        position=timed(keyframes.position),
        velocity=timed(keyframes.velocity),
        gravity=keyframes.gravity and keyframes.gravity.at(row, len(t_s)),
        gravity_n_mps2=gravity_n_mps2,
        sight=keyframes.sight and keyframes.sight.at(row, len(t_s)),
        preintegrate=_preintegrator(keyframes.preintegrate, t_s, before, gravity_n_mps2, sub_steps),
    )


def _array(array: ArrayForm, row: IntArray, n: int) -> ArrayForm:
    there, root, minimum = np.zeros(n, dtype=np.bool_), np.zeros((n, 9, 9)), np.zeros((n, 3, 3))
    there[row], root[row], minimum[row] = array.there, array.root, array.minimum
    floating = None
    if array.floating is not None:
        floating = np.full(n, -1, dtype=np.int64)
        floating[row] = array.floating
    return ArrayForm(there=there, root=root, minimum=minimum, floating=floating)


def _preintegrator(
    of: Preintegrator, t_s: FloatArray, before: IntArray, gravity_n_mps2: FloatArray, sub_steps: int
) -> Preintegrator:
    """Return a preintegrator of the intervals between more times, each as the one it is part of."""
    steps = increments(of.imu, t_s, sub_steps)
    if of.foretold is not None:
        steps = steps.told(t_s, of.foretold)
    made = replace(of, increments=steps, gravity_n_mps2=gravity_n_mps2)
    if isinstance(of, BridgingPreintegrator) and isinstance(made, BridgingPreintegrator):
        part = before[:-1]
        return replace(
            made,
            loosened=of.loosened[part],
            holed=of.holed[part],
            density=of.density[part],
        )
    return made
