"""Velocities that are older than the forces that lead back to them.

What is late by d is of the state before by the mean force of that time. It is taken over a
receiver's usual interval, until velocities prove older: then over their delay, which is identified
again from there, as long as the flight is likelier so.
"""

from dataclasses import replace

from fgnav.checks import NoSolutionError
from fgnav.frontend.calibration_request import calibration_requests, late_s
from fgnav.identification.time_tags import AtTags, TagSearch

_STEPS = 3  # at most: each leaves less than half of what is left
_KIND = "velocity-delay"


def with_late_velocities(search: TagSearch, at_tags: AtTags) -> tuple[TagSearch, AtTags]:
    """Return a search that leads back as far as velocities are late, and what the flight says."""
    for _ in range(_STEPS):
        times = at_tags.identified.times
        delay_s, sigma_s = float(times.value[2]), float(times.sigma[2])
        if not (times.significant[2] and delay_s - sigma_s > late_s(search.settings.calibration)):
            break
        further = _led_back(search, delay_s)
        try:
            after = further.identified(at_tags.moved)
        except NoSolutionError:
            break
        if after is None or after.identified.likelihood <= at_tags.identified.likelihood:
            break
        search, at_tags = further, after
    return search, at_tags


def _led_back(search: TagSearch, delay_s: float) -> TagSearch:
    settings = search.settings
    others = tuple(one for one in settings.calibration if one.kind != _KIND)
    requested = [one for one in settings.calibration if one.kind == _KIND]
    (late,) = requested or calibration_requests([_KIND])
    late = replace(late, start=delay_s)
    return search._replace(settings=replace(settings, calibration=(*others, late)))
