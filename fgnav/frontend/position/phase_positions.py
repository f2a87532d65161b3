"""Positions by carrier phase: integers against a base station, else constants of arcs."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, Loss, NoSolutionError
from fgnav.flight import Flight
from fgnav.gnss.arc_adjustment import adjust_best
from fgnav.gnss.arc_solution import ArcAdjustment
from fgnav.gnss.code_solution import CodeSolution
from fgnav.gnss.position_phase import position_phase
from fgnav.integers.arc_integers import ArcIntegers, resolve_arcs
from fgnav.rotations import exp, log, transpose

_WRONG_MAX = 1e-3  # chance that a flight's integers against the base are not all right
_NO_EPOCH = "no epoch of the base, or too few arcs"
_LEAST_FIXED = 4  # arcs that make a position


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Positions:
    """Positions of the reference antenna at the epochs of its code solution.

    Attributes
    ----------
    p_n_m : ndarray, shape (k, 3)
    noise_m2, arcs_m2, common_m2 : ndarray, shape (k, 3, 3)
        Covariance that is new at every epoch; common to a stretch of epochs that phase connects;
        and common to all, which no smoothing reduces.
    segment : ndarray of int, shape (k,)
        Number of that stretch, 0 the longest; -1 of positions by code.
    drifting_m2 : ndarray, shape (k, 3, 3)
        Of what is common, the part that moves on as the sky turns.
    unsure_n_m : ndarray, shape (k, 3)
        1-sigma of a shift that drifts over the flight, see ``ArcAdjustment``.
    fixed : ndarray of bool, shape (k,)
        Whether integers against the base are known.
    losses : tuple of Loss
    notes : tuple of str
    adjustment : ArcAdjustment or None
        What positions by phase are from; None where all are by code.
    """

    p_n_m: FloatArray
    noise_m2: FloatArray
    arcs_m2: FloatArray
    common_m2: FloatArray
    drifting_m2: FloatArray
    unsure_n_m: FloatArray
    segment: IntArray
    fixed: BoolArray
    losses: tuple[Loss, ...] = ()
    notes: tuple[str, ...] = ()
    adjustment: ArcAdjustment | None = None


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Attitudes:
    """Approximate attitudes, (k, 3, 3), at increasing times, (k,)."""

    t_s: FloatArray
    R_nb: FloatArray

    def at(self, t_s: FloatArray) -> FloatArray:
        """Return attitudes at times, (n,): turned evenly in between, held beyond the ends."""
        place = np.interp(t_s, self.t_s, np.arange(len(self.t_s)))
        before = np.floor(place).astype(np.int64)
        first, last = self.R_nb[before], self.R_nb[(before + 1).clip(max=len(self.t_s) - 1)]
        share = (place - before)[:, None]
        return np.asarray(first @ exp(share * log(transpose(first) @ last)))


def positions(flight: Flight, code: CodeSolution, attitudes: Attitudes) -> Positions:
    """Return a flight's positions by phase where it has any, by code elsewhere.

    Against a base, integers are fixed where all of them together are wrong with a chance of at most
    1e-3: then positions are good to centimetres. Without, or where integers are not known, phase
    tells the way from epoch to epoch, and code where that is. Turns of the antenna are taken off
    the phase if its residuals become smaller by that: simulated flights may have no wind-up, and
    not every antenna looks up.
    """
    common_m2 = code.position_covariance_m2 - code.position_noise_m2
    out = Positions(
        p_n_m=code.p_n_m.copy(),
        noise_m2=code.position_noise_m2.copy(),
        arcs_m2=np.zeros_like(code.position_noise_m2),
        common_m2=common_m2,
        drifting_m2=common_m2.copy(),
        unsure_n_m=np.zeros_like(code.p_n_m),
        segment=np.full(len(code.t_s), -1),
        fixed=np.zeros(len(code.t_s), dtype=np.bool_),
    )
    if flight.base is None:
        return _alone(flight, code, attitudes, out)
    shared = _against_base(flight, code, attitudes, out)
    if shared is not None:
        return shared
    alone = _alone(flight, code, attitudes, out)
    return replace(alone, losses=(*alone.losses, *_not_fixed(out, _NO_EPOCH)))


def _alone(flight: Flight, code: CodeSolution, attitudes: Attitudes, out: Positions) -> Positions:
    """Put positions by phase in place of those by code; what ails the messages stays common."""
    try:
        found = _adjusted(flight, attitudes, out.common_m2.mean(axis=0), base=False)
    except NoSolutionError as error:
        return replace(out, notes=(*out.notes, f"Positions are those of code: {error}."))
    return _placed(found, code, out, out.common_m2)


def _against_base(
    flight: Flight, code: CodeSolution, attitudes: Attitudes, out: Positions
) -> Positions | None:
    """Return positions against the base; None if it has no epoch in common with the flight."""
    try:
        found = _adjusted(flight, attitudes, None, base=True)
    except NoSolutionError as error:
        return replace(out, notes=(f"Positions are those of code: {error}.",))
    if not found.solved.any():
        return None
    integers = resolve_arcs(found, _WRONG_MAX)
    out.fixed[:] = np.isin(code.t_s, found.equations.single.t_s[_fixed(integers)])
    placed = _placed(integers.adjustment, code, out, 0 * out.common_m2)
    losses = _not_fixed(out, integers.reason or _NO_EPOCH)
    note = f"Positions against the base: integers known at {100 * out.fixed.mean():.1f} % of epochs"
    if out.fixed.any():
        note += f", all right but for a chance of {integers.wrong_probability:.1g}"
    return replace(placed, losses=(*placed.losses, *losses), notes=(f"{note}.",))


def _not_fixed(out: Positions, reason: str) -> tuple[Loss, ...]:
    count = int((~out.fixed).sum())
    return (Loss(what="position against the base", reason=reason, count=count),) if count else ()


def _adjusted(
    flight: Flight, attitudes: Attitudes, common_m2: FloatArray | None, *, base: bool
) -> ArcAdjustment:
    """Adjust phases as they are, and without wind-up; return what fits better."""
    names = ("base" if base else "models", flight.antennas[0].name)
    wound = position_phase(flight, base=base)
    pole_n = flight.origin.R_ne[:, 2]
    unwound = wound.unwound(attitudes.at(wound.single.t_s), pole_n)
    return adjust_best((wound, unwound), names, common_m2)


def _fixed(integers: ArcIntegers) -> BoolArray:
    """Return epochs with arcs enough whose integers are known, (n,)."""
    own = integers.adjustment.epochs
    known = np.append(integers.fixed, False)[own.arc] & (own.weight > 0)
    return np.asarray(known.sum(axis=1) >= _LEAST_FIXED)


def _placed(
    adjustment: ArcAdjustment, code: CodeSolution, out: Positions, common_m2: FloatArray
) -> Positions:
    """Put an adjustment's positions in place of those by code."""
    found = adjustment.positions()
    row, at = _rows(code.t_s, found.t_s)
    out.p_n_m[row], out.noise_m2[row] = found.p_n_m[at], found.noise_m2[at]
    out.arcs_m2[row], out.common_m2[row] = found.common_m2[at], common_m2[row]
    _, segment, count = np.unique(found.piece, return_inverse=True, return_counts=True)
    out.segment[row] = np.argsort(np.argsort(-count, kind="stable"))[segment][at]
    out.drifting_m2[row] = adjustment.shift_covariance_m2
    out.unsure_n_m[row] = adjustment.unsure_n_m[adjustment.solved][at]
    what, reason = "phase for positions", "off the others by more than noise"
    loss = Loss(what=what, reason=reason, count=adjustment.rejected)
    losses = (loss,) if loss.count else ()
    return replace(out, losses=losses, adjustment=adjustment)


def _rows(into_s: FloatArray, of_s: FloatArray) -> tuple[IntArray, IntArray]:
    """Return rows of equal times in both."""
    _, into, of = np.intersect1d(into_s, of_s, return_indices=True)
    return into, of
