"""Which of array and inertial unit is turned: each is tried, and confirmed with it taken back."""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

from scipy.special import expit

from fgnav.checks import FloatArray
from fgnav.frontend.prepared import BodyAxes
from fgnav.graph.turned import ARRAY_TURN, UNIT_TURN
from fgnav.identification.array.turn import after, turned_back
from fgnav.identification.identify import Identified
from fgnav.identification.tested_constants import TestedVector
from fgnav.types.flight import Flight

_EITHER = 0.5  # where nothing tells which is turned: unit and array are both set up by hand
Told: TypeAlias = tuple[Identified, FloatArray]  # and what the unit's tags are moved by
# Identification of a flight whose tags are moved, with a turn tested by its name.
Again: TypeAlias = Callable[[Flight, FloatArray, str], Told | None]


class Turn(NamedTuple):
    """By how much the array is turned against the unit, and whose axes are the body's."""

    found: TestedVector
    axes: BodyAxes

    def back(self, flight: Flight) -> Flight:
        """Return a flight whose sensors all stand in the body's axes."""
        return turned_back(flight, self.found.off, of_array=self.axes.of_array)


def chosen_turn(
    flight: Flight, told: Told, again: Again, *, arbitrated: bool
) -> tuple[Turn | None, Told]:
    """Return a turn of the array against the unit, and what the flight says with it taken back.

    Where nothing else tells which is turned, the array's axes are the body's: places of antennas
    are stated, turns of a unit mostly left out.

    Parameters
    ----------
    flight : Flight
    told : tuple of Identified and ndarray
        With the unit's turn tested.
    again : callable
    arbitrated : bool
        Whether other sensors see directions in the body's axes.
    """
    found, moved = told
    unit = _confirmed(flight, told, again, UNIT_TURN)
    if not arbitrated or not (found.used.any() or found.is_turned):
        return (None, told) if unit is None else unit.chosen(_EITHER)
    other = again(flight, moved, ARRAY_TURN)
    array = None if other is None else _confirmed(flight, other, again, ARRAY_TURN)
    if unit is not None and array is not None:
        ahead = unit.ahead_of(array.told[0])
        return (unit if ahead >= 0.0 else array).chosen(float(expit(abs(ahead))))
    one = unit or array
    if one is None or one.ahead_of(found) < 0.0:
        return None, told
    return one.chosen(max(_EITHER, float(expit(one.ahead_of(found)))))


class _Confirmed(NamedTuple):
    """A turn, and what the flight says with it taken back."""

    turn: TestedVector
    name: str
    told: Told

    def ahead_of(self, other: Identified) -> float:
        """Return by how many nats it is likelier."""
        return self.told[0].likelihood - other.likelihood

    def chosen(self, share: float) -> tuple[Turn, Told]:
        """Return it as the turn that there is."""
        axes = BodyAxes(of_array=self.name == UNIT_TURN, share=share)
        return Turn(self.turn, axes), self.told


def _confirmed(flight: Flight, told: Told, again: Again, name: str) -> _Confirmed | None:
    """Return a turn that is there as well once it has been taken back; None if there is none."""
    found, moved = told
    if found.turn is None or not found.is_turned:
        return None
    of_array = name == UNIT_TURN
    second = again(turned_back(flight, found.turn.off, of_array=of_array), moved, name)
    if second is None or second[0].turn is None:
        return None
    whole = after(found.turn.off, second[0].turn, of_array=of_array)
    return _Confirmed(whole, name, second) if whole.significant else None
