"""A step of the inertial unit's tags at the longest gap of its record: no samples are missing.

A clock that is set while it runs leaves a gap as lost samples do. Of a flight with the tags
after it put back, so that samples follow each other, and of the flight as it is, the likelier
stands, over the same measurements of GNSS, as it is while the other does not exclude it.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.frontend.gaps import GAP
from fgnav.frontend.settings import ProblemSettings
from fgnav.identification.time_tags import Build, TagSearch
from fgnav.identification.track.candidates import over_common_span
from fgnav.identification.track.windows import EXCLUDED
from fgnav.types.flight import Flight, Imu


class TagStep(NamedTuple):
    """By what tags after a sample are late."""

    after_s: float
    late_s: float

    def undone(self, flight: Flight) -> Flight:
        """Return a flight whose tags go on as before."""
        imu = flight.imu
        return flight if imu is None else replace(flight, imu=self.put_back(imu))

    def put_back(self, imu: Imu) -> Imu:
        """Return a unit whose tags go on as before."""
        t_s = np.where(imu.t_s > self.after_s, imu.t_s - self.late_s, imu.t_s)
        return replace(imu, t_s=t_s)

    @property
    def sentence(self) -> str:
        """What is to be said of it."""
        return (
            f"The inertial unit's tags are {self.late_s:.4f} s late from {self.after_s:.2f} s on, "
            "where no samples are missing: put back."
        )


def tag_step(flight: Flight, settings: ProblemSettings, build: Build) -> TagStep | None:
    """Return the step that is likelier than a gap; None of a record without one."""
    imu = flight.imu
    if imu is None or len(imu.t_s) < 3:
        return None
    spans_s = np.diff(imu.t_s)
    k, usual_s = int(spans_s.argmax()), float(np.median(spans_s))
    if spans_s[k] <= GAP * usual_s:
        return None
    step = TagStep(float(imu.t_s[k]), float(spans_s[k]) - usual_s)
    common = over_common_span(flight, (0.0, -step.late_s))
    stated, put_back = (
        TagSearch(one, settings, build).without_clock(np.zeros(2), (np.zeros(2),)).likelihood
        for one in (common, step.undone(common))
    )
    return step if put_back > stated + EXCLUDED else None
