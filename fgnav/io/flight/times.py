"""Times of a flight's series against each other, before anything is made of them.

One bad time stamp, or a week number that rolled over, would make a gap that whoever bridges it
fills with samples: 600 million of them in a week at 1 kHz.
"""

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.types.flight import Flight

# What is a day apart was not recorded on one flight.
LONGEST_S = 86_400.0
# Samples that gaps may lack at a series' own rate, beyond as many as were recorded: 0.3 GB of
# rotations when they are filled.
MOST_MISSING = 1_000_000


def check_times(flight: Flight) -> None:
    """Raise where a series has a gap, or lies apart from the GNSS record, as no flight's does."""
    series = {name: one.t_s for name, one in flight.records.items()}
    if flight.observations is not None:
        series["observations"] = flight.observations.t_s
    for name, t_s in series.items():
        _check_gaps(name, t_s)
    gnss = next((name for name in series if name.startswith("fixes")), "")
    gnss = "observations" if flight.observations is not None else gnss
    if not gnss:
        return
    first_s, last_s = series[gnss][[0, -1]]
    for name, t_s in series.items():
        off_s = max(float(first_s - t_s[-1]), float(t_s[0] - last_s))
        if off_s > LONGEST_S:
            raise BadInputError(
                f"{name}: times from {t_s[0]:.9g} to {t_s[-1]:.9g} s lie {off_s:.9g} s apart from "
                f"those of {gnss}, {first_s:.9g} to {last_s:.9g} s; look at start, and at the week "
                "number"
            )


def _check_gaps(name: str, t_s: FloatArray) -> None:
    step_s = np.diff(t_s)
    if not len(step_s):
        return
    usual_s = float(np.median(step_s))
    missing = (t_s[-1] - t_s[0]) / usual_s - len(step_s)
    row = int(np.argmax(step_s))
    if step_s[row] > LONGEST_S or missing > max(len(t_s), MOST_MISSING):
        raise BadInputError(
            f"{name}: row {row + 2} of the samples has {t_s[row + 1]:.9g} s after {t_s[row]:.9g} "
            f"s, a gap of {missing:.3g} samples of {usual_s:.3g} s in all; mend the time stamp, or "
            "split the flight there"
        )
