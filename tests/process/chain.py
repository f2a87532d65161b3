"""Rates drawn from the prior, attitudes with noise, and a smoother of attitudes alone."""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from fgnav.geometry.rotations import exp, from_euler, log, skew, transpose
from fgnav.process.matern import integral, intervals, noise_factor, stationary, transition

DEG = np.pi / 180
ARRAY_SIGMA = np.array([0.55, 0.14, 0.065]) * DEG  # of an array's attitudes
_PARTS = 10  # of an interval when rates are drawn


def drawn_attitudes(t_s, own, sigma, mean, rng):
    """Return attitudes (n, 3, 3) of rates drawn from a prior of poles (3,), or (3, 3) by axis."""
    own = np.broadcast_to(own, (3, 3))
    R = np.empty((len(t_s), 3, 3))
    R[0] = np.eye(3)
    root = np.linalg.cholesky(np.array([stationary(axis) for axis in own]))
    x = np.einsum("ipq,qi->pi", root, rng.normal(size=(3, 3))) * sigma
    for k in range(len(t_s) - 1):
        T = (t_s[k + 1] - t_s[k]) / _PARTS
        F, H, L = (
            np.array([of(T, axis) for axis in own]) for of in (transition, integral, noise_factor)
        )
        R[k + 1] = R[k]
        for _ in range(_PARTS):
            noise = np.einsum("ipq,qi->pi", L, rng.normal(size=(4, 3))) * sigma
            before, phi = x[0] + mean, mean * T + np.einsum("iq,qi->i", H, x) + noise[0]
            x = np.einsum("ipq,qi->pi", F, x) + noise[1:]
            phi += T**2 / 12 * np.cross(before, x[0] + mean)
            R[k + 1] = R[k + 1] @ exp(phi[None])[0]
    return R


def sigmas(prior):
    return np.sqrt(prior.variance_rad2ps2)


def with_noise(R_nb, sigma, rng):
    """Return attitudes with white errors and their covariances, (n, 3, 3) both."""
    sigma = np.broadcast_to(sigma, 3)
    V = np.tile(np.diag(sigma**2), (len(R_nb), 1, 1))
    return R_nb @ exp(rng.normal(size=(len(R_nb), 3)) * sigma), V


def sine(t_s, amplitude=20 * DEG):
    """Return attitudes whose Euler angles swing once in 6.3 s."""
    return from_euler(*(amplitude * np.sin(t_s + phase) for phase in (0.0, 1.0, 2.0)))


class Process:
    """A process of the rate: d states an axis, with or without a mean that they revert to."""

    def __init__(self, F, H, W, sigma, first, mean):
        # By axis: (k, 3, d, d), (k, 3, d), (k, 3, d + 1, d + 1); first (3, d, d)
        self.F, self.H, self.W = F, H, W
        self.sigma, self.first, self.mean = sigma, first, mean  # (3,), rows, bool


def matern_process(t_s, prior):
    """Return the process of a rate prior."""
    T = np.diff(t_s)
    of = intervals(T, np.tile(prior.poles_per_s, (len(T), 1, 1)))
    known = np.array([stationary(own) for own in prior.poles_per_s])
    first = np.linalg.inv(np.linalg.cholesky(known))
    return Process(of.F, of.H, of.W, np.sqrt(prior.variance_rad2ps2), first, True)


def random_walk(t_s, density):
    """Return a rate that walks at random, (rad/s2)2/Hz."""
    T = np.diff(t_s)
    k = len(T)
    Q = np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]]).transpose(2, 0, 1)
    W = np.linalg.inv(np.linalg.cholesky(Q))
    sigma = np.full(3, np.sqrt(density))
    F, H, W = (np.stack([x] * 3, axis=1) for x in (np.ones((k, 1, 1)), T[:, None], W))
    return Process(F, H, W, sigma, np.full((3, 1, 1), 1e-3), False)


def smoothed(t_s, R_nb, V, process, rounds=4):
    """Return attitudes (n, 3, 3) smoothed by Gauss-Newton, and their covariances (n, 3, 3).

    By normal equations: of no use for length scales of 30 s and more, whose whitening rows weigh
    1e8 times as much as an attitude and want a QR.
    """
    n, d = len(t_s), process.H.shape[2]
    size = 3 + 3 * d
    R, m = R_nb.copy(), np.zeros(3)
    x = np.zeros((n, d, 3))
    turns = log(transpose(R_nb[:-1]) @ R_nb[1:]) / np.diff(t_s)[:, None]
    x[:, 0] = np.vstack([turns, turns[-1:]])
    root = np.linalg.inv(np.linalg.cholesky(V))
    for _ in range(rounds):
        J, r = _system(t_s, R_nb, root, process, (R, x, m))
        factor = splu((J.T @ J).tocsc())
        step = -factor.solve(J.T @ r)
        moves = step[: n * size].reshape(n, size)
        R = R @ exp(moves[:, :3])
        x = x + moves[:, 3:].reshape(n, d, 3)
        m = m + step[n * size :]
    covariance = np.empty((n, 3, 3))
    for k in range(n):
        unit = np.zeros((J.shape[1], 3))
        unit[size * k : size * k + 3] = np.eye(3)
        covariance[k] = factor.solve(unit)[size * k : size * k + 3]
    return R, covariance


def _of_axes(M):
    """Return matrices of the axes, (3, a, b), as one of values axis by axis, (3 a, 3 b)."""
    a, b = M.shape[1:]
    return np.einsum("ipq,ij->piqj", M, np.eye(3)).reshape(3 * a, 3 * b)


def _system(t_s, R_nb, root, process, state):
    R, x, m = state
    n, d, T = len(t_s), process.H.shape[2], np.diff(t_s)
    size, end = 3 + 3 * d, len(t_s) * (3 + 3 * d)
    blocks, residuals, rows = [], [], 0

    def add(columns, A, r):
        nonlocal rows
        i, j = np.meshgrid(np.arange(rows, rows + len(r)), columns, indexing="ij")
        blocks.append((i.ravel(), j.ravel(), A.ravel()))
        residuals.append(r)
        rows += len(r)

    own = np.arange(3)
    e0 = np.eye(d)[0]
    mean = 1.0 if process.mean else 0.0
    add(end + own, np.eye(3) / 15, m / 15)
    rows_0 = _of_axes(process.first / process.sigma[:, None, None])
    A = rows_0 @ np.hstack([np.eye(3 * d), -mean * np.kron(e0[:, None], np.eye(3))])
    add(np.r_[3 + np.arange(3 * d), end + own], A, rows_0 @ (x[0] - mean * np.outer(e0, m)).ravel())
    for k in range(n):
        add(size * k + own, root[k], root[k] @ log(transpose(R_nb[k][None]) @ R[k][None])[0])
    for k in range(n - 1):
        F, H, W = process.F[k], process.H[k], process.W[k]
        turn = log(transpose(R[k][None]) @ R[k + 1][None])[0]
        K = skew(turn[None])[0]
        near = np.eye(3) + K @ K / 12  # inverse right Jacobian: near + K / 2
        deviation = x[k] - mean * np.outer(e0, m)
        magnus = T[k] ** 2 / 12 * np.cross(x[k, 0], x[k + 1, 0])
        led = np.einsum("iq,qi->i", H, deviation)
        v = np.vstack([turn - magnus - mean * m * T[k] - led, x[k + 1]])
        v[1:] -= mean * np.outer(e0, m) + np.einsum("ipq,qi->pi", F, deviation)
        A = np.zeros((3 * (d + 1), 2 * size + 3))
        A[:3, :3], A[:3, size : size + 3] = -(near - K / 2), near + K / 2
        A[:3, 3:size] = -_of_axes(H[:, None])
        A[:3, 3:6] += T[k] ** 2 / 12 * skew(x[k + 1, :1])[0]
        A[:3, size + 3 : size + 6] -= T[k] ** 2 / 12 * skew(x[k, :1])[0]
        A[3:, 3:size], A[3:, size + 3 : 2 * size] = -_of_axes(F), np.eye(3 * d)
        A[:3, 2 * size :] = -mean * np.diag(T[k] - H[:, 0])
        A[3:, 2 * size :] = -mean * _of_axes(e0[:, None] - F[:, :, :1])
        rows_k = _of_axes(W / process.sigma[:, None, None])
        add(np.r_[size * k + np.arange(2 * size), end + own], rows_k @ A, rows_k @ v.ravel())
    i, j, value = (np.concatenate(part) for part in zip(*blocks, strict=True))
    return sparse.csr_matrix((value, (i, j)), (rows, end + 3)), np.concatenate(residuals)
