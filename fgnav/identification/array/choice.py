"""Which of array, inertial unit and photodetector is turned.

Array and unit are tried, and confirmed with the turn taken back. What sets the detector's axes
against both of them may seem a turn of either, so it is tried where one of these has been found.
"""

from dataclasses import replace
from typing import NamedTuple

from scipy.special import expit

from fgnav.checks import NoSolutionError
from fgnav.frontend.calibration_request import calibration_requests
from fgnav.frontend.prepared import BodyAxes
from fgnav.graph.turned import ARRAY_TURN, UNIT_TURN
from fgnav.identification.array.turn import after, turned_back
from fgnav.identification.noise.identified import Identified
from fgnav.identification.tested_constants import TestedVector
from fgnav.identification.time_tags import AtTags, TagSearch
from fgnav.types.flight import Flight

BORESIGHT = "boresight"
_EITHER = 0.5  # where nothing tells which is turned: unit and array are both set up by hand


class Turn(NamedTuple):
    """By how much the array is turned against the unit, and whose axes are the body's."""

    vector: TestedVector
    axes: BodyAxes

    def back(self, flight: Flight) -> Flight:
        """Return a flight whose sensors all stand in the body's axes."""
        return turned_back(flight, self.vector.off, of_array=self.axes.of_array)


def chosen_turn(
    search: TagSearch, at_tags: AtTags, *, arbitrated: bool
) -> tuple[Turn | None, AtTags]:
    """Return a turn of the array against the unit, and what the flight says with it taken back.

    Where nothing else tells which is turned, the array's axes are the body's: places of antennas
    are stated, turns of a unit mostly left out.

    Parameters
    ----------
    search : TagSearch
    at_tags : AtTags
        With the unit's turn tested.
    arbitrated : bool
        Whether other sensors see directions in the body's axes.
    """
    identified = at_tags.identified
    if identified.turn is None:  # not tested: there is no array, or its places are estimated
        return None, at_tags
    unit = _confirmed(search, at_tags, UNIT_TURN)
    if not arbitrated or not (identified.used.any() or identified.is_turned):
        return (None, at_tags) if unit is None else unit.chosen(_EITHER)
    other = _identified(search, at_tags, ARRAY_TURN)
    array = None if other is None else _confirmed(search, other, ARRAY_TURN)
    if unit is not None and array is not None:
        ahead = unit.ahead_of(array.at_tags.identified)
        return (unit if ahead >= 0.0 else array).chosen(float(expit(abs(ahead))))
    one = unit or array
    if one is None or one.ahead_of(identified) < 0.0:
        return None, at_tags
    return one.chosen(max(_EITHER, float(expit(one.ahead_of(identified)))))


def with_boresight(
    search: TagSearch, at_tags: AtTags, turn: AtTags
) -> tuple[TagSearch, AtTags] | None:
    """Return a flight whose boresight is estimated, and what it says; None if a turn is likelier.

    Parameters
    ----------
    search : TagSearch
    at_tags : AtTags
        With no turn taken back.
    turn : AtTags
        With the chosen one taken back.
    """
    settings = search.settings
    if search.flight.seeker is None or any(one.kind == BORESIGHT for one in settings.calibration):
        return None
    calibration = (*settings.calibration, *calibration_requests([BORESIGHT]))
    estimated = search._replace(settings=replace(settings, calibration=calibration))
    other = _identified(estimated, at_tags, UNIT_TURN)
    if other is None or other.identified.likelihood <= turn.identified.likelihood:
        return None
    vector = other.identified.turn
    return None if vector is not None and vector.significant else (estimated, other)


class _Confirmed(NamedTuple):
    """A turn, and what the flight says with it taken back."""

    turn: TestedVector
    name: str
    at_tags: AtTags

    def ahead_of(self, other: Identified) -> float:
        """Return by how many nats it is likelier."""
        return self.at_tags.identified.likelihood - other.likelihood

    def chosen(self, share: float) -> tuple[Turn, AtTags]:
        """Return it as the turn that there is."""
        axes = BodyAxes(of_array=self.name == UNIT_TURN, share=share)
        return Turn(self.turn, axes), self.at_tags


def _identified(
    search: TagSearch, at_tags: AtTags, name: str, *, is_turned: bool = False
) -> AtTags | None:
    """Return what a flight says with tags moved as far, and a turn tested by its name."""
    try:
        return search.identified(at_tags.moved, name, is_turned=is_turned)
    except NoSolutionError:
        return None


def _confirmed(search: TagSearch, at_tags: AtTags, name: str) -> _Confirmed | None:
    """Return a turn that is significant as well once it has been taken back; else None."""
    turn = at_tags.identified.turn
    if turn is None or not turn.significant:
        return None
    of_array = name == UNIT_TURN
    back = search._replace(flight=turned_back(search.flight, turn.off, of_array=of_array))
    second = _identified(back, at_tags, name, is_turned=True)
    if second is None or second.identified.turn is None:
        return None
    both = after(turn.off, second.identified.turn, of_array=of_array)
    return _Confirmed(both, name, second) if both.significant else None
