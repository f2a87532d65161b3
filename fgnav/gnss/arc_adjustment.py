"""Positions by phase whose integers are unknown: each arc has a constant, fitted to all epochs.

Phase tells to millimetres how an antenna moves while its arcs last, code where all of that is. Both
are adjusted together over the whole flight: three coordinates and the clocks of every epoch, one
constant of every arc. Epochs are eliminated one by one, so the equations that are left have one
row for each arc. Code and phase have clocks of their own, because turns of an antenna wind up all
its phases alike. What is known of the constants, such as integers, goes in afterwards.
"""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray, NoSolutionError
from fgnav.gnss import arc_kernel as kernel
from fgnav.gnss.arc_drift import Drift, columns_of
from fgnav.gnss.arc_equations import Epochs, code_of, epochs_of, pieces
from fgnav.gnss.arc_solution import ArcAdjustment, fitted
from fgnav.gnss.position_phase import PositionPhase

_UNKNOWN_M = 1e2  # an arc's constant, once the mean of phase less code is taken off
_FLAT = 100.0  # dilution of precision of a position that is none
_SIGMAS = 5.0  # residuals of phase beyond are no noise
_MOST_REJECTED = 0.02  # share of phases; with more the stated noise is not what ails them
_LEAST_SHARE = 0.05  # of its own error that a residual must show, to tell noise by
_MOST_APART = 1.5  # squared residuals of code against phase, over those against code alone
_CLEARLY = 100.0  # of chi-square: who fits worse by more is wrong, however alike errors are
_UNLIKELY = 0.01  # chance of being right that is not worth a thought
_SLOW = 3  # degree in time of a drift
_RESEMBLE = 0.05  # autocorrelation that still counts
_DOUBT = 2.0  # an autocorrelation told by few minutes errs by half, and integers hang on it
_NORMAL = 0.4549  # median of a squared normal variable of variance 1


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
    return adjust_best((equations,), names)


def adjust_best(
    candidates: tuple[PositionPhase, ...],
    names: tuple[str, str],
    common_m2: FloatArray | None = None,
) -> ArcAdjustment:
    """Adjust those of some equations, alike but for their phases, whose phases fit best.

    Where the two best fit so nearly alike that either may be right, phases are taken between both,
    as likely as each is, and how far positions of the one drift off those of the other is kept.

    Parameters
    ----------
    candidates : tuple of PositionPhase
    names : tuple of str
        As in ``adjust_arcs``.
    common_m2 : ndarray, shape (3, 3), optional
        Covariance of the shift that errors of messages put to all positions; None: there is none.

    Raises
    ------
    NoSolutionError
        As ``adjust_arcs``, if none of them has an adjustment; of the one that fits best.
    """
    code, failure = code_of(candidates[0].single), None
    begun: list[_Begun] = []
    for equations in candidates:
        own = epochs_of(equations.single, names, code)
        drift = begun[0].drift if begun else _drift(own, common_m2)  # phases there are the same
        begun.append(_begun(equations, own, drift))
    begun.sort(key=lambda one: one.misfit)
    between = () if common_m2 is None else _between(begun, names)  # integers are of one of them
    for one in (*between, *begun):
        try:
            return _finished(one)
        except NoSolutionError as error:
            failure = failure or error
    raise failure or NoSolutionError("position by phase: no equations")


@dataclass(frozen=True, eq=False, slots=True)
class _Begun:
    """A first adjustment with the stated noise, and what its phases show of theirs."""

    equations: PositionPhase
    epochs: Epochs
    squares: FloatArray
    drift: Drift | None
    residual_m: FloatArray
    unsure_n_m: FloatArray

    @property
    def chi_square(self) -> float:
        """Sum of squares of phase residuals in stated sigmas, large ones cut."""
        phases = self.epochs.phases
        squares = self.epochs.weight[:, phases] * self.residual_m[:, phases] ** 2
        return float(np.minimum(squares, _SIGMAS**2).sum())

    @property
    def misfit(self) -> float:
        return float(np.minimum(self.squares, _SIGMAS**2).mean())


def _drift(own: Epochs, common_m2: FloatArray | None) -> Drift | None:
    if common_m2 is None:
        return None
    columns = columns_of(own)
    shown = np.stack(
        [_adjusted(own._replace(y=column)).residual_m for column in np.moveaxis(columns, 2, 0)],
        axis=2,
    )
    return Drift(
        columns=columns,
        shown=shown,
        information=np.einsum("nmi,nm,nmj->ij", shown, own.weight, shown),
        prior=np.linalg.inv(common_m2),
    )


def _begun(equations: PositionPhase, own: Epochs, drift: Drift | None) -> _Begun:
    at = _adjusted(own)
    if drift is not None:
        shift_m = drift.shift_m(own, at.residual_m)
        own = own._replace(y=own.y - drift.columns @ shift_m)
        at = replace(at, residual_m=at.residual_m - drift.shown @ shift_m)
    squares = _shown(own, at)
    squares = squares if len(squares) else np.ones(1)  # nothing is checked
    return _Begun(equations, own, squares, drift, at.residual_m, np.zeros((len(own.y), 3)))


def _between(begun: list[_Begun], names: tuple[str, str]) -> tuple[_Begun, ...]:
    """Return equations between the two that fit best, if either may be right."""
    if len(begun) < 2:
        return ()
    best, other = begun[:2]
    worse = other.chi_square - best.chi_square
    if worse > _CLEARLY or not np.array_equal(best.epochs.arc, other.epochs.arc):
        return ()
    alike = 1 + 2 * _likeness(best.epochs, best.residual_m, best.epochs.phases)
    noise = max(1.0, float(np.median(best.squares)) / _NORMAL) * alike
    chance = 1 / (1 + np.exp(worse / noise / 2))
    if chance < _UNLIKELY:
        return ()
    single, of_other = best.equations.single, other.equations.single
    phase_m = (1 - chance) * single.phase_m + chance * of_other.phase_m
    equations = replace(best.equations, single=replace(single, phase_m=phase_m))
    own = epochs_of(equations.single, names, code_of(single))
    unsure_n_m = np.sqrt(chance * (1 - chance)) * _drifting(best.epochs, other.epochs)
    return (replace(_begun(equations, own, best.drift), unsure_n_m=unsure_n_m),)


def _drifting(best: Epochs, other: Epochs) -> FloatArray:
    """Return how positions of the other drift off those of the best, (n, 3).

    Slowly: constants of arcs have the mean, and the rest comes and goes with attitudes.
    """
    apart = best._replace(y=other.y - best.y)
    at = _adjusted(apart)
    apart_n_m = fitted(apart, at.cofactor, at.constant_m)[0][:, :3]
    slow = np.polynomial.legendre.legvander(np.linspace(-1, 1, len(apart_n_m)), _SLOW)
    found = np.linalg.lstsq(slow[at.solved], apart_n_m[at.solved], rcond=None)[0]
    return np.asarray(slow[:, 1:] @ found[1:])


def _finished(begun: _Begun) -> ArcAdjustment:
    own, group = begun.epochs, begun.equations.single.group
    inflation = max(1.0, float(np.median(begun.squares)) / _NORMAL)
    own, at, rejected = _cleaned(own, inflation)
    thinned, code_thinning = own.weight.copy(), _inflation(own, at)
    thinned[:, : own.phases.start] /= code_thinning
    thinning = 1 + _DOUBT * 2 * _likeness(own, at.residual_m, own.phases)
    thinned[:, own.phases] /= thinning
    constants = _adjusted(own._replace(weight=thinned))
    used = own.weight[:, own.phases] > 0
    return ArcAdjustment(
        equations=begun.equations,
        epochs=own,
        cofactor=at.cofactor,
        solved=at.solved,
        constant_m=constants.constant_m,
        covariance_m2=constants.covariance_m2,
        piece=pieces(np.where(used, own.arc[:, own.phases], -1), group),
        misfit=begun.misfit,
        rejected=rejected,
        code_thinning=code_thinning,
        shift_covariance_m2=(
            np.zeros((3, 3))
            if begun.drift is None
            else begun.drift.covariance_m2(inflation * thinning)
        ),
        unsure_n_m=begun.unsure_n_m,
    )


@dataclass(frozen=True, eq=False, slots=True)
class _Adjusted:
    cofactor: FloatArray
    solved: BoolArray
    constant_m: FloatArray
    covariance_m2: FloatArray
    residual_m: FloatArray


def _adjusted(own: Epochs) -> _Adjusted:
    """Fit the unknowns of every epoch and the constants of all arcs."""
    cofactor = np.empty((*own.A.shape[::2], own.A.shape[2]))
    solved = kernel.eliminate(own.A, own.weight, cofactor) < _FLAT**2
    constant_m, Q = _constants(own, cofactor, solved)
    residual_m = fitted(own, cofactor, constant_m)[1] * solved[:, None]
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
    weight = own.weight[:, own.phases]
    share = kernel.shares(own.A[:, own.phases], weight, at.cofactor)
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


def _constants(
    own: Epochs, cofactor: FloatArray, solved: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return the constants of the arcs, (a + 1,), and their covariance; the last is none, 0."""
    a = len(own.channel)
    N, pull = np.diag(np.full(a, 1 / _UNKNOWN_M**2)), np.zeros(a)
    kernel.reduce(own.A, own.y, own.weight, cofactor, solved, own.arc, N, pull)
    Q = np.zeros((a + 1, a + 1))
    Q[:-1, :-1] = np.linalg.inv(np.tril(N) + np.tril(N, -1).T)
    return Q @ np.append(pull, 0.0), Q
