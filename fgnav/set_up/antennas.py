"""Whether the antennas sit where the flight says: the phases of a rigid array can tell.

An integer vector that fits every phase to millimetres exists only for the true shape of the array.
Where the stated shape fits no epoch, others are tried: two antennas exchanged, one left out.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from fgnav.attitude.array import maximum_likelihood
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import FloatArray, IntArray
from fgnav.integers.array.search import search_constrained
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.set_up.findings import Finding
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight

_EPOCHS = 40  # that decide between shapes; a wrong one fails nearly all of them
_EPOCHS_OF_PLACE = 300  # whose code tells where a misplaced antenna is, to a few centimetres
_NODES = 20_000  # of a search; a wrong shape finds nothing, and is not looked into for long
_FITS = 6.0  # squared residuals per freedom: phase noise up to 2.4 times the stated
_WRONG, _RIGHT = 0.5, 0.75  # shares of epochs that fit
_NOTABLE_M = 0.05
_REACH_M, _STEP_M = 0.6, 0.04  # of the search for its place; a peak is a quarter wave wide
_PHASES = 200  # that are tried at each place
_ROUNDS = 3
_WHOLE_M = 0.02  # left of a phase at the right place: random ones leave a quarter wave


def antenna_findings(flight: Flight, differences: DoubleDifferences) -> list[Finding]:
    """Return which antennas are not where they are said to be, empty if all are."""
    part = differences[_spread(differences, _EPOCHS)]
    stated = fitting(part)
    if stated >= _WRONG or not len(part.t_s):
        return []
    names = [antenna.name for antenna in flight.antennas]
    places_b_m = np.stack([antenna.position_b_m for antenna in flight.antennas])
    evidence = f"the stated places fit {100 * stated:.0f} % of {len(part.t_s)} epochs"
    swapped = _best(_exchanges(places_b_m, part))
    alone = _best(_omissions(part))
    if max(swapped[0], alone[0]) < _RIGHT or max(swapped[0], alone[0]) < 2 * stated:
        text = (
            f"{evidence}; neither an exchange of two nor leaving one out mends it; "
            "check position_b_m of all"
        )
        return [Finding(name="antennas misplaced", text=text)]
    if swapped[0] >= alone[0]:
        i, j = swapped[1]
        text = (
            f"{names[i]} and {names[j]} look exchanged: {evidence}, exchanged "
            f"{100 * swapped[0]:.0f} %; exchange their observations or position_b_m"
        )
        return [Finding(name="antennas exchanged", text=text)]
    (a,) = alone[1]
    text = f"{names[a]} is not at its place: {evidence}, without it {100 * alone[0]:.0f} %"
    return [Finding(name="antenna misplaced", text=text + _where(flight, differences, a))]


def fitting(differences: DoubleDifferences) -> float:
    """Return the share of epochs that some integers fit to the noise of the phase."""
    if not len(differences.t_s):
        return 0.0
    search = search_constrained(differences, _NODES)
    tested = search.degrees > 0
    fits = search.costs[:, 0] <= _FITS * search.degrees
    return float(fits[tested].mean()) if tested.any() else 1.0


def without(differences: DoubleDifferences, antenna: int) -> DoubleDifferences:
    """Return the differences of the other antennas; without the first, against the second."""
    code_m, phase_m = differences.code_m, differences.phase_m
    baselines_b_m = differences.baselines_b_m
    if antenna == 0:
        code_m, phase_m = code_m - code_m[:, :1], phase_m - phase_m[:, :1]
        baselines_b_m = baselines_b_m - baselines_b_m[0]
    row = max(antenna - 1, 0)
    return replace(
        differences,
        baselines_b_m=np.delete(baselines_b_m, row, axis=0),
        code_m=np.delete(code_m, row, axis=1),
        phase_m=np.delete(phase_m, row, axis=1),
        arc=np.delete(differences.arc, row, axis=1),
    )


def _spread(differences: DoubleDifferences, count: int) -> IntArray:
    """Return up to so many epochs that have links, from all over the flight."""
    useful = np.flatnonzero(differences.resolvable.any(axis=(1, 2)))
    chosen = np.linspace(0, len(useful) - 1, min(count, len(useful))).astype(np.int64)
    return np.asarray(useful[chosen])


def _exchanges(
    places_b_m: FloatArray, part: DoubleDifferences
) -> Iterator[tuple[tuple[int, ...], DoubleDifferences]]:
    for i, j in combinations(range(len(places_b_m)), 2):
        order = np.arange(len(places_b_m))
        order[[i, j]] = j, i
        exchanged = places_b_m[order]
        yield (i, j), replace(part, baselines_b_m=exchanged[1:] - exchanged[0])


def _omissions(part: DoubleDifferences) -> Iterator[tuple[tuple[int, ...], DoubleDifferences]]:
    antennas = len(part.baselines_b_m) + 1
    for a in range(antennas if antennas > 2 else 0):
        yield (a,), without(part, a)


def _best(
    shapes: Iterator[tuple[tuple[int, ...], DoubleDifferences]],
) -> tuple[float, tuple[int, ...]]:
    """Return the share of epochs that the best of some shapes fits, and which it is."""
    return max(((fitting(shape), who) for who, shape in shapes), default=(0.0, ()))


def _where(flight: Flight, differences: DoubleDifferences, antenna: int) -> str:
    """Say where a misplaced antenna is, seen from the others; nothing where they cannot tell."""
    part = differences[_spread(differences, _EPOCHS_OF_PLACE)]
    others = without(part, antenna)
    integers = Constrained(wrong_max=None)(others, flight)
    solution = maximum_likelihood(RotationQuadratic.of_double_differences(others, integers))
    good = np.flatnonzero(solution.solved & solution.consistent())
    if not len(good) or solution.unobservable():
        return "; check its position_b_m"
    if antenna == 0:  # seen from the second antenna
        code_m, phase_m = -part.code_m[good, 0], -part.phase_m[good, 0]
        from_b_m = flight.antennas[1].position_b_m
    else:
        code_m, phase_m = part.code_m[good, antenna - 1], part.phase_m[good, antenna - 1]
        from_b_m = flight.antennas[0].position_b_m
    stated_b_m = flight.antennas[antenna].position_b_m
    baseline_b_m = _baseline(
        part[good], solution.R_nb[good], code_m, phase_m, stated_b_m - from_b_m
    )
    if baseline_b_m is None:
        return "; check its position_b_m"
    place_b_m = from_b_m + baseline_b_m
    off_m = float(np.linalg.norm(place_b_m - stated_b_m))
    if np.linalg.norm(place_b_m + stated_b_m) < min(off_m / 4, _NOTABLE_M):
        return "; its position_b_m has the wrong sign"
    shown = ", ".join(f"{x:.2f}" for x in np.round(place_b_m, 2) + 0.0)
    return f"; its phases put it {off_m:.2f} m away, at position_b_m = [{shown}]"


def _wrapped_m(ranges_m: FloatArray, wavelength_m: FloatArray) -> FloatArray:
    """Return ranges less their whole wavelengths."""
    return np.asarray(ranges_m - wavelength_m * np.rint(ranges_m / wavelength_m))


def _baseline(
    part: DoubleDifferences,
    R_nb: FloatArray,
    code_m: FloatArray,
    phase_m: FloatArray,
    stated_b_m: FloatArray,
) -> FloatArray | None:
    """Return one baseline, (3,), body axes, of known attitudes, or None where phases disagree.

    The place, around the stated and around that by code, at which most phases are whole cycles:
    code alone may be off by echoes.
    """
    reference = part.reference[:, part.group].clip(0)[:, :, None]
    e_n = part.e_n - np.take_along_axis(part.e_n, reference, axis=1)
    used = np.isfinite(code_m) & np.isfinite(phase_m) & ~part.is_reference
    A, phase_m = -np.einsum("nmi,nij->nmj", e_n, R_nb)[used], phase_m[used]
    wavelength_m = np.broadcast_to(part.wavelength_m, code_m.shape)[used]
    by_code_b_m = np.linalg.lstsq(A, code_m[used], rcond=None)[0]
    steps_m = np.arange(-_REACH_M, _REACH_M + _STEP_M / 2, _STEP_M)
    some = np.linspace(0, len(A) - 1, min(_PHASES, len(A))).astype(np.int64)
    wave = 2j * np.pi / wavelength_m[some]
    middles_b_m = np.stack([stated_b_m, by_code_b_m])
    middle = np.exp(wave * (phase_m[some] - middles_b_m @ A[some].T))
    # A phase less that of a place is a product over the axes: all places by products of matrices.
    x, y, z = np.exp(-wave * A[some].T[:, None] * steps_m[:, None])
    agreement = ((middle[:, None, None] * x[:, None] * y) @ z.T).real
    at, *steps = np.unravel_index(agreement.argmax(), agreement.shape)
    baseline_b_m = middles_b_m[at] + steps_m[steps]
    for _ in range(_ROUNDS):
        left_m = _wrapped_m(phase_m - A @ baseline_b_m, wavelength_m)
        baseline_b_m = baseline_b_m + np.linalg.lstsq(A, left_m, rcond=None)[0]
    left_m = np.abs(_wrapped_m(phase_m - A @ baseline_b_m, wavelength_m))
    return np.asarray(baseline_b_m) if np.median(left_m) < _WHOLE_M else None
