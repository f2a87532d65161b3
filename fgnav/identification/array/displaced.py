"""An antenna far from its place: phases fit the array only without it, and others tell where it is.

An integer vector that fits every phase to millimetres exists only for the true shape of an array.
Where the stated shape fits no epoch, one without an antenna that fits has attitudes; by them the
antenna's phases are whole cycles at its place alone. Millimetres, beside which integers are still
found, are ``frontend.array.misplaced``'s.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.attitude.array import maximum_likelihood
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import FloatArray, IntArray
from fgnav.frontend.calibration_request import calibration_requests
from fgnav.frontend.settings import ProblemSettings
from fgnav.gnss.difference import double_differences
from fgnav.identification.array.places import with_reference
from fgnav.integers.array.search import search_constrained
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Antenna, Flight
from fgnav.types.observations import Observations

_ATTITUDE = 3  # antennas of an attitude, beside which another is seen
_EPOCHS = 40  # that decide between shapes; a wrong one fails nearly all of them
_EPOCHS_OF_PLACE = 300  # whose code tells where a displaced antenna is, to a few centimetres
_NODES = 20_000  # of a search; a wrong shape finds nothing, and is not looked into for long
_FITS = 6.0  # squared residuals per freedom: phase noise up to 2.4 times the stated
WRONG, RIGHT = 0.5, 0.75  # shares of epochs that fit
_REACH_M, _STEP_M = 0.6, 0.04  # of the search for its place; a peak is a quarter wave wide
_PHASES = 200  # that are tried at each place
_ROUNDS = 3
_WHOLE_M = 0.02  # left of a phase at the right place: random ones leave a quarter wave


class Displaced(NamedTuple):
    """An antenna that is elsewhere than stated."""

    antenna: int
    position_b_m: FloatArray  # (3,)

    def undone(self, flight: Flight) -> Flight:
        """Return a flight whose antenna is stated to be where its phases put it."""
        antennas = list(flight.antennas)
        antennas[self.antenna] = replace(antennas[self.antenna], position_b_m=self.position_b_m)
        return with_reference(replace(flight, antennas=tuple(antennas)), int(self.antenna == 0))

    def estimated(self, settings: ProblemSettings, name: str) -> ProblemSettings:
        """Return settings by which its place is estimated, unless that is asked for."""
        if any(one.kind == "antenna" for one in settings.calibration):
            return settings
        request = calibration_requests([f"antenna:{name}"])
        return replace(settings, calibration=(*settings.calibration, *request))

    def sentence(self, antennas: Sequence[Antenna]) -> str:
        """Return what is to be said of it."""
        one = antennas[self.antenna]
        off_b_m = self.position_b_m - one.position_b_m
        along = ", ".join(f"{x:+.3f}" for x in off_b_m)
        return (
            f"Antenna {one.name} is {np.linalg.norm(off_b_m):.2f} m off its place: phases fit the "
            f"array only without it, and by the others' attitudes put it {along} m along x_b, y_b, "
            "z_b; estimated with the flight from there."
        )


def with_antennas_in_place(
    flight: Flight, settings: ProblemSettings
) -> tuple[Flight, ProblemSettings, tuple[str, ...]]:
    """Return a flight whose displaced antenna is where its phases put it, estimated, and said."""
    displaced = displaced_antenna(flight)
    if displaced is None:
        return flight, settings, ()
    name, sentence = flight.antennas[displaced.antenna].name, displaced.sentence(flight.antennas)
    return displaced.undone(flight), displaced.estimated(settings, name), (sentence,)


def displaced_antenna(flight: Flight) -> Displaced | None:
    """Return the antenna that is elsewhere; None where phases fit, or fit with none moved."""
    seen = flight.observations
    if seen is None or len(flight.antennas) <= _ATTITUDE:
        return None
    part = _differences(flight, seen, _EPOCHS)
    if not part.resolvable.any() or (stated := fitting(part)) >= WRONG:
        return None
    share, antennas = best_shape(omissions(part))
    if share < max(RIGHT, 2 * stated):
        return None
    (a,) = antennas
    position_b_m = position_by_others(flight, _differences(flight, seen, _EPOCHS_OF_PLACE), a)
    if position_b_m is None:
        return None
    places_b_m = np.stack([antenna.position_b_m for antenna in flight.antennas])
    places_b_m[a] = position_b_m
    moved = replace(part, baselines_b_m=places_b_m[1:] - places_b_m[0])
    return Displaced(a, position_b_m) if fitting(moved) >= RIGHT else None


def _differences(flight: Flight, seen: Observations, count: int) -> DoubleDifferences:
    """Return the differences of up to so many epochs from all over the flight."""
    rows = np.unique(np.linspace(0, len(seen.t_s) - 1, count).astype(np.int64))
    return double_differences(replace(flight, observations=seen[rows]))


def epochs_of_shapes(differences: DoubleDifferences) -> IntArray:
    """Return the epochs by which shapes are compared."""
    return _spread(differences, _EPOCHS)


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


def omissions(part: DoubleDifferences) -> Iterator[tuple[tuple[int, ...], DoubleDifferences]]:
    """Yield each antenna, and the differences of the array without it."""
    antennas = len(part.baselines_b_m) + 1
    for a in range(antennas if antennas > 2 else 0):
        yield (a,), without(part, a)


def best_shape(
    shapes: Iterator[tuple[tuple[int, ...], DoubleDifferences]],
) -> tuple[float, tuple[int, ...]]:
    """Return the share of epochs that the best of some shapes fits, and which it is."""
    return max(((fitting(shape), who) for who, shape in shapes), default=(0.0, ()))


def position_by_others(
    flight: Flight, differences: DoubleDifferences, antenna: int
) -> FloatArray | None:
    """Return an antenna's place, (3,), body axes, seen from the others; None where they cannot."""
    part = differences[_spread(differences, _EPOCHS_OF_PLACE)]
    others = without(part, antenna)
    integers = Constrained(wrong_max=None)(others, flight)
    solution = maximum_likelihood(RotationQuadratic.of_double_differences(others, integers))
    good = np.flatnonzero(solution.solved & solution.consistent())
    if not len(good) or solution.unobservable():
        return None
    if antenna == 0:  # seen from the second antenna
        code_m, phase_m = -part.code_m[good, 0], -part.phase_m[good, 0]
        from_b_m = flight.antennas[1].position_b_m
    else:
        code_m, phase_m = part.code_m[good, antenna - 1], part.phase_m[good, antenna - 1]
        from_b_m = flight.antennas[0].position_b_m
    baseline_b_m = _baseline(
        part[good],
        solution.R_nb[good],
        code_m,
        phase_m,
        flight.antennas[antenna].position_b_m - from_b_m,
    )
    return None if baseline_b_m is None else from_b_m + baseline_b_m


def _spread(differences: DoubleDifferences, count: int) -> IntArray:
    """Return up to so many epochs that have links, from all over the flight."""
    useful = np.flatnonzero(differences.resolvable.any(axis=(1, 2)))
    chosen = np.linspace(0, len(useful) - 1, min(count, len(useful))).astype(np.int64)
    return np.asarray(useful[chosen])


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
