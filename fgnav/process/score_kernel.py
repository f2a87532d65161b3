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
from fgnav.geometry.rotation_kernel import product, times, transposed
from fgnav.kernels.compiled import inlined, inner, kernel
from fgnav.process import matern_kernel as matern
from fgnav.process.evidence_kernel import RESTART, RESTART_ALL, SAME_S, UPDATE, Tape
from fgnav.process.filter_kernel import MEAN, SIZE, times_transition

_STEP = 1e-5  # of a pole's logarithm, for differences of what is known in closed form


@kernel
def score(
    t_s: FloatArray, poles_per_s: FloatArray, variance_rad2ps2: FloatArray, tape: Tape
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
    """
    n = len(t_s)
    out, freedom, by_poles = np.zeros((n - 1, 3)), np.zeros((n - 1, 3)), np.zeros((3, 3))
    rho: FloatArray = np.zeros(SIZE)
    N: FloatArray = np.zeros((SIZE, SIZE))
    F, H, Q = np.empty((3, 3, 3)), np.empty((3, 3)), np.empty((3, 4, 4))
    dM, dQ = np.empty((3, 3, 4, 3)), np.empty((3, 3, 4, 4))
    T_s, poles = -1.0, poles_per_s[0]
    for k in range(n - 1, 0, -1):
        if k < n - 1:
            rho, N = _led_back(tape.transition[k + 1], rho, N)
        if tape.use[k] == RESTART_ALL:
            _add_start(rho, N, poles_per_s[k - 1], variance_rad2ps2[k - 1], out[k - 1], by_poles)
        if tape.use[k] in (RESTART, RESTART_ALL):
            _forget(rho, N, 3 if tape.use[k] == RESTART else SIZE)
        if tape.use[k] in (UPDATE, RESTART_ALL):
            _keep(tape.share[k], tape.gain[k], rho, N)
            _add_innovation(tape.share[k], tape.weight[k], tape.innovation[k], rho, N)
        same = abs(t_s[k] - t_s[k - 1] - T_s) <= SAME_S
        if not (same and (poles_per_s[k - 1] == poles).all()):
            T_s, poles = t_s[k] - t_s[k - 1], poles_per_s[k - 1]
            matern.of_axes(T_s, poles, F, H, Q)
            _differences(T_s, poles, F, H, Q, dM, dQ)
        x, moved = (
            tape.state[k - 1],
            times_transition(tape.covariance[k - 1], tape.transition[k], F),
        )
        for axis in range(3):
            G = _columns(tape.noise[k], axis)
            by = times(G, rho)
            pulled = _pulled(by, rho, _along(G, N, axis))
            variance = variance_rad2ps2[k - 1, axis]
            among = _among(pulled, G)
            by_noise, mean = _by_noise(by, among, Q[axis])
            out[k - 1, axis] += by_noise * variance
            freedom[k - 1, axis] = mean * variance
            by_motion = _by_motion(by, pulled, moved, x, axis)
            for pole in range(3):
                by_poles[axis, pole] += _inner(by_motion, dM[axis, pole])
                by_poles[axis, pole] += variance / 2 * _inner(among, dQ[axis, pole])
    rho, N = _led_back(tape.transition[1], rho, N)
    _add_start(rho, N, poles_per_s[0], variance_rad2ps2[0], out[0], by_poles)
    return out, freedom, by_poles


@inlined
def _forget(rho: FloatArray, N: FloatArray, count: int) -> None:
    """Set what a restart makes anew, the first of the state, to zero."""
    for i in range(count):
        rho[i] = 0.0
        for j in range(SIZE):
            N[i, j] = N[j, i] = 0.0


@inner
def _led_back(T: FloatArray, rho: FloatArray, N: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ``T' rho`` and ``T' N T`` of a transition, (15, 15), most of which is zero."""
    back = np.zeros(SIZE)
    for j in range(SIZE):
        for i in range(SIZE):
            back[j] += T[i, j] * rho[i]
    half = _transposed_times(T, N)
    return back, _transposed_times(T, transposed(half))


@inner
def _transposed_times(T: FloatArray, M: FloatArray) -> FloatArray:
    """Return ``T' M``, (15, 15): a rotation's row is dense, an axis' rates follow from its own."""
    out = np.zeros((SIZE, SIZE))
    for j in range(SIZE):
        for i in range(3):
            for q in range(SIZE):
                out[j, q] += T[i, j] * M[i, q]
    for axis in range(3):
        for after in range(3 + axis, SIZE, 3):
            for before in range(3 + axis, SIZE, 3):
                factor = T[after, before]
                for q in range(SIZE):
                    out[before, q] += factor * M[after, q]
    return out


@inlined
def _keep(share: float, gain: FloatArray, rho: FloatArray, N: FloatArray) -> None:
    """Make them ``(I - K H)' rho`` and ``(I - K H)' N (I - K H)``: H takes the first three."""
    K = _scaled(share, gain)
    pull, right = times(K, rho), product(N, transposed(K))
    for i in range(3):
        rho[i] -= pull[i]
        for j in range(SIZE):
            N[j, i] -= right[j, i]
    left = product(K, N)
    for i in range(3):
        for j in range(SIZE):
            N[i, j] -= left[i, j]


@inlined
def _scaled(share: float, gain: FloatArray) -> FloatArray:
    """Return a share of K', (3, 15)."""
    out = np.empty((3, SIZE))
    for i in range(3):
        for j in range(SIZE):
            out[i, j] = share * gain[j, i]
    return out


@inlined
def _add_innovation(
    share: float, W: FloatArray, innovation: FloatArray, rho: FloatArray, N: FloatArray
) -> None:
    """Add ``H' S^-1 z`` and ``H' S^-1 H``."""
    pull = times(W, innovation)
    for i in range(3):
        rho[i] += share * pull[i]
        for j in range(3):
            N[i, j] += share * W[i, j]


@inlined
def _columns(rows: FloatArray, axis: int) -> FloatArray:
    """Return G', (4, 15), of one axis.

    G has a column for phi and one for w in the rotation's rows, and one each for w, a and j.
    """
    G = np.zeros((4, SIZE))
    for i in range(3):
        G[0, i], G[1, i] = rows[i, axis], rows[i, 3 + axis]
        G[1 + i, 3 + 3 * i + axis] = 1.0
    return G


@inlined
def _along(G: FloatArray, N: FloatArray, axis: int) -> FloatArray:
    """Return ``G' N``, (4, 15)."""
    out = np.zeros((4, SIZE))
    for j in range(SIZE):
        for a in range(2):
            for i in range(3):
                out[a, j] += G[a, i] * N[i, j]
        for d in range(3):
            out[1 + d, j] += N[3 + 3 * d + axis, j]
    return out


@inlined
def _among(pulled: FloatArray, G: FloatArray) -> FloatArray:
    """Return ``G' (rho rho' - N) G``, (4, 4)."""
    out = np.zeros((4, 4))
    for a in range(4):
        for b in range(4):
            for j in range(SIZE):
                out[a, b] += pulled[a, j] * G[b, j]
    return out


@inlined
def _pulled(by: FloatArray, rho: FloatArray, GN: FloatArray) -> FloatArray:
    """Return ``G' (rho rho' - N)``, (4, 15)."""
    out = np.empty((4, SIZE))
    for a in range(4):
        for j in range(SIZE):
            out[a, j] = by[a] * rho[j] - GN[a, j]
    return out


@inlined
def _by_noise(by: FloatArray, among: FloatArray, Q: FloatArray) -> tuple[float, float]:
    """Return the score by log scale and ``trace(N G Q G')`` of one axis, for unit variance."""
    chance, difference = 0.0, 0.0
    for a in range(4):
        for b in range(4):
            chance += Q[a, b] * by[a] * by[b]
            difference += Q[a, b] * among[a, b]
    return difference, chance - difference


@inlined
def _by_motion(
    by: FloatArray, pulled: FloatArray, moved: FloatArray, x: FloatArray, axis: int
) -> FloatArray:
    """Return the score by M, (4, 3), of one axis, from ``F P``, (15, 15), and the state before."""
    out = np.empty((4, 3))
    for a in range(4):
        for d in range(3):
            out[a, d] = by[a] * (x[d, axis] - (x[3, axis] if d == 0 else 0.0))
            for j in range(SIZE):
                error = moved[j, 3 + 3 * d + axis]
                if d == 0:
                    error -= moved[j, MEAN + axis]
                out[a, d] += pulled[a, j] * error
    return out


@inner
def _inner(a: FloatArray, b: FloatArray) -> float:
    """Return the sum of products of two matrices' entries."""
    total = 0.0
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            total += a[i, j] * b[i, j]
    return total


@inner
def _stepped(poles_per_s: FloatArray, pole: int) -> tuple[float, float]:
    """Return a step of k, z or w^2 of one axis, and k, z or w after it."""
    value = poles_per_s[pole]
    if pole < 2:
        return _STEP * value, value * (1 + _STEP)
    step = _STEP * (value**2 + poles_per_s[1] ** 2)
    return step, np.sqrt(value**2 + step)


@inlined
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


@inner
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
