"""Arrays whose antennas are not quite where the flight states: phases determine the shape, too.

The quadratic form of the rotation takes baselines in body axes as known. Here the unknowns of an
epoch are the baselines in the frame ``n`` themselves, so that a place in body axes can be estimated
with the flight; with the places known it is the same form.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fgnav.attitude.array import AttitudeSolution, maximum_likelihood
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.geometry.rotations import exp, skew
from fgnav.gnss.clock_free import range_information
from fgnav.graph.types.parameters import Parameter
from fgnav.integers.resolvers.resolve import resolve
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Resolver, fixed_ranges_m

_NOTHING = 1e-10  # relative eigenvalue: rounding
_ITERATIONS = 20
_STEP_M = 1e-5
_MISFIT = 4.0  # times the median: an epoch with wrong integers


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class BaselineForm:
    """Cost of the baselines u, (b, 3), in ``n``: ``|root (u - minimum).ravel()|^2 / 2``."""

    valid: BoolArray  # (n,)
    root: FloatArray  # (n, 3 b, 3 b)
    minimum: FloatArray  # (n, b, 3)
    baselines_b_m: FloatArray  # (b, 3): as the flight states them

    def scatter(self, rows: IntArray, n: int, mine: IntArray | None = None) -> "BaselineForm":
        """Return the form, or (k,) epochs of it, at some, (k,), of n keyframes."""
        mine = np.arange(len(self.valid)) if mine is None else mine
        valid, root = np.zeros(n, dtype=np.bool_), np.zeros((n, *self.root.shape[1:]))
        minimum = np.zeros((n, *self.minimum.shape[1:]))
        valid[rows] = self.valid[mine]
        root[rows], minimum[rows] = self.root[mine], self.minimum[mine]
        return replace(self, valid=valid, root=root, minimum=minimum)

    def with_variance_of(self, form: RotationQuadratic, mine: IntArray) -> "BaselineForm":
        """Return the form, the noise of some epochs, (k,), raised to that of forms of the rotation.

        The same ranges make them, as the places stand by which this one's baselines are known.
        """
        arms_b_m = self.baselines_b_m
        by_rotation = np.einsum("ia,bc->bica", np.eye(3), arms_b_m)
        root = self.root[mine] @ by_rotation.reshape(-1, 9)
        share = np.einsum("nii->n", form.information) / np.einsum("nki,nki->n", root, root)
        scaled = self.root.copy()
        scaled[mine] *= np.sqrt(share)[:, None, None]
        return replace(self, root=scaled)

    @classmethod
    def of_ranges(cls, differences: DoubleDifferences, ranges_m: FloatArray) -> "BaselineForm":
        """Collect double differences without integers; see ``RotationQuadratic.of_ranges``."""
        information, vector = baseline_information(differences, ranges_m)
        values, vectors = np.linalg.eigh(information)
        observable = values > _NOTHING * values[:, -1:].clip(1e-30)
        root = np.sqrt(np.where(observable, values, 0.0))
        inverse = np.where(observable, 1.0 / np.where(observable, values, 1.0), 0.0)
        minimum = np.einsum("nij,nj,nkj,nk->ni", vectors, inverse, vectors, vector)
        return cls(
            valid=values[:, -1] > 0,
            root=root[:, :, None] * vectors.swapaxes(1, 2),
            minimum=minimum.reshape(len(minimum), -1, 3),
            baselines_b_m=differences.baselines_b_m,
        )


def baseline_information(
    differences: DoubleDifferences, ranges_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return information, (n, 3 b, 3 b), and vector, (n, 3 b), of the baselines in ``n``."""
    b = ranges_m.shape[1]
    joint = range_information(differences, ranges_m, np.eye(b))
    by_baseline = np.arange(3 * b).reshape(3, b).T.ravel()
    return joint[:, by_baseline[:, None], by_baseline], joint[:, by_baseline, -1]


def shape_at(
    phases: tuple[DoubleDifferences, FloatArray] | None,
    form: RotationQuadratic | None,
    t_s: FloatArray,
    valid: BoolArray,
    constants: tuple[Parameter, ...],
    names: tuple[str, ...],
) -> BaselineForm | None:
    """Return the form of the baselines at keyframes of an array whose shape is estimated.

    Parameters
    ----------
    phases : tuple of DoubleDifferences and ndarray, or None
        Of the array where its phases place it, and their ranges without integers.
    form : RotationQuadratic or None
        Of the rotation, by the same ranges, at keyframes.
    t_s, valid : ndarray, shape (n,)
        Keyframes, and which of them have an attitude by it.
    constants : tuple of Parameter
        They start where phases place antennas; the baselines returned are those of the flight.
    names : tuple of str
        Of the antennas, the reference first.
    """
    offs = {i: constants[k].start for i, k in enumerate(antenna_parts(constants, names)) if k >= 0}
    if not offs or phases is None or form is None:
        return None
    differences, ranges_m = phases
    row = np.searchsorted(t_s, differences.t_s).clip(max=len(t_s) - 1)
    mine = np.flatnonzero((t_s[row] == differences.t_s) & valid[row])
    form_b = BaselineForm.of_ranges(differences, ranges_m).with_variance_of(form[row[mine]], mine)
    stated_b_m = form_b.baselines_b_m.copy()
    for place, off_b_m in offs.items():
        stated_b_m[place] -= off_b_m
    return replace(form_b.scatter(row[mine], len(t_s), mine), baselines_b_m=stated_b_m)


class FixedPhases(NamedTuple):
    """Double differences, ranges by their integers, and attitudes of the stated array by these."""

    differences: DoubleDifferences
    ranges_m: FloatArray
    attitude: AttitudeSolution


def fixed_phases(flight: Flight, resolver: Resolver) -> FixedPhases:
    """Return the fixed phases of a flight's array."""
    differences, integers = resolve(flight, resolver)
    ranges_m = fixed_ranges_m(differences, integers)
    attitude = maximum_likelihood(RotationQuadratic.of_ranges(differences, ranges_m))
    return FixedPhases(differences, ranges_m, attitude)


def initial_shape(
    flight: Flight, constants: tuple[Parameter, ...], fixed: Callable[[], FixedPhases]
) -> tuple[Flight, tuple[Parameter, ...]]:
    """Return a flight whose array fits its phases, and constants that start there.

    Residuals of an antenna that is some centimetres off would pass for large noise, or for bad
    links. So places are found first from fixed phases alone, attitudes of single epochs beside
    them, by Gauss-Newton; epochs that fit badly have wrong integers and take no part. That only
    decides what phases are tested against, and where the search begins: the prior stays about
    the places that the flight states.

    Parameters
    ----------
    flight : Flight
    constants : tuple of Parameter
        Antennas among them.
    fixed : callable
        Returns the flight's fixed phases.
    """
    parts = antenna_parts(constants, tuple(antenna.name for antenna in flight.antennas))
    places = [i for i, k in enumerate(parts) if k >= 0]
    if not places:
        return flight, constants
    variance_m2 = np.concatenate([np.diag(constants[parts[i]].covariance) for i in places])
    off_m = _shape(fixed(), places, variance_m2)
    moved, started = list(flight.antennas), list(constants)
    for i, off_b_m in zip(places, off_m, strict=True):
        antenna = moved[i + 1]
        moved[i + 1] = replace(antenna, position_b_m=antenna.position_b_m + off_b_m)
        started[parts[i]] = replace(started[parts[i]], start=off_b_m)
    return replace(flight, antennas=tuple(moved)), tuple(started)


def antenna_parts(constants: tuple[Parameter, ...], names: tuple[str, ...]) -> tuple[int, ...]:
    """Find the constant that is the position of each antenna but the reference; -1 of none."""
    places = {constant.name: k for k, constant in enumerate(constants)}
    return tuple(places.get(f"antenna {name}", -1) for name in names[1:])


def _shape(fixed: FixedPhases, places: list[int], variance_m2: FloatArray) -> FloatArray:
    """Compute the errors of antenna positions, (a, 3)."""
    differences, ranges_m, attitude = fixed
    information, vector = baseline_information(differences, ranges_m)
    nominal = differences.baselines_b_m
    R_nb, off_m = attitude.R_nb[attitude.solved], np.zeros((len(nominal), 3))
    J, h = information[attitude.solved], vector[attitude.solved]
    if not len(R_nb):
        return off_m[places]
    columns = np.concatenate([np.arange(3) + 3 * place for place in places])
    prior = np.diag(1.0 / variance_m2)
    for _ in range(_ITERATIONS):
        arms_b_m = nominal + off_m
        u = (R_nb @ arms_b_m.T).swapaxes(1, 2).reshape(len(R_nb), -1)
        slope = h - np.einsum("nij,nj->ni", J, u)
        misfit = np.einsum("ni,nij,nj->n", slope, np.linalg.pinv(J, hermitian=True), slope)
        fits = misfit <= _MISFIT * np.median(misfit)
        by_turn = -(R_nb[:, None] @ skew(arms_b_m)).reshape(len(R_nb), -1, 3)
        by_place = np.zeros((len(R_nb), u.shape[1], len(columns)))
        for k, place in enumerate(places):
            by_place[:, 3 * place : 3 * place + 3, 3 * k : 3 * k + 3] = R_nb
        turn, of_turn = _step(J, slope, by_turn, by_place)
        normal = by_place.swapaxes(1, 2) @ J @ by_place
        right = np.einsum("nji,nj->ni", by_place, slope)
        coupled = by_place.swapaxes(1, 2) @ J @ by_turn
        normal, right = (
            normal - coupled @ of_turn,
            right - np.einsum("nij,nj->ni", coupled, turn),
        )
        current_m = off_m.ravel()[columns]
        step = np.linalg.solve(normal[fits].sum(0) + prior, right[fits].sum(0) - prior @ current_m)
        R_nb = R_nb @ exp(turn - np.einsum("nij,j->ni", of_turn, step))
        off_m.ravel()[columns] += step
        if np.abs(step).max() < _STEP_M:
            break
    return off_m[places]


def _step(
    J: FloatArray, slope: FloatArray, by_turn: FloatArray, by_place: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return each epoch's own turn, (n, 3), and how it changes with the places, (n, 3, 3 a)."""
    weighted = by_turn.swapaxes(1, 2) @ J
    normal = weighted @ by_turn
    inverse = np.linalg.pinv(normal, hermitian=True)
    turn = np.einsum("nij,nkj,nk->ni", inverse, by_turn, slope)
    return turn, inverse @ (weighted @ by_place)
