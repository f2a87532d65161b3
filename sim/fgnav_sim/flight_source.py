"""The simulator as campaigns know it: scenarios by name or file, changed by dotted keys."""

from collections.abc import Mapping
from datetime import timedelta
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from fgnav.types.flight import Flight
from fgnav_sim.dispersions import with_values
from fgnav_sim.scenario import Scenario, load_scenario
from fgnav_sim.simulate import simulate


class Simulator:
    """Makes flights of scenarios; see ``fgnav.campaign.fly``."""

    def check(self, scenario: str, changes: Mapping[str, Any]) -> None:
        """Raise ``BadInputError`` unless a scenario, so changed, is one."""
        with_values(_loaded(scenario), changes, "changes")

    def fly(
        self,
        scenario: str,
        changes: Mapping[str, Any],
        start_shift_s: int,
        rng: np.random.Generator,
    ) -> Flight:
        """Return a flight of a scenario that starts so much later."""
        what = with_values(_loaded(scenario), changes, "changes")
        later = what.start + timedelta(seconds=start_shift_s)
        return simulate(msgspec.structs.replace(what, start=later), rng)


@lru_cache(maxsize=64)
def _loaded(scenario: str) -> Scenario:
    """Return a scenario by its file, or by name of those that come with the simulator."""
    return load_scenario(Path(scenario))
