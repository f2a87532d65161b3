"""What a sliding window does with each new keyframe, in one go: calls from Python cost as much."""

from typing import NamedTuple

import numpy as np
from numba import njit

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.methods.smoother.chain_kernel import STATE, eliminate, far, substitute
from fgnav.methods.smoother.link_kernel import linearise, move, predict, put_state
from fgnav.methods.smoother.link_types import Motions, Prior, Samples, Senses, States
from fgnav.methods.smoother.motion_kernel import Gained, preintegrate

SETTLED, TURNED, OPEN = 0, 1, 2  # how ``settle`` ends


@njit(cache=True)
def carry_on(
    states: States,
    motions: Motions,
    samples: Samples,
    step: FloatArray,
    row: int,
    into: int,
) -> bool:
    """Put a keyframe where the motion leads from the one before; return whether there is one.

    The state before is where it is linearised; for the prediction its estimate takes its place.

    Parameters
    ----------
    states, motions : States, Motions
        Of the window.
    samples : Samples
    step : ndarray, shape (1, 15 + b)
        From where the state before is to its estimate.
    row, into : int
        Which keyframe of the samples, and its row in the window.
    """
    k = into - 1
    R, p, v = states.R_nb[k].copy(), states.p_n_m[k].copy(), states.v_n_mps[k].copy()
    slot = states.slot[k].copy()
    move(states, step, k, states, k, True)
    there = _integrate(motions, samples, states.slot[k], row, into)
    predict(states, motions, into)
    put_state(states, k, R, p, v, slot)
    return there


@njit(cache=True)
def _integrate(motions: Motions, samples: Samples, slot: FloatArray, row: int, into: int) -> bool:
    """Fill a motion, see ``links.integrate``; return whether it has a covariance."""
    rows, about = slice(into, into + 1), slot.copy().reshape(1, 6)
    gained = Gained(motions.gained[rows], motions.correction[rows], motions.white[rows])
    failed = preintegrate(
        np.array([row - 1]),
        samples.first,
        samples.step_s,
        samples.f_b_mps2,
        samples.w_b_radps,
        samples.noise,
        about,
        gained,
    )
    motions.span_s[into] = samples.t_s[row] - samples.t_s[row - 1]
    for i in range(6):
        motions.about[into, i] = slot[i]
    for i in range(3):
        motions.gravity_n_mps2[into, i] = samples.gravity_n_mps2[row - 1, i]
        motions.earth_rate_n_radps[into, i] = samples.earth_rate_n_radps[i]
    return failed == 0


class Held(NamedTuple):
    """What a window holds, a row for each keyframe; see ``Chain`` and ``link_types``.

    Keyframe k stands in row ``k + shift`` of the samples, if all of them do; else shift is -1.
    """

    link: FloatArray
    message: FloatArray
    root: FloatArray
    gain: FloatArray
    states: States
    motions: Motions
    senses: Senses
    prior: Prior
    t_s: FloatArray
    samples: Samples
    shift: int


@njit(cache=True)
def settle(
    held: Held,
    steps: FloatArray,
    changed: BoolArray,
    first: int,
    whole: bool,
    limits: tuple[float, float],
    rounds: int,
) -> tuple[int, int]:
    """Solve a window with some links new, and again while that moves estimates too far.

    Parameters
    ----------
    held : Held
    steps : ndarray, shape (m, 15 + b)
        To be filled: from where the m keyframes are linearised to their estimates.
    changed : ndarray of bool, shape (m,)
        Links that are new; those that are in the end.
    first : int
        Row of the oldest keyframe.
    whole : bool
        Whether none has left: then the oldest may move, and with rotations and positions all else.
        What has left speaks of the oldest state where it was linearised then: it stays there.
    limits : tuple of float
        Of what moves and what turns too far; see ``chain_kernel.far``.
    rounds : int
        At most.

    Returns
    -------
    int
        SETTLED; TURNED where motions are to be preintegrated anew before it goes on, of samples
        that are not held; OPEN where normal equations do not do for a state.
    int
        Rounds that are left.
    """
    states, rows = held.states, slice(first, first + len(steps))
    while rounds > 0:
        rounds -= 1
        if not _solved(held, steps, first + np.flatnonzero(changed), first, whole):
            return OPEN, rounds
        about = held.motions.about[rows]
        moved, turned, count = far(steps, held.t_s[rows], states.slot[rows], about, *limits)
        if count == 0 or rounds == 0:  # what is left is far at the next keyframe, too
            break
        if turned.any() and not _integrated(held, steps, first, turned):
            return TURNED, rounds
        moved[0] &= whole
        for place in range(len(steps)):  # at the start, velocities and slots are rough, too
            if moved[place]:
                row = first + place
                move(states, steps[place : place + 1], row, states, row, whole)
        for place in range(len(steps)):
            changed[place] = moved[place] or turned[place] or (place > 0 and moved[place - 1])
        if not changed.any():
            break
    return SETTLED, rounds


@njit(inline="always")
def _solved(held: Held, steps: FloatArray, new: IntArray, first: int, whole: bool) -> bool:
    """Linearise links and fill the steps to the estimates; return whether Cholesky could."""
    link, message, root, gain = held.link, held.message, held.root, held.gain
    last, start = first + len(steps) - 1, first if whole else -1
    linearise(link, held.states, held.motions, held.senses, held.prior, new, start)
    if new[0] == start:
        for i in range(message.shape[1]):
            for j in range(message.shape[1]):
                message[first, i, j] = link[first, STATE + i, STATE + j]
    if eliminate(link, message, root, gain, max(new[0] - 1, first), last) >= 0:
        return False
    return bool(np.isfinite(substitute(gain, message[last], first, last, steps)))


@njit(inline="always")
def _integrated(held: Held, steps: FloatArray, first: int, turned: BoolArray) -> bool:
    """Preintegrate motions about the estimates of their slots; return whether that could be."""
    if held.shift < 0:
        return False
    for place in range(1, len(steps)):
        row = first + place
        slot = held.states.slot[row - 1] + steps[place - 1, 9:STATE]
        if turned[place] and not _integrate(
            held.motions, held.samples, slot, row + held.shift, row
        ):
            return False
    return True
