"""Positions by phase whose integers are unknown: each arc has a constant, fitted to all epochs.

Phase tells to millimetres how an antenna moves while its arcs last, code where all of that is. Both
are adjusted together over the whole flight: three coordinates and the clocks of every epoch, one
constant of every arc. Epochs are eliminated one by one, so the equations that are left have one
row for each arc. Code and phase have clocks of their own, because turns of an antenna wind up all
its phases alike. What is known of the constants, such as integers, goes in afterwards.
"""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, NoSolutionError
from fgnav.gnss.arc_equations import Epochs, epochs_of, pieces
from fgnav.gnss.position_phase import PositionPhase

_UNKNOWN_M = 1e2  # an arc's constant, once the mean of phase less code is taken off
_FLAT = 100.0  # dilution of precision of a position that is none
_SIGMAS = 5.0  # residuals of phase beyond are no noise
_MOST_REJECTED = 0.02  # share of phases; with more the stated noise is not what ails them
_LEAST_SHARE = 0.05  # of its own error that a residual must show, to tell noise by
_MOST_APART = 1.5  # squared residuals of code against phase, over those against code alone
_RESEMBLE = 0.05  # autocorrelation that still counts
_DOUBT = 2.0  # an autocorrelation told by few minutes errs by half, and integers hang on it
_NORMAL = 0.4549  # median of a squared normal variable of variance 1


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class PhasePositions:
    """Positions of the reference antenna at nominal epochs.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
    p_n_m : ndarray, shape (k, 3)
    noise_m2 : ndarray, shape (k, 3, 3)
        The part of the covariance that is new at every epoch: millimetres to centimetres.
    common_m2 : ndarray, shape (k, 3, 3)
        The part that the constants of the arcs bring, common to neighbours.
    piece : ndarray of int, shape (k,)
        Number of the stretch of epochs that phase connects: common errors are common within it.
    """

    t_s: FloatArray
    p_n_m: FloatArray
    noise_m2: FloatArray
    common_m2: FloatArray
    piece: IntArray


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ArcAdjustment:
    """Constants of a flight's arcs, and what is needed to make positions of them.

    Attributes
    ----------
    equations : PositionPhase
    epochs : Epochs
    cofactor : ndarray, shape (n, p, p)
        Covariance of the unknowns of each epoch if the arcs' constants were known.
    solved : ndarray of bool, shape (n,)
    constant_m : ndarray, shape (a + 1,)
        The last stands for no arc: 0.
    covariance_m2 : ndarray, shape (a + 1, a + 1)
    piece : ndarray of int, shape (n,)
    misfit : float
        Mean square of the residuals of phase in stated sigmas, large ones cut.
    rejected : int
        Phases taken out, whose residuals are no noise.
    """

    equations: PositionPhase
    epochs: Epochs
    cofactor: FloatArray
    solved: BoolArray
    constant_m: FloatArray
    covariance_m2: FloatArray
    piece: IntArray
    misfit: float
    rejected: int

    def given(self, combinations: FloatArray, values_m: FloatArray) -> "ArcAdjustment":
        """Return the adjustment once combinations of constants are known.

        Parameters
        ----------
        combinations : ndarray, shape (c, a)
        values_m : ndarray, shape (c,)
        """
        H, Q = np.pad(combinations, ((0, 0), (0, 1))), self.covariance_m2
        gain = np.linalg.solve(H @ Q @ H.T, H @ Q).T
        return replace(
            self,
            constant_m=self.constant_m + gain @ (values_m - H @ self.constant_m),
            covariance_m2=Q - gain @ H @ Q,
        )

    def positions(self) -> PhasePositions:
        """Return positions at the epochs that have one."""
        own, row = self.epochs, np.flatnonzero(self.solved)
        fitted = _fitted(own, self.cofactor, self.constant_m)
        p_n_m = self.equations.start_n_m + fitted.x[:, :3] - self.equations.late_n_m
        S, arc = fitted.gain[row, :3, own.phases], own.arc[row, own.phases]
        between = self.covariance_m2[arc[:, :, None], arc[:, None, :]]
        return PhasePositions(
            t_s=self.equations.single.t_s[row],
            p_n_m=p_n_m[row],
            noise_m2=self.cofactor[row, :3, :3],
            common_m2=S @ between @ S.swapaxes(1, 2),
            piece=self.piece[row],
        )


def adjust_arcs(equations: PositionPhase, names: tuple[str, str]) -> ArcAdjustment:
    """Adjust code and phase of a flight.

    Phase is taken to be as noisy as its residuals show, at least as stated; averages of code tell
    as little as the likeness of neighbouring errors demands.

    Parameters
    ----------
    equations : PositionPhase
    names : tuple of str
        Of the base and the antenna.

    Raises
    ------
    NoSolutionError
        If phases contradict each other, or the code, by more than noise.
    """
    own = epochs_of(equations.single, names)
    at = _adjusted(own)
    squares = _shown(own, at)
    if not len(squares):  # nothing is checked by anything
        squares = np.ones(1)
    own, at, rejected = _cleaned(own, max(1.0, float(np.median(squares)) / _NORMAL))
    thinned = own.weight.copy()
    thinned[:, : own.phases.start] /= _inflation(own, at)
    thinned[:, own.phases] /= 1 + _DOUBT * 2 * _likeness(own, at.residual_m, own.phases)
    constants = _adjusted(own._replace(weight=thinned))
    used = own.weight[:, own.phases] > 0
    return ArcAdjustment(
        equations=equations,
        epochs=own,
        cofactor=at.cofactor,
        solved=at.solved,
        constant_m=constants.constant_m,
        covariance_m2=constants.covariance_m2,
        piece=pieces(np.where(used, own.arc[:, own.phases], -1), equations.single.group),
        misfit=float(np.minimum(squares, _SIGMAS**2).mean()),
        rejected=rejected,
    )


@dataclass(frozen=True, eq=False, slots=True)
class _Fitted:
    gain: FloatArray  # (n, p, 2 m)
    x: FloatArray  # (n, p)
    residual_m: FloatArray  # (n, 2 m)


@dataclass(frozen=True, eq=False, slots=True)
class _Adjusted:
    cofactor: FloatArray
    solved: BoolArray
    constant_m: FloatArray
    covariance_m2: FloatArray
    residual_m: FloatArray


def _fitted(own: Epochs, cofactor: FloatArray, constant_m: FloatArray) -> _Fitted:
    """Fit the unknowns of every epoch, the constants of arcs known."""
    gain = np.einsum("npq,nmq,nm->npm", cofactor, own.A, own.weight)
    left_m = own.y - constant_m[own.arc]
    x = np.einsum("npm,nm->np", gain, left_m)
    return _Fitted(gain, x, left_m - np.einsum("nmp,np->nm", own.A, x))


def _adjusted(own: Epochs) -> _Adjusted:
    """Fit the unknowns of every epoch and the constants of all arcs."""
    cofactor, solved = _eliminated(own)
    constant_m, Q = _constants(own, cofactor, solved)
    residual_m = _fitted(own, cofactor, constant_m).residual_m * solved[:, None]
    return _Adjusted(cofactor, solved, constant_m, Q, residual_m)


def _cleaned(own: Epochs, factor: float) -> tuple[Epochs, _Adjusted, int]:
    """Adjust until no phase is far off, its variance a factor larger than stated.

    Count those taken out.

    Raises
    ------
    NoSolutionError
        If so many phases contradict each other that something else than noise ails them.
    """
    scale = np.ones(own.y.shape[1])
    scale[own.phases] = factor
    own = own._replace(weight=own.weight / scale)
    there = int((own.weight[:, own.phases] > 0).sum())
    at, rejected, noisy = _adjusted(own), 0, True
    while noisy and rejected <= _MOST_REJECTED * there:
        off = own.weight * at.residual_m**2 > _SIGMAS**2
        off[:, : own.phases.start] = False
        rejected, noisy = rejected + int(off.sum()), bool(off.any())
        if noisy:
            own = own._replace(weight=np.where(off, 0.0, own.weight))
            at = _adjusted(own)
    if noisy:
        raise NoSolutionError(
            f"position by phase: {rejected} of {there} phases contradict the others; "
            "a body that spins winds up each satellite's phase differently"
        )
    return own, at, rejected


def _shown(own: Epochs, at: _Adjusted) -> FloatArray:
    """Return squares of phase residuals over their variance by the stated noise, (k,)."""
    share = 1 - own.weight * np.einsum("nmp,npq,nmq->nm", own.A, at.cofactor, own.A)
    share, weight = share[:, own.phases], own.weight[:, own.phases]
    told = (weight > 0) & (share > _LEAST_SHARE) & at.solved[:, None]
    return np.asarray(weight[told] * at.residual_m[:, own.phases][told] ** 2 / share[told])


def _inflation(own: Epochs, at: _Adjusted) -> float:
    """Return how much less averages of code tell because its errors resemble their neighbours'.

    ``1 + 2 sum rho(h)``, the autocorrelation rho by the mean square of differences at lag h, which
    the constants of arcs leave alone, against the variance that code shows in epochs alone.

    Raises
    ------
    NoSolutionError
        If code and phase disagree about the motion.
    """
    of_code = slice(0, own.phases.start)
    weight = own.weight[:, of_code]
    told = (weight > 0) & at.solved[:, None]
    clocks = (own.A[:, of_code, 3:] * told[:, :, None]).any(axis=1).sum()
    sill = 1 - clocks / max(int(told.sum()), 1)  # clocks of epochs take their share
    normalised = np.where(told, np.sqrt(weight) * at.residual_m[:, of_code], np.nan)
    ratio = float(np.nanmean(normalised**2)) / sill if told.any() else 1.0
    if ratio > _MOST_APART:
        raise NoSolutionError(
            f"position by phase: code is {ratio:.3g} times as far from it, squared, as from its own"
            " positions; a body that spins winds up each satellite's phase differently"
        )
    return 1 + _DOUBT * 2 * _likeness(own, at.residual_m, of_code, sill)


def _likeness(own: Epochs, residual_m: FloatArray, part: slice, sill: float | None = None) -> float:
    """Return the sum of autocorrelations over lags; the residuals' own variance is the sill."""
    weight = own.weight[:, part]
    normalised = np.where(weight > 0, np.sqrt(weight) * residual_m[:, part], np.nan)
    if sill is None:
        sill = max(float(np.nanmean(normalised**2)), 1e-12) if (weight > 0).any() else 1.0
    n, total, lag, width = len(normalised), 0.0, 1, 1
    while lag < n // 2:
        steps = normalised[lag:] - normalised[:-lag]
        known = np.isfinite(steps)
        rho = 1 - 0.5 * float((steps[known] ** 2).mean()) / sill if known.any() else 0.0
        if rho < _RESEMBLE:
            break
        total += width * rho
        width = max(1, lag // 4)
        lag += width
    return total


def _eliminated(own: Epochs) -> tuple[FloatArray, BoolArray]:
    """Return the cofactors of the epochs' unknowns, arcs known, (n, p, p); and who has one."""
    used = (own.weight > 0).astype(np.float64)
    unit = np.einsum("nmp,nm,nmq->npq", own.A, used, own.A)
    N = np.einsum("nmp,nm,nmq->npq", own.A, own.weight, own.A)
    diagonal = np.arange(N.shape[1])
    nothing = N[:, diagonal, diagonal] == 0
    enough = (used.sum(axis=1) >= (~nothing).sum(axis=1)) & used.any(axis=1)
    for matrix in (unit, N):
        matrix[:, diagonal, diagonal] += np.where(nothing, 1.0, 0.0)
        matrix[~enough] = np.eye(len(diagonal))
        matrix[:, diagonal, diagonal] *= 1 + 1e-13  # a flat geometry gets a huge cofactor
    dilution = np.einsum("nii->n", np.linalg.inv(unit)[:, :3, :3])
    return np.linalg.inv(N), enough & (dilution > 0) & (dilution < _FLAT**2)


def _constants(
    own: Epochs, cofactor: FloatArray, solved: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return the constants of the arcs, (a + 1,), and their covariance; the last is none, 0."""
    count = 1 + len(own.channel)
    alone = _fitted(own, cofactor, np.zeros(count))
    arc, A = own.arc[:, own.phases], own.A[:, own.phases]
    weight = own.weight[:, own.phases] * solved[:, None]
    left_m = alone.residual_m[:, own.phases]
    pull = np.bincount(arc.ravel(), (weight * left_m).ravel(), count)
    N = np.diag(np.bincount(arc.ravel(), weight.ravel(), count) + 1 / _UNKNOWN_M**2)
    shared = np.einsum("nm,nmp,npl->nml", weight, A, alone.gain[:, :, own.phases])
    np.add.at(N, (arc[:, :, None], arc[:, None, :]), -shared)
    Q = np.zeros((count, count))
    Q[:-1, :-1] = np.linalg.inv(N[:-1, :-1])
    pull[-1] = 0.0
    return Q @ pull, Q
