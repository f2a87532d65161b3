"""Phase errors that stay with antenna and satellite: how large, how long, and their state.

Of an array of known shape each link's residual about the epoch's attitude is its own error, but
for what attitude and clocks take. Its process, a first-order Gauss-Markov one of share s and time
constant tau beside white noise, has the greatest likelihood of all links' residuals together, each
by a Kalman filter of its own; the variance of both together is what residuals say. It counts where
it is likelier than white noise by a log Bayes factor of five and Schwarz's ln n.
"""

import numpy as np

from fgnav.alignment.alignment import Alignment
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss.clock_free import clock_free
from fgnav.graph.inertial.multipath import Multipath
from fgnav.kernels.compiled import kernel
from fgnav.messages import note
from fgnav.process.hyperparameters import VERY_STRONG_EVIDENCE, likeliest
from fgnav.types.differences import DoubleDifferences

_MINIMUM = 30  # epochs, as of noise
_MOST = 6000  # epochs that are looked at: ten minutes at 10 Hz, thirty times what echoes last
_LONGEST = 10.0  # spans of what is looked at: of a longer one only that it lasts is known
_SHARES = (0.01, 0.99)  # of variance, between which one is sought
_KNOWN = 1e-10  # relative eigenvalue, as of forms


def correlated_error(start: Alignment) -> tuple[Multipath | None, tuple[str, ...]]:
    """Build the time-correlated phase error at keyframes, and a note; None of white errors.

    Parameters
    ----------
    start : Alignment
        At keyframes, (n,), with the phases of all epochs.
    """
    if start.phases is None or start.form is None or len(start.t_s) < 2:
        return None, ()
    differences, ranges_m = start.phases
    epoch = start.epochs_of(differences.t_s)
    seen = (epoch >= 0) & start.valid
    rows = epoch[seen]
    if len(rows) < _MINIMUM:
        return None, ()
    kept_rows = rows[-_MOST:]
    residuals = link_residuals(differences, ranges_m, kept_rows, start.R_nb[seen][-_MOST:])
    process = correlated_process(differences.t_s[kept_rows], residuals)
    if process is None:
        return None, ()
    share, constant_s = process
    basis = _basis(differences.baselines_b_m)
    n = len(start.t_s)
    error = Multipath(
        t_s=start.t_s,
        basis=basis,
        share=np.full(n, share),
        decay_per_s=np.full(n - 1, 1 / constant_s),
        kept=_kept(differences, ranges_m, epoch, basis),
    )
    return error, (note("I203", percent=100 * share, constant_s=constant_s),)


def link_residuals(
    differences: DoubleDifferences, ranges_m: FloatArray, rows: IntArray, R_nb: FloatArray
) -> FloatArray:
    """Return residuals of links at some epochs, in 1-sigmas of their noise, (k, a m); NaN of none.

    Clocks of antennas and of satellites are eliminated.

    Parameters
    ----------
    differences : DoubleDifferences
    ranges_m : ndarray, shape (n, b, m)
    rows : ndarray of int, shape (k,)
    R_nb : ndarray, shape (k, 3, 3)
    """
    part_m = ranges_m[rows] + np.einsum(
        "kij,bj,kmi->kbm", R_nb, differences.baselines_b_m, differences.e_n[rows]
    )
    seen, variance_m2 = np.isfinite(part_m), differences.phase_variance_m2[rows]
    links = np.concatenate([seen.any(axis=1, keepdims=True), seen], axis=1)
    values: FloatArray = np.zeros((*links.shape, 1))
    values[:, 1:, :, 0] = np.where(seen, part_m, 0.0)
    left = clock_free(differences.group, links, variance_m2, values).weighted[..., 0]
    sigmas = left * np.sqrt(variance_m2)[:, None]
    alone = links.sum(axis=1, keepdims=True) < 2
    return np.where(links & ~alone, sigmas, np.nan).reshape(len(rows), -1)


def correlated_process(t_s: FloatArray, residuals: FloatArray) -> tuple[float, float] | None:
    """Return share of variance and time constant, s, of what stays of residuals, (k, m).

    None where white noise is as likely.
    """
    residuals = np.ascontiguousarray(residuals[:, np.isfinite(residuals).any(axis=0)])
    count = int(np.isfinite(residuals).sum())
    shortest, span_s = float(np.median(np.diff(t_s))), float(t_s[-1] - t_s[0])
    if not count or span_s <= shortest:
        return None

    def score(x: FloatArray) -> float:
        squares, log_det = _innovations(t_s, residuals, 1 / (1 + np.exp(-x[0])), np.exp(-x[1]))
        return float(-(log_det + count * np.log(squares / count)) / 2)

    lower, upper = (
        np.array([np.log(s / (1 - s)), np.log(tau)])
        for s, tau in zip(_SHARES, (shortest, _LONGEST * span_s), strict=True)
    )
    grid = [np.array([a, b]) for a in (-2.0, 0.0, 2.0) for b in np.linspace(lower[1], upper[1], 7)]
    best = likeliest(score, max(grid, key=score), lower, upper)
    white = float(-count * np.log(np.nansum(residuals**2) / count) / 2)
    if score(best) - white < VERY_STRONG_EVIDENCE + np.log(count):
        return None
    return float(1 / (1 + np.exp(-best[0]))), float(np.exp(best[1]))


@kernel
def _innovations(
    t_s: FloatArray, residuals: FloatArray, share: float, decay_per_s: float
) -> tuple[float, float]:
    """Return normalised innovations squared, and their variances' logarithms, each summed."""
    squares, log_det = 0.0, 0.0
    for j in range(residuals.shape[1]):
        mean, variance, last = 0.0, share, t_s[0]
        for k in range(len(t_s)):
            value = residuals[k, j]
            if np.isnan(value):
                continue
            rho = np.exp(-(t_s[k] - last) * decay_per_s)
            mean, last = rho * mean, t_s[k]
            variance = share + rho * rho * (variance - share)
            S = variance + 1 - share
            innovation = value - mean
            squares += innovation * innovation / S
            log_det += np.log(S)
            mean += variance / S * innovation
            variance -= variance * variance / S
    return squares, log_det


def _basis(baselines_b_m: FloatArray) -> FloatArray:
    """Return the elements of R_nb that an array's links know of, (9, 3 r), r its dimensions."""
    _, size, axes = np.linalg.svd(baselines_b_m)
    rank = int((size > np.sqrt(_KNOWN) * size[0]).sum())
    return np.kron(np.eye(3), axes[:rank].T)


def symmetric_root(information: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the symmetric roots of information, (n, 9, 9), and their pseudoinverses."""
    values, vectors = np.linalg.eigh(information)
    observable = values > _KNOWN * values[:, -1:].clip(1e-300)
    root = np.sqrt(np.where(observable, values, 0.0))
    inverse = np.where(observable, 1 / np.where(observable, root, 1.0), 0.0)
    across = vectors.swapaxes(1, 2)
    return (vectors * root[:, None]) @ across, (vectors * inverse[:, None]) @ across


def _kept(
    differences: DoubleDifferences, ranges_m: FloatArray, epoch: IntArray, basis: FloatArray
) -> FloatArray:
    """Compute the transitions between keyframes, (n - 1, q, q); see ``Multipath``."""
    links: BoolArray = np.isfinite(ranges_m)
    information = RotationQuadratic.of_ranges(differences, ranges_m).information
    seen = np.flatnonzero(epoch >= 0)
    seen = seen[information[epoch[seen]].any(axis=(1, 2))]
    kept = np.tile(np.eye(basis.shape[1]), (len(epoch) - 1, 1, 1))
    if len(seen) < 2:
        return kept
    of = epoch[seen]
    _, inverse = symmetric_root(information[of])
    both_m = np.full_like(ranges_m, np.nan)
    both_m[of[1:]] = np.where(links[of[1:]] & links[of[:-1]], ranges_m[of[1:]], np.nan)
    both = RotationQuadratic.of_ranges(differences, both_m).information[of[1:]]
    U, size, Vt = np.linalg.svd(basis.T @ (inverse[1:] @ both @ inverse[:-1]) @ basis)
    kept[seen[1:] - 1] = (U * size.clip(max=1.0)[:, None]) @ Vt  # weights drift by rounding
    return kept
