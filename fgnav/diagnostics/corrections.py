"""Mistakes of the set-up that an estimate corrects: antennas exchanged, timestamps, a wrong clock.

Each by a closed-form test at ``FALSE_ALARM``; all else is said by ``describe`` and left as it is.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.diagnostics.antennas import Exchange, exchanged_antennas
from fgnav.diagnostics.array import ArrayAttitudes
from fgnav.diagnostics.clock import COARSE_S, clock_of, clock_searches, coarse_offset
from fgnav.diagnostics.contents import GAP
from fgnav.diagnostics.track import LONGEST, OFFSET, Motion, fit, middle_of
from fgnav.diagnostics.windows import is_better
from fgnav.gnss.difference import double_differences
from fgnav.gnss.single_point.fixes import fixes_by_code
from fgnav.messages import note
from fgnav.types.flight import Flight, Imu

_ARRAY = 3  # antennas of an attitude


class Corrected(NamedTuple):
    """A flight with corrected set-up, and a note on each correction."""

    flight: Flight
    notes: tuple[str, ...]


def corrected_set_up(flight: Flight) -> Corrected:
    """Correct exchanged antennas, a step of inertial timestamps, and a clock offset of seconds.

    A flight without these is returned as it is.

    Parameters
    ----------
    flight : Flight

    Returns
    -------
    Corrected

    Examples
    --------
    >>> import fgnav
    >>> from fgnav.diagnostics.corrections import corrected_set_up
    >>> corrected_set_up(fgnav.load_flight("demo/flight")).notes
    ()
    """
    notes: tuple[str, ...] = ()
    exchange = _exchange(flight)
    if exchange is not None:
        notes = (note("W304", exchange=exchange.message(flight)),)
        flight = exchange.corrected(flight)
    imu, motion = flight.imu, _motion(flight)
    if imu is None or motion is None:
        return Corrected(flight, notes)
    for correct in (_timestamp_step, _clock_offset):
        corrected = correct(motion)
        if corrected is not None:
            motion, notes = replace(motion, imu=corrected[0]), (*notes, corrected[1])
    is_same = motion.imu is imu
    return Corrected(flight if is_same else replace(flight, imu=motion.imu), notes)


def _exchange(flight: Flight) -> Exchange | None:
    """Return antennas that are exchanged; None also without a position of the reference antenna."""
    if flight.observations is None or len(flight.antennas) < _ARRAY:
        return None
    try:
        differences = double_differences(flight)
    except NoSolutionError:
        return None
    fixed = np.zeros(len(differences.t_s), dtype=np.bool_)
    return exchanged_antennas(flight, differences, fixed)


def _motion(flight: Flight) -> Motion | None:
    """Return the motion by the gyroscope, else by attitudes of an array; None without a track."""
    imu, observations, fixes, attitudes = flight.imu, flight.observations, flight.first_fixes, None
    has_gyroscope = imu is not None and imu.w_b_radps is not None
    if imu is None or len(imu.t_s) < 3:
        return None
    try:
        if (
            observations is not None
            and len(observations.t_s)
            and (has_gyroscope or len(flight.antennas) >= _ARRAY)
        ):
            flight = replace(flight, observations=middle_of(observations, LONGEST))
            fixes = fixes_by_code(flight)
            if not has_gyroscope:
                attitudes = ArrayAttitudes(flight, double_differences(flight), fixes)
                fixes = attitudes.fixes
    except NoSolutionError:
        return None
    if fixes is None or len(fixes.t_s) < 2 or not (has_gyroscope or attitudes):
        return None
    return Motion.from_flight(flight, imu, fixes, attitudes)


def _timestamp_step(motion: Motion) -> tuple[Imu, str] | None:
    """Return timestamps without the step at the longest gap, if no samples are missing there.

    In the windows after the gap, samples that follow each other leave significantly smaller squares
    than a gap does.
    """
    imu, series = motion.imu, motion.series[-1]
    spans_s = np.diff(imu.t_s)
    k, usual_s = int(spans_s.argmax()), float(np.median(spans_s))
    step_s = float(spans_s[k]) - usual_s
    if spans_s[k] <= GAP * usual_s or not 3 <= k < len(spans_s) - 3:
        return None
    before, after = (replace(motion, imu=samples) for samples in (imu[: k + 1], imu[k + 1 :]))
    clock = clock_of(before, series, before.integrals_at(), 0.0)
    offset_s = clock.offset_s if clock is not None and clock.bound_s < COARSE_S else 0.0
    t_s, after_s = series.t_s[series.windows.row], after.imu.t_s + offset_s
    inside = (t_s[:, 0] >= after_s[0]) & (t_s[:, -1] <= after_s[-1] - step_s)
    if not inside.any():
        return None
    windows, integrals_at = series.windows.some(inside), after.integrals_at()
    given, other = (
        fit(series, integrals_at(shift_s), imu, motion.arm_b_m, windows)[0]
        for shift_s in (offset_s, offset_s - step_s)
    )
    if not is_better(given.squares, other.squares):
        return None
    ratio = float(np.exp(np.log(given.squares / other.squares.clip(1e-300)).mean()))
    of = {"step_s": step_s, "sigma_s": other.sigma(OFFSET), "t_s": imu.t_s[k], "ratio": ratio}
    t_s = np.where(imu.t_s > imu.t_s[k], imu.t_s - step_s, imu.t_s)
    return replace(imu, t_s=t_s), note("W305", **of)


def _clock_offset(motion: Motion) -> tuple[Imu, str] | None:
    """Return timestamps with an offset of more than half a second corrected."""
    coarse = coarse_offset(clock_searches(motion, motion.integrals_at()))
    if coarse is None:
        return None
    message = note("W306", offset_s=-coarse.offset_s, evidence=coarse)
    return motion.imu_at(coarse.offset_s), message
