"""The score of a rate prior's variances, interval by interval: one pass back over a filter's tape.

With rho and N the gradient and the negative curvature of the log-likelihood of what is still to
come, by the predicted error state (smoothing without inverses [1]_)::

    rho_k = H' S^-1 z + (I - K H)' F' rho_k+1      N_k = H' S^-1 H + (I - K H)' F' N_k+1 F (I - K H)

a noise of covariance ``exp(2 u) G Q G'`` that leads to epoch k has the exact score of [2]_::

    d log L / d u = rho_k' G Q G' rho_k - trace(N_k G Q G')

Its second part is what the first is on average: degrees of freedom that attitudes tell of it. Of
attitudes that may be wrong, all is weighted by the probability that they are right.

References
----------
.. [1] de Jong, Smoothing and interpolation with the state-space model, JASA 84, 1989.
.. [2] Koopman and Shephard, Exact score for time series models in state space form, Biometrika 79,
   1992.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotation_kernel import product, sandwich, times, transposed
from fgnav.kernels.compiled import inlined, kernel
from fgnav.process import matern_kernel as matern
from fgnav.process.evidence_kernel import RESTART, RESTART_ALL, UPDATE, Tape
from fgnav.process.filter_kernel import SIZE


@kernel
def score(
    t_s: FloatArray, poles_per_s: FloatArray, variance_rad2ps2: FloatArray, tape: Tape
) -> tuple[FloatArray, FloatArray]:
    """Return the score by the log scale of each interval's noise, and its freedom, (n - 1, 3) each.

    Parameters
    ----------
    t_s : ndarray, shape (n,)
    poles_per_s, variance_rad2ps2 : ndarray, shape (n - 1, 3, 3) and (n - 1, 3)
        Those that the tape was made with.
    tape : Tape
    """
    n = len(t_s)
    out, freedom = np.zeros((n - 1, 3)), np.zeros((n - 1, 3))
    rho: FloatArray = np.zeros(SIZE)
    N: FloatArray = np.zeros((SIZE, SIZE))
    F, H, Q = np.empty((3, 3, 3)), np.empty((3, 3)), np.empty((3, 4, 4))
    for k in range(n - 1, 0, -1):
        if k < n - 1:
            to_end = transposed(tape.transition[k + 1])
            rho, N = times(to_end, rho), sandwich(to_end, N)
        if tape.use[k] in (RESTART, RESTART_ALL):
            _forget(rho, N, 3 if tape.use[k] == RESTART else SIZE)
        if tape.use[k] in (UPDATE, RESTART_ALL):
            kept = _kept(tape.share[k], tape.gain[k])
            rho, N = times(kept, rho), sandwich(kept, N)
            _add_innovation(tape.share[k], tape.weight[k], tape.innovation[k], rho, N)
        matern.of_axes(t_s[k] - t_s[k - 1], poles_per_s[k - 1], F, H, Q)
        for axis in range(3):
            chance, mean = _by_noise(rho, N, Q[axis], tape.noise[k], axis)
            out[k - 1, axis] = (chance - mean) * variance_rad2ps2[k - 1, axis]
            freedom[k - 1, axis] = mean * variance_rad2ps2[k - 1, axis]
    return out, freedom


@inlined
def _forget(rho: FloatArray, N: FloatArray, count: int) -> None:
    """Set what a restart makes anew, the first of the state, to zero."""
    for i in range(count):
        rho[i] = 0.0
        for j in range(SIZE):
            N[i, j] = N[j, i] = 0.0


@inlined
def _kept(share: float, gain: FloatArray) -> FloatArray:
    """Return ``(I - K H)'``, (15, 15)."""
    out = np.zeros((SIZE, SIZE))
    for i in range(SIZE):
        out[i, i] = 1.0
    for i in range(3):
        for j in range(SIZE):
            out[i, j] -= share * gain[j, i]
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
def _by_noise(
    rho: FloatArray, N: FloatArray, Q: FloatArray, rows: FloatArray, axis: int
) -> tuple[float, float]:
    """Return ``rho' G Q G' rho`` and ``trace(N G Q G')`` of one axis, for unit variance.

    G has a column for phi and one for w in the rotation's rows, and one each for w, a and j.
    """
    G = np.zeros((4, SIZE))
    for i in range(3):
        G[0, i], G[1, i] = rows[i, axis], rows[i, 3 + axis]
        G[1 + i, 3 + 3 * i + axis] = 1.0
    by, among = times(G, rho), product(product(G, N), transposed(G))
    chance, mean = 0.0, 0.0
    for a in range(4):
        for b in range(4):
            chance += Q[a, b] * by[a] * by[b]
            mean += Q[a, b] * among[a, b]
    return chance, mean
