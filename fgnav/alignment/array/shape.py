"""Arrays whose antennas are not quite where the flight states: phases determine the shape, too.

The quadratic form of the rotation takes baselines in body axes as known. Here the unknowns of an
epoch are the baselines in the frame ``n`` themselves, so that a place in body axes can be estimated
with the flight; with the places known it is the same form.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.alignment.alignment import Alignment
from fgnav.attitude.array import AttitudeSolution, maximum_likelihood
from fgnav.attitude.quadratic import RotationQuadratic, square_root
from fgnav.checks import FloatArray
from fgnav.geometry.rotations import exp, skew
from fgnav.gnss.clock_free import range_information
from fgnav.graph.factors.array_shape import ArrayShape
from fgnav.graph.types.parameters import Parameter
from fgnav.integers.resolvers.resolve import resolve
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Resolver, fixed_ranges_m

_ITERATIONS = 20
_STEP_M = 1e-5
_MISFIT = 4.0  # times the median: an epoch with wrong integers


def baseline_information(
    differences: DoubleDifferences, ranges_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return information, (n, 3 b, 3 b), and vector, (n, 3 b), of the baselines in ``n``."""
    b = ranges_m.shape[1]
    joint = range_information(differences, ranges_m, np.eye(b))
    by_baseline = np.arange(3 * b).reshape(3, b).T.ravel()
    return joint[:, by_baseline[:, None], by_baseline], joint[:, by_baseline, -1]


def array_shape(
    start: Alignment, constants: tuple[Parameter, ...], names: tuple[str, ...]
) -> ArrayShape | None:
    """Return the phases of an array whose shape is estimated: the cost of its baselines in ``n``.

    The noise of an epoch is raised to that of its form of the rotation.

    Parameters
    ----------
    start : Alignment
        At keyframes, by an array where its phases place it.
    constants : tuple of Parameter
        They start where phases place antennas; the baselines returned are those of the flight.
    names : tuple of str
        Of the antennas, the reference first.
    """
    offs = {i: constants[k].start for i, k in enumerate(antenna_parts(constants, names)) if k >= 0}
    if not offs or start.phases is None or start.form is None:
        return None
    differences, ranges_m = start.phases
    epoch = start.epochs_of(differences.t_s)
    information, vector = baseline_information(differences, ranges_m)
    keyframes = np.flatnonzero((epoch >= 0) & start.valid)
    keyframes = keyframes[information[epoch[keyframes]].any(axis=(1, 2))]
    root, minimum = square_root(information[epoch[keyframes]], vector[epoch[keyframes]])
    nominal_b_m = differences.baselines_b_m.copy()
    of_rotation = root @ np.einsum("ia,bc->bica", np.eye(3), nominal_b_m).reshape(-1, 9)
    raised = np.einsum("nii->n", start.form.information[keyframes]) / (of_rotation**2).sum(
        axis=(1, 2)
    )
    for off, off_b_m in offs.items():
        nominal_b_m[off] -= off_b_m
    return ArrayShape(
        row=keyframes,
        root=np.sqrt(raised)[:, None, None] * root,
        minimum_n_m=minimum.reshape(len(keyframes), -1, 3),
        baselines_b_m=nominal_b_m,
        antennas=names[1:],
    )


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
    antennas = [i for i, k in enumerate(parts) if k >= 0]
    if not antennas:
        return flight, constants
    variance_m2 = np.concatenate([np.diag(constants[parts[i]].covariance) for i in antennas])
    off_m = _shape(fixed(), antennas, variance_m2)
    moved, started = list(flight.antennas), list(constants)
    for i, off_b_m in zip(antennas, off_m, strict=True):
        antenna = moved[i + 1]
        moved[i + 1] = replace(antenna, position_b_m=antenna.position_b_m + off_b_m)
        started[parts[i]] = replace(started[parts[i]], start=off_b_m)
    return replace(flight, antennas=tuple(moved)), tuple(started)


def is_shape_estimated(constants: tuple[Parameter, ...]) -> bool:
    """Return True if positions of antennas are among the constants."""
    return any(constant.name.startswith("antenna ") for constant in constants)


def antenna_parts(constants: tuple[Parameter, ...], names: tuple[str, ...]) -> tuple[int, ...]:
    """Find the constant that is the position of each antenna but the reference; -1 of none."""
    index_of = {constant.name: k for k, constant in enumerate(constants)}
    return tuple(index_of.get(f"antenna {name}", -1) for name in names[1:])


def _shape(fixed: FixedPhases, places: list[int], variance_m2: FloatArray) -> FloatArray:
    """Compute the errors of antenna positions, (a, 3)."""
    differences, ranges_m, attitude = fixed
    information, vector = baseline_information(differences, ranges_m)
    nominal = differences.baselines_b_m
    R_nb, off_m = attitude.R_nb[attitude.solved], np.zeros((len(nominal), 3))
    J, h = information[attitude.solved], vector[attitude.solved]
    if not len(R_nb):
        return off_m[places]
    columns = np.concatenate([np.arange(3) + 3 * antenna for antenna in places])
    prior = np.diag(1.0 / variance_m2)
    for _ in range(_ITERATIONS):
        arms_b_m = nominal + off_m
        u = (R_nb @ arms_b_m.T).swapaxes(1, 2).reshape(len(R_nb), -1)
        slope = h - np.einsum("nij,nj->ni", J, u)
        misfit = np.einsum("ni,nij,nj->n", slope, np.linalg.pinv(J, hermitian=True), slope)
        fits = misfit <= _MISFIT * np.median(misfit)
        by_turn = -(R_nb[:, None] @ skew(arms_b_m)).reshape(len(R_nb), -1, 3)
        by_place = np.zeros((len(R_nb), u.shape[1], len(columns)))
        for k, antenna in enumerate(places):
            by_place[:, 3 * antenna : 3 * antenna + 3, 3 * k : 3 * k + 3] = R_nb
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
    rotation = np.einsum("nij,nkj,nk->ni", inverse, by_turn, slope)
    return rotation, inverse @ (weighted @ by_place)
