"""The evidence of a rate prior: a filter's innovations from attitudes, each right or wrong.

What a backward pass or a guard needs of the filter's steps goes on a tape, where there is one.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry.rotation_kernel import exp, product, put, scaled, turn
from fgnav.kernels.compiled import kernel, kernel_with
from fgnav.process import matern_kernel as matern
from fgnav.process.filter_kernel import (
    MEAN,
    SIZE,
    WIDTH,
    difference,
    gain,
    move,
    predict,
    rotation_rows,
    turn_on,
)

_WRONG_SHARE = 0.01  # of attitudes, before they are seen
_UNKNOWN = -np.log(8 * np.pi**2)  # log density of an attitude that may be any, per rad^3
_LOST = 4  # attitudes in a row held to be wrong: it is the filter that is, and starts anew

UPDATE, RESTART, PREDICT, RESTART_ALL = 0, 1, 2, 3  # what an epoch does; see ``log_densities``


class Tape(NamedTuple):
    """The filter's steps, one for each of n epochs; to the first leads none."""

    rows: FloatArray  # (n, 3, 16), of the transition of the error state: the rotation's
    noise: FloatArray  # (n, 3, 6), of the rotation by the noises of integral and rate
    moved: FloatArray  # (n, 15, 16), the transition times the covariance before
    gain: FloatArray  # (n, 3, 16), transposed
    weight: FloatArray  # (n, 3, 3), inverse covariance of the innovation
    innovation: FloatArray  # (n, 3)
    share: FloatArray  # (n,), probability that the attitude is right
    use: IntArray  # (n,), what was done
    covariance: FloatArray  # (n, 6, 6), of rotation and rate after the epoch
    R_nb: FloatArray  # (n, 3, 3), after the epoch
    state: FloatArray  # (n, 4, 3), rate, derivatives and mean after the epoch


def tape(n: int) -> Tape:
    """Return room for n epochs; none where no step is needed again."""
    return Tape(
        rows=np.zeros((n, 3, WIDTH)),
        noise=np.empty((n, 3, 6)),
        moved=np.zeros((n, SIZE, WIDTH)),
        gain=np.empty((n, 3, WIDTH)),
        weight=np.empty((n, 3, 3)),
        innovation=np.empty((n, 3)),
        share=np.empty(n),
        use=np.empty(n, dtype=np.int64),
        covariance=np.empty((n, 6, 6)),
        R_nb=np.empty((n, 3, 3)),
        state=np.empty((n, 4, 3)),
    )


class Epochs(NamedTuple):
    """Attitudes of n epochs.

    UPDATE by an attitude; RESTART the rotation with it, while rate and mean go on: after a gap,
    over which turns cannot be counted; PREDICT only, for there is none.
    """

    t_s: FloatArray  # (n,)
    R_nb: FloatArray  # (n, 3, 3)
    covariance_rad2: FloatArray  # (n, 3, 3)
    open_axis: FloatArray  # (n, 3), body axes, about which it is next to unknown; zero if none is
    use: IntArray  # (n,)


@kernel_with(fastmath={"reassoc", "contract"})
def log_densities(
    epochs: Epochs,
    mean_rate: FloatArray,
    poles_per_s: FloatArray,
    variance_rad2ps2: FloatArray,
    tape: Tape,
) -> FloatArray:
    """Return the log density of each attitude given those before, (n,); the first has none, 0.

    An attitude is right, or wrong and then any; the update by that mixture keeps its mean and
    covariance (probabilistic data association [1]_), so the density is smooth in what is searched.

    Parameters
    ----------
    epochs : Epochs
    mean_rate : ndarray, shape (4,)
        Of the mean rate, rad/s: where it is linearised, (3,), and its 1-sigma before the flight.
    poles_per_s, variance_rad2ps2 : ndarray, shape (n - 1, 3, 3) and (n - 1, 3)
        Of each interval, about each axis.
    tape : Tape
        Filled where it has room.

    References
    ----------
    .. [1] Bar-Shalom, Daum and Huang, The probabilistic data association filter, IEEE Control
       Systems Magazine 29, 2009.
    """
    t_s, R_nb, covariance_rad2, open_axis, use = epochs
    n = len(t_s)
    out, x = np.zeros(n), np.zeros((4, 3))
    _start_rates(x, mean_rate[:3])
    P = _start(poles_per_s[0], variance_rad2ps2[0], mean_rate[3])
    C, N, moved = np.zeros((3, WIDTH)), np.empty((3, 6)), np.zeros((SIZE, WIDTH))
    R = R_nb[0].copy()
    _restart(P, covariance_rad2[0])
    if len(tape.share):
        put(P, tape.covariance[0])
        put(x, tape.state[0])
    contradicted = 0
    last, r = 0, matern.RECENT
    spans_s, shapes = np.full(r, -1.0), np.zeros((r, 3, 3))
    transitions, integrals, noises = (
        np.empty((r, 3, 3, 3)),
        np.empty((r, 3, 3)),
        np.empty((r, 3, 4, 4)),
    )
    for k in range(1, n):
        span_s, poles = t_s[k] - t_s[k - 1], poles_per_s[k - 1]
        slot = matern.like(span_s, poles, spans_s, shapes)
        if slot < 0:
            slot = last = (last + 1) % r
            spans_s[slot] = span_s
            put(poles, shapes[slot])
            matern.of_axes(span_s, poles, transitions[slot], integrals[slot], noises[slot])
        T_s, F, H, Q = spans_s[slot], transitions[slot], integrals[slot], noises[slot]
        if len(tape.share):
            C, N, moved = tape.rows[k], tape.noise[k], tape.moved[k]
        rotation_rows(x, F, H, T_s, C, N)
        R = turn_on(R, C)
        predict(P, C, N, F, Q, variance_rad2ps2[k - 1], moved)
        move(x, F)
        done = use[k]
        if done == UPDATE:
            z = difference(R, R_nb[k], open_axis[k])
            out[k], share, R = _updated(P, x, R, z, covariance_rad2[k], k, tape)
            contradicted = contradicted + 1 if share < 0.5 else 0
            if contradicted == _LOST:
                done = RESTART_ALL
        if done == RESTART_ALL:
            contradicted = 0
            P = _start(poles, variance_rad2ps2[k - 1], mean_rate[3])
            _start_rates(x, scaled(turn(R_nb[k - 1], R_nb[k]), 1 / T_s))
        if done in (RESTART, RESTART_ALL):
            R = R_nb[k].copy()
            _restart(P, covariance_rad2[k])
        if len(tape.share):
            tape.use[k] = done
            put(P, tape.covariance[k])
            put(R, tape.R_nb[k])
            put(x, tape.state[k])
    return out


@kernel
def _start_rates(x: FloatArray, rate: FloatArray) -> None:
    """Set rate and mean rate, derivatives zero, in x, (4, 3)."""
    for i in range(3):
        x[0, i] = x[3, i] = rate[i]
        x[1, i] = x[2, i] = 0.0


@kernel
def _start(poles_per_s: FloatArray, variance: FloatArray, sigma: float) -> FloatArray:
    """Return the covariance of rate, derivatives and mean before the first attitude, (15, 16)."""
    P = np.zeros((SIZE, WIDTH))
    for i in range(3):
        first, second = matern.stationary(poles_per_s[i])
        w, a, j, m = 3 + i, 6 + i, 9 + i, MEAN + i
        P[m, m] = P[w, m] = P[m, w] = sigma**2
        P[w, w] = sigma**2 + variance[i]
        P[a, a] = variance[i] * first
        P[j, j] = variance[i] * second
        P[w, j] = P[j, w] = -variance[i] * first
    return P


@kernel
def _restart(P: FloatArray, V: FloatArray) -> None:
    """Make the rotation as well known as an attitude is, whatever was before."""
    for i in range(3):
        for j in range(SIZE):
            P[i, j] = P[j, i] = V[i, j] if j < 3 else 0.0


@kernel
def _updated(
    P: FloatArray, x: FloatArray, R: FloatArray, z: FloatArray, V: FloatArray, k: int, tape: Tape
) -> tuple[float, float, FloatArray]:
    """Return log density of an attitude, probability that it is right, and the rotation after it.

    P and x are updated; z is the innovation.
    """
    K, W, square, log_determinant = gain(P, z, V)
    step = np.empty(WIDTH)
    for i in range(P.shape[1]):
        step[i] = K[0, i] * z[0] + K[1, i] * z[1] + K[2, i] * z[2]
    right = np.log(1 - _WRONG_SHARE) - (square + log_determinant + 3 * np.log(2 * np.pi)) / 2
    wrong = np.log(_WRONG_SHARE) + _UNKNOWN
    density = max(right, wrong) + np.log1p(np.exp(-abs(right - wrong)))
    share = np.exp(right - density)
    spread = share * (1 - share)
    for i in range(SIZE):
        p0, p1, p2, along = share * P[i, 0], share * P[i, 1], share * P[i, 2], spread * step[i]
        for j in range(P.shape[1]):
            P[i, j] += along * step[j] - (p0 * K[0, j] + p1 * K[1, j] + p2 * K[2, j])
    for d in range(4):
        for i in range(3):
            x[d, i] += share * step[3 + 3 * d + i]
    if len(tape.share):
        put(K, tape.gain[k])
        put(W, tape.weight[k])
        for i in range(3):
            tape.innovation[k, i] = z[i]
        tape.share[k] = share
    return density, share, product(R, exp(scaled(step[:3], share)))
