"""A method at times of the user's own choice: those of a table, or at a steady rate."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fgnav.checks import BadInputError, FloatArray, positive
from fgnav.graph.between import MOST_TIMES
from fgnav.io.tables import read_table
from fgnav.types.estimate import Estimate, Estimator
from fgnav.types.flight import Flight


@dataclass(frozen=True, slots=True, kw_only=True)
class AtTimes:
    """A method's estimates at chosen times instead of its own epochs."""

    name: str
    method: Any  # with ``at``: it knows the motion between its epochs, too
    t_s: FloatArray | None = None  # (m,)
    rate_hz: float | None = None  # one of both

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate; raises as ``method.at`` does."""
        estimate: Estimate = self.method.at(flight, self.t_s, rate_hz=self.rate_hz)
        return estimate


def at_times(method: Estimator, times: Path | None, rate_hz: float | None) -> Estimator:
    """Return a method at the times of a table (a CSV with the column t_s), or at a rate.

    Raises
    ------
    BadInputError
        If both are asked for, the table cannot be read, or the method has no motion model.
    """
    if times is None and rate_hz is None:
        return method
    if times is not None and rate_hz is not None:
        raise BadInputError("--at and --rate: name one of them")
    if not hasattr(method, "at"):
        raise BadInputError(f"--at, --rate: {method.name} knows its own epochs alone")
    if times is not None:
        t_s = read_table(times, ["t_s"])["t_s"]
        if len(t_s) > MOST_TIMES:
            raise BadInputError(
                f"{times}: has {len(t_s)} times, at most {MOST_TIMES} are estimated at once"
            )
        return AtTimes(name=method.name, method=method, t_s=t_s)
    rate = float(rate_hz or 0.0)
    positive("--rate", rate)
    return AtTimes(name=method.name, method=method, rate_hz=rate)
