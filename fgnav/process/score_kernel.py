"""The score of a rate prior, of variances and poles: one pass back over a filter's tape.

With rho and N the gradient and the negative curvature of the log-likelihood of what is still to
come, by the predicted error state (smoothing without inverses [1]_)::

    rho_k = H' S^-1 z + (I - K H)' F' rho_k+1      N_k = H' S^-1 H + (I - K H)' F' N_k+1 F (I - K H)

a noise of covariance ``exp(2 u) G Q G'`` that leads to epoch k has the exact score of [2]_::

    d log L / d u = rho_k' G Q G' rho_k - trace(N_k G Q G')

Its second part is what the first is on average: degrees of freedom that attitudes tell of it. An
axis moves by ``G M s``, with s the rate about its mean and the derivatives before, M the rows of
integral and transition; P is the covariance before, and E takes s' error out of the state's::

    d log L = rho' G dM s + trace((rho rho' - N) G (dM E P F' + exp(2 u) dQ G' / 2))

Of attitudes that may be wrong, all is weighted by the probability that they are right.

References
----------
.. [1] de Jong, Smoothing and interpolation with the state-space model, JASA 84, 1989.
.. [2] Koopman and Shephard, Exact score for time series models in state space form, Biometrika 79,
   1992.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotation_kernel import put
from fgnav.kernels.compiled import kernel, kernel_with
from fgnav.process import matern_kernel as matern
from fgnav.process.evidence_kernel import RESTART, RESTART_ALL, UPDATE, Tape
from fgnav.process.filter_kernel import MEAN, SIZE, WIDTH, by_rows

_STEP = 1e-5  # of a pole's logarithm, for differences of what is known in closed form


@kernel_with(fastmath={"reassoc", "contract"})
def score(
    t_s: FloatArray,
    poles_per_s: FloatArray,
    variance_rad2ps2: FloatArray,
    tape: Tape,
    by_shape: bool,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the score by the log scale of each interval's noise, its freedom, and that by poles.

    The first two are (n - 1, 3); the first interval's takes that of the rate before the flight.
    The last, (3, 3), is by ``(k, z, w^2)`` about each axis, of all intervals together.

    Parameters
    ----------
    t_s : ndarray, shape (n,)
    poles_per_s, variance_rad2ps2 : ndarray, shape (n - 1, 3, 3) and (n - 1, 3)
        Those that the tape was made with.
    tape : Tape
    by_shape : bool
        Whether the score by poles is wanted.
    """
    n = len(t_s)
    out, freedom, by_poles = np.zeros((n - 1, 3)), np.zeros((n - 1, 3)), np.zeros((3, 3))
    rho, N = np.zeros(WIDTH), np.zeros((SIZE, WIDTH))
    by, pulled, by_motion = np.empty(4), np.empty((4, WIDTH)), np.empty((4, 3))
    among, half = np.empty((4, 4)), np.zeros((SIZE, WIDTH))
    H, last, r = np.empty((3, 3)), 0, matern.RECENT
    spans_s, shapes = np.full(r, -1.0), np.zeros((r, 3, 3))
    transitions, noises = np.empty((r, 3, 3, 3)), np.empty((r, 3, 4, 4))
    by_motions, by_noises = np.empty((r, 3, 3, 4, 3)), np.empty((r, 3, 3, 4, 4))
    for k in range(n - 1, 0, -1):
        if tape.use[k] == RESTART_ALL:
            _add_start(rho, N, poles_per_s[k - 1], variance_rad2ps2[k - 1], out[k - 1], by_poles)
        if tape.use[k] in (RESTART, RESTART_ALL):
            _forget(rho, N, 3 if tape.use[k] == RESTART else SIZE)
        if tape.use[k] in (UPDATE, RESTART_ALL):
            _keep(tape.share[k], tape.gain[k], rho, N)
            _add_innovation(tape.share[k], tape.weight[k], tape.innovation[k], rho, N)
        span_s, poles = t_s[k] - t_s[k - 1], poles_per_s[k - 1]
        slot = matern.like(span_s, poles, spans_s, shapes)
        if slot < 0:
            slot = last = (last + 1) % r
            spans_s[slot] = span_s
            put(poles, shapes[slot])
            F, Q = transitions[slot], noises[slot]
            matern.of_axes(span_s, poles, F, H, Q)
            if by_shape:
                _differences(span_s, poles, F, H, Q, by_motions[slot], by_noises[slot])
        F, Q, dM, dQ = transitions[slot], noises[slot], by_motions[slot], by_noises[slot]
        for axis in range(3):
            _pull(tape.noise[k], axis, rho, N, by, pulled)
            _set_among(tape.noise[k], axis, pulled, among)
            variance = variance_rad2ps2[k - 1, axis]
            by_noise, mean = _by_noise(by, among, Q[axis])
            out[k - 1, axis] += by_noise * variance
            freedom[k - 1, axis] = mean * variance
            if by_shape:
                _set_by_motion(by, pulled, tape.moved[k], tape.state[k - 1], axis, by_motion)
                for pole in range(3):
                    by_poles[axis, pole] += _inner(by_motion, dM[axis, pole])
                    by_poles[axis, pole] += variance / 2 * _inner(among, dQ[axis, pole])
        _lead_back(tape.rows[k], F, rho, N, half)
    _add_start(rho, N, poles_per_s[0], variance_rad2ps2[0], out[0], by_poles)
    return out, freedom, by_poles


@kernel
def _forget(rho: FloatArray, N: FloatArray, count: int) -> None:
    """Set what a restart makes anew, the first of the state, to zero."""
    for i in range(count):
        rho[i] = 0.0
        for j in range(SIZE):
            N[i, j] = N[j, i] = 0.0


@kernel
def _lead_back(
    C: FloatArray, F: FloatArray, rho: FloatArray, N: FloatArray, half: FloatArray
) -> None:
    """Make them ``T' rho`` and ``T' N T`` of a transition."""
    x, y, z = rho[0], rho[1], rho[2]
    for i in range(3):
        w, a, j = rho[3 + i], rho[6 + i], rho[9 + i]
        for e in range(3):
            rho[3 + 3 * e + i] = F[i, 0, e] * w + F[i, 1, e] * a + F[i, 2, e] * j
        rho[MEAN + i] += w - rho[3 + i]
        rho[i] = 0.0
    for c in range(SIZE):
        rho[c] += C[0, c] * x + C[1, c] * y + C[2, c] * z
    _transposed_times(C, F, N, half)
    for i in range(SIZE):
        for j in range(SIZE):
            N[j, i] = half[i, j]
    _transposed_times(C, F, N, half)
    for i in range(SIZE):
        for j in range(i + 1):
            N[i, j] = N[j, i] = half[i, j]


@kernel_with(fastmath={"reassoc", "contract"})
def _transposed_times(C: FloatArray, F: FloatArray, M: FloatArray, out: FloatArray) -> None:
    """Write ``T' M``, (15, 16): a rotation's row is dense, an axis' rates follow from its own."""
    n = M.shape[1]
    for i in range(3):
        c0, c1, c2 = C[0, i], C[1, i], C[2, i]
        m0, m1, m2 = C[0, MEAN + i], C[1, MEAN + i], C[2, MEAN + i]
        f0, f1, f2 = 1 - F[i, 0, 0], F[i, 1, 0], F[i, 2, 0]
        for q in range(n):
            out[i, q] = c0 * M[0, q] + c1 * M[1, q] + c2 * M[2, q]
            value = m0 * M[0, q] + m1 * M[1, q] + m2 * M[2, q] + f0 * M[3 + i, q]
            out[MEAN + i, q] = value - f1 * M[6 + i, q] - f2 * M[9 + i, q] + M[MEAN + i, q]
        for e in range(3):
            r = 3 + 3 * e + i
            c0, c1, c2 = C[0, r], C[1, r], C[2, r]
            f0, f1, f2 = F[i, 0, e], F[i, 1, e], F[i, 2, e]
            for q in range(n):
                value = c0 * M[0, q] + c1 * M[1, q] + c2 * M[2, q]
                out[r, q] = value + f0 * M[3 + i, q] + f1 * M[6 + i, q] + f2 * M[9 + i, q]


@kernel
def _keep(share: float, gain: FloatArray, rho: FloatArray, N: FloatArray) -> None:
    """Make them ``(I - K H)' rho`` and ``(I - K H)' N (I - K H)``: H takes the first three."""
    NK, step, square = np.zeros((3, WIDTH)), np.empty(3), np.empty((3, 3))
    by_rows(N, gain, NK)
    for i in range(3):
        pull = 0.0
        for m in range(N.shape[1]):
            pull += gain[i, m] * rho[m]
        step[i] = share * pull
        for j in range(3):
            total = 0.0
            for m in range(N.shape[1]):
                total += gain[i, m] * NK[j, m]
            square[i, j] = share * share * total
    for i in range(3):
        rho[i] -= step[i]
        for j in range(SIZE):
            N[i, j] -= share * NK[i, j]
            N[j, i] -= share * NK[i, j]
    for i in range(3):
        for j in range(3):
            N[i, j] += square[i, j]


@kernel
def _add_innovation(
    share: float, W: FloatArray, innovation: FloatArray, rho: FloatArray, N: FloatArray
) -> None:
    """Add ``H' S^-1 z`` and ``H' S^-1 H``."""
    for i in range(3):
        for j in range(3):
            rho[i] += share * W[i, j] * innovation[j]
            N[i, j] += share * W[i, j]


@kernel_with(fastmath={"reassoc", "contract"})
def _pull(
    noise: FloatArray, axis: int, rho: FloatArray, N: FloatArray, by: FloatArray, out: FloatArray
) -> None:
    """Write ``G' rho``, (4,), and ``G' (rho rho' - N)``, (4, 16), of one axis.

    G has a column for phi and one for w in the rotation's rows, and one each for w, a and j.
    """
    w, a, j = 3 + axis, 6 + axis, 9 + axis
    j0, j1, j2 = noise[0, axis], noise[1, axis], noise[2, axis]
    b0, b1, b2 = noise[0, w], noise[1, w], noise[2, w]
    by[0] = j0 * rho[0] + j1 * rho[1] + j2 * rho[2]
    by[1] = b0 * rho[0] + b1 * rho[1] + b2 * rho[2] + rho[w]
    by[2], by[3] = rho[a], rho[j]
    x, y, z, v = by[0], by[1], by[2], by[3]
    for q in range(N.shape[1]):
        out[0, q] = x * rho[q] - (j0 * N[0, q] + j1 * N[1, q] + j2 * N[2, q])
        out[1, q] = y * rho[q] - (b0 * N[0, q] + b1 * N[1, q] + b2 * N[2, q] + N[w, q])
        out[2, q], out[3, q] = z * rho[q] - N[a, q], v * rho[q] - N[j, q]


@kernel
def _set_among(noise: FloatArray, axis: int, pulled: FloatArray, out: FloatArray) -> None:
    """Write ``G' (rho rho' - N) G``, (4, 4)."""
    for b in range(4):
        out[b, 0], out[b, 1] = 0.0, pulled[b, 3 + axis]
        out[b, 2], out[b, 3] = pulled[b, 6 + axis], pulled[b, 9 + axis]
        for i in range(3):
            out[b, 0] += pulled[b, i] * noise[i, axis]
            out[b, 1] += pulled[b, i] * noise[i, 3 + axis]


@kernel
def _by_noise(by: FloatArray, among: FloatArray, Q: FloatArray) -> tuple[float, float]:
    """Return the score by log scale and ``trace(N G Q G')`` of one axis, for unit variance."""
    chance, difference = 0.0, 0.0
    for a in range(4):
        for b in range(4):
            chance += Q[a, b] * by[a] * by[b]
            difference += Q[a, b] * among[a, b]
    return difference, chance - difference


@kernel
def _set_by_motion(
    by: FloatArray, pulled: FloatArray, moved: FloatArray, x: FloatArray, axis: int, out: FloatArray
) -> None:
    """Write the score by M, (4, 3), of one axis, from ``F P``, (15, 16), and the state before."""
    for a in range(4):
        w, first, second = x[0, axis] - x[3, axis], x[1, axis], x[2, axis]
        w, first, second = by[a] * w, by[a] * first, by[a] * second
        for j in range(SIZE):
            pull = pulled[a, j]
            w += pull * (moved[j, 3 + axis] - moved[j, MEAN + axis])
            first += pull * moved[j, 6 + axis]
            second += pull * moved[j, 9 + axis]
        out[a, 0], out[a, 1], out[a, 2] = w, first, second


@kernel
def _inner(a: FloatArray, b: FloatArray) -> float:
    """Return the sum of products of two matrices' entries."""
    total = 0.0
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            total += a[i, j] * b[i, j]
    return total


@kernel
def _stepped(poles_per_s: FloatArray, pole: int) -> tuple[float, float]:
    """Return a step of k, z or w^2 of one axis, and k, z or w after it."""
    value = poles_per_s[pole]
    if pole < 2:
        return _STEP * value, value * (1 + _STEP)
    step = _STEP * (value**2 + poles_per_s[1] ** 2)
    return step, np.sqrt(value**2 + step)


@kernel
def _differences(
    T_s: float,
    poles_per_s: FloatArray,
    F: FloatArray,
    H: FloatArray,
    Q: FloatArray,
    dM: FloatArray,
    dQ: FloatArray,
) -> None:
    """Write the derivatives of M, (3, 3, 4, 3), and Q, (3, 3, 4, 4), by each pole of each axis."""
    ahead, F1, H1, Q1 = poles_per_s.copy(), F.copy(), H.copy(), Q.copy()
    for pole in range(3):
        for axis in range(3):
            dQ[axis, pole, 0, 0], ahead[axis, pole] = _stepped(poles_per_s[axis], pole)
        matern.of_axes(T_s, ahead, F1, H1, Q1)
        for axis in range(3):
            step = dQ[axis, pole, 0, 0]
            ahead[axis, pole] = poles_per_s[axis, pole]
            for j in range(3):
                dM[axis, pole, 0, j] = (H1[axis, j] - H[axis, j]) / step
                for i in range(3):
                    dM[axis, pole, 1 + i, j] = (F1[axis, i, j] - F[axis, i, j]) / step
            for i in range(4):
                for j in range(4):
                    dQ[axis, pole, i, j] = (Q1[axis, i, j] - Q[axis, i, j]) / step


@kernel
def _add_start(
    rho: FloatArray,
    N: FloatArray,
    poles_per_s: FloatArray,
    variance: FloatArray,
    out: FloatArray,
    by_poles: FloatArray,
) -> None:
    """Add the score of the covariance from which rates start."""
    for axis in range(3):
        w, a, j = 3 + axis, 6 + axis, 9 + axis
        of_w, of_a = rho[w] ** 2 - N[w, w], rho[a] ** 2 - N[a, a]
        of_j, of_wj = rho[j] ** 2 - N[j, j], rho[w] * rho[j] - N[w, j]
        first, second = matern.stationary(poles_per_s[axis])
        out[axis] += variance[axis] * (of_w + first * (of_a - 2 * of_wj) + second * of_j)
        ahead = poles_per_s[axis].copy()
        for pole in range(3):
            step, ahead[pole] = _stepped(poles_per_s[axis], pole)
            first1, second1 = matern.stationary(ahead)
            ahead[pole] = poles_per_s[axis, pole]
            slope = (first1 - first) * (of_a - 2 * of_wj) + (second1 - second) * of_j
            by_poles[axis, pole] += variance[axis] / 2 * slope / step
