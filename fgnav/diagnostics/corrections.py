"""Mistakes of the set-up that an estimate corrects: antennas exchanged, timestamps, a wrong clock.

Each by a closed-form test at ``FALSE_ALARM``; all else is said by ``describe`` and left as it is.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.diagnostics.antennas import exchanged_antennas
from fgnav.diagnostics.array import ArrayAttitudes
from fgnav.diagnostics.clock import COARSE_S, clock_of, clock_searches, coarse_offset
from fgnav.diagnostics.contents import GAP
from fgnav.diagnostics.track import OFFSET, Motion, fit, fixes_by_code
from fgnav.diagnostics.windows import is_better
from fgnav.gnss.difference import double_differences
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight, Imu

_ARRAY = 3  # antennas of an attitude
_LONGEST = 3000  # epochs of raw data by which timestamps are tested


class ArrayRanges(NamedTuple):
    """Double differences of n epochs, and ranges, (n, b, m), m, NaN where no integer is fixed."""

    differences: DoubleDifferences
    ranges_m: FloatArray


class Corrected(NamedTuple):
    """A flight with corrected set-up, and a note on each correction."""

    flight: Flight
    notes: tuple[str, ...]


def corrected_set_up(flight: Flight, array: ArrayRanges | None = None) -> Corrected:
    """Correct exchanged antennas, a step of inertial timestamps, and a clock offset of seconds.

    A flight without these is returned as it is.

    Parameters
    ----------
    flight : Flight
    array : ArrayRanges, optional
        With integers fixed already: only epochs without are searched for exchanged antennas, and
        attitudes follow without another search.

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
    flight, notes = _with_own_antennas(flight, array)
    imu = flight.imu
    if imu is None or len(imu.t_s) < 3:
        return Corrected(flight, notes)
    motion = _motion(flight, imu, None if notes else array)
    if motion is None:
        return Corrected(flight, notes)
    for correct in (_timestamp_step, _clock_offset):
        corrected = correct(motion)
        if corrected is not None:
            imu, note = corrected
            motion, notes = replace(motion, imu=imu), (*notes, note)
    return Corrected(flight if imu is flight.imu else replace(flight, imu=imu), notes)


def _with_own_antennas(flight: Flight, array: ArrayRanges | None) -> tuple[Flight, tuple[str, ...]]:
    if flight.observations is None or len(flight.antennas) < _ARRAY:
        return flight, ()
    fixed = None
    if array is not None:
        differences = array.differences
        is_open = differences.resolvable & np.isnan(array.ranges_m)
        fixed = np.asarray(~is_open.any(axis=(1, 2)))
    else:
        differences = double_differences(flight)
    exchange = exchanged_antennas(differences, fixed)
    if exchange is None:
        return flight, ()
    first, second = (flight.antennas[i].name for i in exchange.pair)
    note = (
        f"Antennas {first} and {second} exchanged from {exchange.from_s:.1f} to "
        f"{exchange.until_s:.1f} s: log-likelihood ratio {exchange.log_likelihood_ratio:.0f}, "
        f"runner-up pair {exchange.runner_up_ratio:.0f}; corrected."
    )
    return exchange.corrected(flight), (note,)


def _motion(flight: Flight, imu: Imu, array: ArrayRanges | None) -> Motion | None:
    """Return the motion by the gyroscope, else by attitudes of an array; None without a track."""
    observations, fixes, attitudes = flight.observations, flight.fixes, None
    try:
        if observations is not None and len(observations.t_s):
            first = max(len(observations.t_s) - _LONGEST, 0) // 2
            flight = replace(flight, observations=observations[first : first + _LONGEST])
            fixes = fixes_by_code(flight)
            if imu.w_b_radps is None and len(flight.antennas) >= _ARRAY:
                attitudes = (
                    ArrayAttitudes(flight, double_differences(flight), fixes)
                    if array is None
                    else ArrayAttitudes(flight, array.differences, fixes, array.ranges_m)
                )
                fixes = attitudes.fixes
    except NoSolutionError:
        return None
    if fixes is None or len(fixes.t_s) < 2 or (imu.w_b_radps is None and attitudes is None):
        return None
    return Motion.of(flight, imu, fixes, attitudes)


def _timestamp_step(motion: Motion) -> tuple[Imu, str] | None:
    """Return timestamps without the step at the longest gap, if no samples are missing there.

    Of the windows after the gap, the squares left with samples that follow each other are
    significantly smaller than those with missing samples.
    """
    imu, series = motion.imu, motion.series[-1]
    spans_s = np.diff(imu.t_s)
    k, usual_s = int(spans_s.argmax()), float(np.median(spans_s))
    step_s = float(spans_s[k]) - usual_s
    if spans_s[k] <= GAP * usual_s:
        return None
    before, after = (replace(motion, imu=part) for part in (imu[: k + 1], imu[k + 1 :]))
    if min(len(before.imu.t_s), len(after.imu.t_s)) < 3:
        return None
    clock = clock_of(before, series, before.integrals_at(), 0.0)
    is_known = clock is not None and clock.bound_s < COARSE_S
    offset_s = clock.offset_s if clock is not None and is_known else 0.0
    t_s = series.t_s[series.windows.row]
    first_s, last_s = after.imu.t_s[0] + offset_s, after.imu.t_s[-1] + offset_s - step_s
    windows = series.windows.some((t_s[:, 0] >= first_s) & (t_s[:, -1] <= last_s))
    if not len(windows):
        return None
    integrals_at = after.integrals_at()
    given, other = (
        fit(series, integrals_at(one), imu, motion.arm_b_m, windows)[0]
        for one in (offset_s, offset_s - step_s)
    )
    if not is_better(given.squares, other.squares):
        return None
    ratio = float(np.exp(np.log(given.squares / other.squares.clip(1e-300)).mean()))
    note = (
        f"IMU timestamps step by {step_s:+.3f} s after {imu.t_s[k]:.2f} s (± "
        f"{other.sigma(OFFSET):.3f} s): residual squares {ratio:.3g} times those with missing "
        "samples reduced; corrected."
    )
    t_s = np.where(imu.t_s > imu.t_s[k], imu.t_s - step_s, imu.t_s)
    return replace(imu, t_s=t_s), note


def _clock_offset(motion: Motion) -> tuple[Imu, str] | None:
    """Return timestamps with an offset of more than half a second corrected."""
    coarse = coarse_offset(clock_searches(motion, motion.integrals_at()))
    if coarse is None:
        return None
    note = f"IMU clock offset of {-coarse.offset_s:+.3f} s {coarse}; timestamps corrected."
    return motion.imu_at(coarse.offset_s), note
