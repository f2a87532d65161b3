"""Results of raw observations alone, computed once for all problems of a flight.

A flight whose unit is louder, later or turned, or of which more is estimated, is another problem of
the same integers and code: these take most of the time that an array's problem takes.
"""

from dataclasses import dataclass, fields
from functools import cached_property
from typing import NamedTuple

from fgnav.alignment.array.pivot import pivot_views
from fgnav.alignment.array.shape import FixedPhases, fixed_phases
from fgnav.assembly.settings import ProblemSettings
from fgnav.checks import NoSolutionError
from fgnav.gnss.single_point.partial_velocity import PartialVelocity, partial_velocities
from fgnav.gnss.single_point.solution import CodeSolution, code_solution
from fgnav.gnss.undifferenced import Undifferenced, undifferenced
from fgnav.integers.resolvers.resolve import resolve
from fgnav.integers.validation import ValidatedArray, validated
from fgnav.types.flight import Flight
from fgnav.types.instruments import Antenna
from fgnav.types.integers import Resolver

# What observations do not depend on; noise and antennas, which are compared by their values.
_INSTRUMENTS = ("imu", "fixes", "baselines", "photodetector", "barometer", "magnetometer")
_OTHERS = (*_INSTRUMENTS, "vehicle", "standstill", "initial", "gnss_noise", "antennas")
_OWN = tuple(field.name for field in fields(Flight) if field.name not in _OTHERS)
_KEPT = 2  # an array as it is stated, and as its phases place its antennas


class AntennaRecord(NamedTuple):
    """Observations of one antenna, independent of the attitude."""

    antenna: Antenna
    code: CodeSolution
    partial: PartialVelocity | None  # None without Doppler
    observed: Undifferenced


@dataclass(frozen=True, eq=False)
class ByObservations:
    """Phases of a flight's array and records of its antennas."""

    flight: Flight  # with observations
    resolver: Resolver  # is not asked again where the unit or another sensor alone is changed
    false_alarm: float
    causal: bool

    @cached_property
    def array(self) -> tuple[ValidatedArray | None, ...]:
        """Phases of the array by each view of ``pivot_views``; None where one has no integers.

        Raises
        ------
        BadInputError
            If the resolver has no causal form, and needs one.
        NoSolutionError
            If the first has none.
        """
        phases: list[ValidatedArray | None] = []
        for flight, _ in pivot_views(self.flight, causal=self.causal):
            try:
                differences, integers = resolve(flight, self.resolver, causal=self.causal)
            except NoSolutionError:
                if not phases:
                    raise
                phases.append(None)
                continue
            names = tuple(antenna.name for antenna in flight.antennas)
            causal, false_alarm = self.causal, self.false_alarm
            phases.append(validated(differences, integers, names, false_alarm, causal=causal))
        return tuple(phases)

    @cached_property
    def fixed(self) -> FixedPhases:
        """Phases with integers, by the flight's own reference."""
        return fixed_phases(self.flight, self.resolver)

    @cached_property
    def antennas(self) -> tuple[AntennaRecord, ...]:
        """Records of the reference antenna, then of those that stand in for it.

        Raises
        ------
        NoSolutionError
            If none has a single code solution.
        """
        records, failure = [], None
        for view in pivot_views(self.flight, causal=self.causal):
            try:
                records.append(_record(view.flight, causal=self.causal))
            except NoSolutionError as error:
                failure = failure or error
        if not records:
            raise failure or NoSolutionError("position: no antenna has observations")
        return tuple(records)

    def serves_for(self, other: "ByObservations") -> bool:
        """Return True if another flight has the same observations, antennas and settings."""
        ours, theirs = (
            (one.resolver, one.false_alarm, one.causal, one.flight.gnss_noise)
            for one in (self, other)
        )
        return (
            ours == theirs
            and all(getattr(self.flight, name) is getattr(other.flight, name) for name in _OWN)
            and _positions(self.flight) == _positions(other.flight)
        )


def _positions(flight: Flight) -> list[tuple[str, list[float]]]:
    """Return names and positions of antennas, which may be replaced by others at the same place."""
    return [(antenna.name, antenna.position_b_m.tolist()) for antenna in flight.antennas]


class LastObservations:
    """Cache of the latest results, for problems of the same observations."""

    def __init__(self) -> None:
        self._last: tuple[ByObservations, ...] = ()

    def of(self, flight: Flight, settings: ProblemSettings) -> ByObservations | None:
        """Return the results of a flight's observations; None without any."""
        if flight.observations is None:
            return None
        new = ByObservations(flight, settings.resolver, settings.false_alarm, settings.causal)
        by = next((one for one in self._last if one.serves_for(new)), new)
        self._last = (by, *(one for one in self._last if one is not by))[:_KEPT]
        return by


def _record(flight: Flight, *, causal: bool) -> AntennaRecord:
    code = code_solution(flight, causal=causal)
    observed = undifferenced(flight, base=flight.base is not None)
    partial = None
    if code.v_n_mps is not None and code.velocity_covariance_m2ps2 is not None:
        partial = partial_velocities(flight, code.t_s, causal=causal)
    return AntennaRecord(flight.antennas[0], code, partial, observed)
