"""The simulator as campaigns know it: scenarios by name or file, changed by dotted keys."""

from collections.abc import Mapping
from copy import deepcopy
from datetime import datetime, timedelta
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from fgnav.checks import BadInputError
from fgnav.types.flight import Flight
from fgnav_sim.scenario import Scenario, load_scenario
from fgnav_sim.simulate import simulate


class Simulator:
    """Makes flights of scenarios; see ``fgnav.campaign.sources``."""

    def check(self, scenario: str, changes: Mapping[str, Any]) -> None:
        """Raise ``BadInputError`` unless a scenario, so changed, is one."""
        changed(_loaded(scenario), changes)

    def fly(
        self,
        scenario: str,
        changes: Mapping[str, Any],
        start_shift_s: int,
        rng: np.random.Generator,
    ) -> Flight:
        """Return a flight of a scenario that starts so much later."""
        what = changed(_loaded(scenario), changes)
        later = what.start + timedelta(seconds=start_shift_s)
        return simulate(msgspec.structs.replace(what, start=later), rng)


@lru_cache(maxsize=64)
def _loaded(scenario: str) -> Scenario:
    """Return a scenario by its file, or by name of those that come with the simulator."""
    return load_scenario(Path(scenario))


def changed(scenario: Scenario, changes: Mapping[str, Any]) -> Scenario:
    """Return a scenario with other values under some dotted keys.

    Raises
    ------
    BadInputError
        If a table on the way is not there, a key is unknown, or a value breaks its rule.
    """
    content: dict[str, Any] = msgspec.to_builtins(scenario, builtin_types=(datetime,))
    for key, value in changes.items():
        *tables, name = key.split(".")
        place: Any = content
        for table in tables:
            place = place.get(table) if isinstance(place, dict) else None
        if not isinstance(place, dict):
            raise BadInputError(f"changes.{key}: the scenario has no table {'.'.join(tables)}")
        if name not in place:
            near = get_close_matches(name, place, n=1, cutoff=0.0)
            meant = f"; the nearest known key is {'.'.join([*tables, *near])}" if near else ""
            raise BadInputError(f"changes.{key}: unknown{meant}")
        place[name] = deepcopy(value)  # later keys may change a part of it
    try:
        return msgspec.convert(content, Scenario)
    except msgspec.ValidationError as error:
        raise BadInputError(f"changes: {error}") from None
