"""Who makes flights of scenarios: the installed simulator, behind an entry point.

The library knows no simulator. One is an object with the two methods of ``FlightSource``, found in
the entry-point group ``fgnav.flight_sources``.
"""

from collections.abc import Mapping
from importlib.metadata import entry_points
from typing import Any, Protocol

import numpy as np

from fgnav.checks import BadInputError
from fgnav.types.flight import Flight

GROUP = "fgnav.flight_sources"


class FlightSource(Protocol):
    """What makes flights whose truth is known."""

    def check(self, scenario: str, changes: Mapping[str, Any]) -> None:
        """Raise ``BadInputError`` unless a scenario, so changed, can be flown."""
        ...

    def fly(
        self,
        scenario: str,
        changes: Mapping[str, Any],
        start_shift_s: int,
        rng: np.random.Generator,
    ) -> Flight:
        """Return a flight of it."""
        ...


def flight_source() -> FlightSource:
    """Return the installed one.

    Raises
    ------
    BadInputError
        If there is none.
    """
    for entry in entry_points(group=GROUP):
        source: FlightSource = entry.load()()
        return source
    raise BadInputError(f"no simulator is installed: nothing stands in entry-point group {GROUP}")
