"""Phases without integers: how the attitude changes while their arcs last.

Double differences y = A x + c of an array are linear in the elements x of R_nb, and as long as the
arcs last and the satellites hardly move, both A and the unknown c are constant. All that c does to
x is then a constant u = (A'WA)^-1 A'W c of nine elements, however many links there are: the form of
the phases, centred by any c, determines x + u. So a stretch of epochs without integers is worth as
much as one with them, but for nine dimensions that it shares: real-valued ambiguities, without
loss. Over a minute the satellites' motion leaves a millimetre of a c that is off by decimetres.
"""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.alignment.alignment import Alignment
from fgnav.alignment.filling import interpolated_attitudes
from fgnav.attitude.array import AttitudeSolution, maximum_likelihood
from fgnav.attitude.quadratic import RotationQuadratic, tangent_jacobian
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.geometry.rotations import exp, log
from fgnav.graph.factors.array_phase import FLOAT_AMBIGUITIES
from fgnav.graph.types.parameters import Parameter
from fgnav.messages import note
from fgnav.types.differences import DoubleDifferences

ELEMENTS = 9
_MOST = 6  # stretches: nine dimensions of each travel through the flight's whole chain
_LONGEST_S = 60.0
_MINIMUM = 3  # epochs of a stretch
_NEAR_S = 1.5  # from an attitude about which a stretch begins
_RATE_EPOCHS = 3  # for the rate of the body there
_ROUNDS = 2  # of constants, and of attitudes with what they share
_ITERATIONS, _SETTLED = 20, 1e-6
_UNKNOWN = 1.0  # 1-sigma of an element of u: more than attitudes are off
_ANCHOR_SIGMA_RAD = (
    0.02  # 1-sigma of where a stretch begins, for those who ask before it is smoothed
)
_DROPPED_AT_MOST = 0.5  # of a stretch's epochs: with more, something else than integers is wrong


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class FloatArcs:
    """Keyframes whose array phases have no integers."""

    # Which of the stretches a keyframe is in; -1 with integers, or without phases.
    stretch: IntArray  # (n,)
    count: int  # stretches
    notes: tuple[str, ...] = ()

    @classmethod
    def none(cls, n: int) -> "FloatArcs":
        """Return those of n keyframes that all have integers, or no phases."""
        return cls(stretch=np.full(n, -1, dtype=np.int64), count=0)

    @property
    def constants(self) -> tuple[Parameter, ...]:
        """Constants of the intervals without integers: nine elements each."""
        if not self.count:
            return ()
        n = ELEMENTS * self.count
        return (
            Parameter(
                name=FLOAT_AMBIGUITIES,
                axes=tuple(f"element {k}" for k in range(n)),
                unit="",
                mean=np.zeros(n),
                covariance=_UNKNOWN**2 * np.eye(n),
                start=np.zeros(n),
                linear=True,
                reported=False,
            ),
        )


def with_float_arcs(start: Alignment, false_alarm: float) -> tuple[Alignment, FloatArcs]:
    """Return a start that knows attitudes of epochs without integers, up to what stretches share.

    A stretch begins right after an epoch with an attitude, or ends right before one. Epochs whose
    links contradict each other are left out.

    Parameters
    ----------
    start : Alignment
        At keyframes, (n,).
    false_alarm : float
    """
    none = FloatArcs.none(len(start.t_s))
    if start.phases is None or start.form is None or start.valid.all():
        return start, none
    differences = start.phases[0]
    epoch = start.epochs_of(differences.t_s)
    every_run = _runs(start, differences, epoch)
    by_length = np.argsort([-len(rows) for rows in every_run], kind="stable")
    runs = [every_run[i] for i in np.sort(by_length[:_MOST])]
    stretch, arcs, count = none.stretch.copy(), 0, 0
    omitted = sum(len(rows) for rows in every_run) - sum(len(rows) for rows in runs)
    for rows in runs:
        R_0, anchor = _attitude_at_end(start, rows)
        if R_0 is None:
            omitted += len(rows)
            continue
        selected = differences[epoch[rows]]
        form, attitude, good = _solved(selected, anchor, R_0, false_alarm)
        if good.mean() < _DROPPED_AT_MOST or good.sum() < _MINIMUM:
            omitted += len(rows)
            continue
        omitted += int((~good).sum())
        kept = np.flatnonzero(good)
        at = rows[kept]
        aligned = replace(
            start[at],
            R_nb=attitude.R_nb[kept],
            covariance_rad2=attitude.covariance_rad2[kept] + _ANCHOR_SIGMA_RAD**2 * np.eye(3),
            valid=good[kept],
            form=form[kept],
        )
        start, stretch[at] = start.with_rows(at, aligned), count
        arcs += int(selected.resolvable[0].sum())
        count += 1
    if count:
        R_nb = interpolated_attitudes(start.t_s, start.R_nb, start.valid)
        start = replace(start, R_nb=R_nb)
    notes = _notes(stretch, count, arcs, omitted)
    return start, FloatArcs(stretch=stretch, count=count, notes=notes)


def _notes(stretch: IntArray, count: int, arcs: int, omitted: int) -> tuple[str, ...]:
    notes = []
    if count:
        epochs = int((stretch >= 0).sum())
        notes.append(note("I204", arcs=arcs, count=count, epochs=epochs))
    if omitted:
        notes.append(note("W205", epochs=omitted))
    return tuple(notes)


def _runs(start: Alignment, differences: DoubleDifferences, epoch: IntArray) -> list[IntArray]:
    """Return keyframes of epochs one after another without attitude whose links stay the same."""
    phase = np.isfinite(differences.phase_m)
    wanted = np.flatnonzero((epoch >= 0) & ~start.valid & ~start.refused)
    wanted = wanted[phase[epoch[wanted]].any(axis=(1, 2))]
    if len(wanted) < _MINIMUM:
        return []
    of = epoch[wanted]
    same = (phase[of[1:]] == phase[of[:-1]]).all(axis=(1, 2))
    same &= (differences.arc[of[1:]] == differences.arc[of[:-1]]).all(axis=(1, 2))
    same &= (np.diff(of) == 1) & (np.diff(wanted) == 1)
    first = np.flatnonzero(np.concatenate([[True], ~same]))
    runs: list[IntArray] = []
    for rows in np.split(wanted, first[1:]):
        turn = ((start.t_s[rows] - start.t_s[rows[0]]) // _LONGEST_S).astype(np.int64)
        runs += np.split(rows, np.flatnonzero(np.diff(turn)) + 1)
    return [rows for rows in runs if len(rows) >= _MINIMUM]


def _attitude_at_end(start: Alignment, rows: IntArray) -> tuple[FloatArray | None, int]:
    """Return the attitude at one end of a run, and at which of its epochs; None of neither.

    The body turns on as it did over the last attitudes on that side.
    """
    t_s, R_nb, good = start.t_s, start.R_nb, np.flatnonzero(start.valid)
    place = int(np.searchsorted(good, rows[0]))  # of the first known after the run
    ends = [(rows[0], place - 1, -1, 0), (rows[-1], place, 1, -1)]
    for row, at, side, anchor in ends:
        if not (0 <= at < len(good) and abs(t_s[row] - t_s[good[at]]) <= _NEAR_S):
            continue
        near = good[at]
        away = near + side * _RATE_EPOCHS
        if not (0 <= away < len(t_s) and start.valid[away]):
            return R_nb[near], anchor
        share = (t_s[row] - t_s[near]) / (t_s[near] - t_s[away])
        turn = log(R_nb[away].T[None] @ R_nb[near][None])
        return (R_nb[near] @ exp(share * turn))[0], anchor
    return None, 0


def _solved(
    selected: DoubleDifferences, anchor: int, R_0: FloatArray, false_alarm: float
) -> tuple[RotationQuadratic, AttitudeSolution, BoolArray]:
    """Return form and attitudes of a run, and which of its epochs agree with themselves.

    Parameters are first such that the body stands so at one epoch, then those that all epochs have
    on average: the noise of the one would show in the residuals of all.
    """
    R_nb = np.repeat(R_0[None], len(selected.t_s), axis=0)
    constant_m = (selected.phase_m - selected.array_m(R_nb))[anchor]
    R_nb = maximum_likelihood(_form(selected, constant_m), R_nb).R_nb
    for _ in range(_ROUNDS):
        R_nb = _adjusted(_form(selected, constant_m), R_nb)
        constant_m = (selected.phase_m - selected.array_m(R_nb)).mean(axis=0)
    form = _form(selected, constant_m)
    attitude = maximum_likelihood(form, R_nb)
    sound = attitude.solved & ~attitude.open_axis_b.any(axis=1)
    return form, attitude, sound & attitude.consistent(false_alarm)


def _form(selected: DoubleDifferences, constant_m: FloatArray) -> RotationQuadratic:
    """Return the form of phases less a constant of each link, (b, m)."""
    of_link = np.where(selected.is_reference[:, None], 0.0, constant_m)
    return RotationQuadratic.of_ranges(selected, selected.phase_m - of_link)


def _adjusted(form: RotationQuadratic, R_nb: FloatArray) -> FloatArray:
    """Return attitudes of a run beside the nine elements that it shares, by Gauss and Newton.

    Attitudes are eliminated epoch by epoch. Where the body turns much the elements follow from that
    alone: R_nb + u is a rotation for no other u; where it hardly turns they stay as they are.
    """
    W, u = form.information, np.zeros(ELEMENTS)
    for _ in range(_ITERATIONS):
        J = tangent_jacobian(R_nb)
        pull = np.einsum("kij,kj->ki", W, R_nb.reshape(-1, ELEMENTS) + u) - form.vector
        by_turn = J.swapaxes(1, 2) @ W  # (k, 3, 9)
        K = np.linalg.inv(by_turn @ J + np.eye(3) / _UNKNOWN**2)
        share = by_turn.swapaxes(1, 2) @ K  # (k, 9, 3)
        along = np.einsum("kij,ki->kj", J, pull)
        N = (W - share @ by_turn).sum(axis=0) + np.eye(ELEMENTS) / _UNKNOWN**2
        remainder = (pull - np.einsum("kij,kj->ki", share, along)).sum(axis=0) + u / _UNKNOWN**2
        step = -np.linalg.solve(N, remainder)
        turn = -np.einsum("kij,kj->ki", K, along + by_turn @ step)
        R_nb, u = R_nb @ exp(turn), u + step
        if max(np.abs(step).max(), np.abs(turn).max()) < _SETTLED:
            break
    return R_nb
