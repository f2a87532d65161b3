"""Diagnosis of a flight: checks in closed form, none before those that it relies on."""

from dataclasses import replace

import numpy as np
from scipy.special import fdtri

from fgnav.checks import NoSolutionError
from fgnav.diagnostics.antennas import antenna_finding
from fgnav.diagnostics.array import ArrayAttitudes, sight_finding
from fgnav.diagnostics.axes import axes_finding, gyroscope_finding
from fgnav.diagnostics.baselines import baseline_findings
from fgnav.diagnostics.clock import COARSE_S, Clock, Search, clock_of, clock_searches, coarse_offset
from fgnav.diagnostics.contents import (
    Diagnosis,
    Finding,
    contents,
    instrument_findings,
    sample_findings,
)
from fgnav.diagnostics.track import LONGEST, Motion, middle_of, where_it_moves
from fgnav.diagnostics.units import magnetometer_finding, mean_forces, unit_finding
from fgnav.diagnostics.vehicle import mounting_finding, velocity_finding
from fgnav.diagnostics.windows import FALSE_ALARM
from fgnav.gnss.difference import double_differences
from fgnav.gnss.single_point.fixes import fixes_by_code
from fgnav.gnss.single_point.solution import code_solution
from fgnav.types.flight import Fixes, Flight, Imu
from fgnav.types.observations import Observations

_LEAP_S = 18  # GPS time ahead of UTC since 2017
_ARRAY = 3  # antennas of an attitude
_QUICK = 200  # epochs of raw data that a quick check uses
_TRIED, _SOLVED = 20, 0.5  # epochs; share with a position below which their time is doubted
_ARM_M, _ARM_SIGMA_M = 0.2, 0.05  # to which lever arms are measured on a vehicle


class _Findings:
    """Findings and checks that were not possible, as they come."""

    def __init__(self) -> None:
        self.found: list[Finding] = []
        self.unchecked: list[Finding] = []

    def add(self, *findings: Finding | None) -> bool:
        """Add findings; return True if there are any."""
        new = [finding for finding in findings if finding is not None]
        self.found += new
        return bool(new)

    def skip(self, name: str, reason: str) -> None:
        """Add a check that was not possible."""
        self.unchecked.append(Finding(name, reason))


def describe(flight: Flight, *, quick: bool = False) -> Diagnosis:
    """Return contents of a flight and every mistake of its set-up that its data show.

    Parameters
    ----------
    flight : Flight
    quick : bool
        Only what costs a small part of an estimate: no clock, no lever arm, no mounting, and of raw
        GNSS data the middle of the flight.

    Examples
    --------
    >>> import fgnav
    >>> from fgnav.diagnostics import describe
    >>> describe(fgnav.load_flight("demo/flight")).findings
    ()
    """
    diagnosis, out = contents(flight), _Findings()
    samples = [] if flight.imu is None else sample_findings(flight.imu)
    out.add(*samples)
    if not any(finding.certain for finding in samples):
        out.add(*instrument_findings(flight))
        out.add(*baseline_findings(flight))
        _check_motion(flight, out, quick=quick)
    return replace(
        diagnosis, findings=(*diagnosis.findings, *out.found), unchecked=tuple(out.unchecked)
    )


def _check_motion(flight: Flight, out: _Findings, *, quick: bool) -> None:
    """Check GNSS, then everything else against it."""
    observations, fixes, array = flight.observations, flight.first_fixes, None
    if observations is not None and len(observations.t_s):
        if not quick and out.add(_leap_finding(flight, observations)):
            return None
        flight = replace(flight, observations=middle_of(observations, _QUICK if quick else LONGEST))
        try:
            fixes = None
            differences = double_differences(flight) if len(flight.antennas) > 1 else None
            if differences is not None and out.add(antenna_finding(flight, differences)):
                return out.skip("motion", "not before the antennas are right")
            fixes = fixes_by_code(flight)
            if differences is not None and len(flight.antennas) >= _ARRAY:
                array = ArrayAttitudes(flight, differences, fixes)
        except NoSolutionError as error:
            out.skip("motion", str(error))
    if flight.imu is not None and len(flight.imu.t_s) > 1:
        _check_imu(flight, flight.imu, fixes, array, out, quick=quick)
    try:
        if flight.photodetector is not None and array is not None and not quick:
            out.add(sight_finding(flight, flight.photodetector, array))
    except NoSolutionError as error:
        out.skip("photodetector", str(error))
    return None


def _check_imu(
    flight: Flight,
    imu: Imu,
    fixes: Fixes | None,
    array: ArrayAttitudes | None,
    out: _Findings,
    *,
    quick: bool,
) -> None:
    """Check units by magnitude, then axes, then clock, lever arm and mounting."""
    forces = None if fixes is None else mean_forces(fixes, flight.origin)
    if fixes is not None and fixes is flight.first_fixes:
        finding = velocity_finding(where_it_moves(fixes))
        if finding is not None and finding.certain:
            fixes = replace(fixes, v_n_mps=None, velocity_sigma_mps=None)
        out.add(None if finding is not None and quick and not finding.certain else finding)
    checks = [unit_finding(imu, forces)]
    if flight.magnetometer is not None:
        checks.append(magnetometer_finding(flight.magnetometer, imu, forces))
    if array is not None:
        checks.append(gyroscope_finding(imu, array))
    out.add(*checks)
    if any(finding is not None and finding.certain for finding in checks):
        out.skip("imu axes, clock, lever arm", "not before its units and axes are right")
    elif fixes is None or ((fixes.t_s >= imu.t_s[0]) & (fixes.t_s <= imu.t_s[-1])).sum() < 2:
        reason = "requires fixes, or raw GNSS data of three antennas, within its record"
        out.skip("imu axes, clock, lever arm", reason)
    elif array is None and imu.w_b_radps is None:
        out.skip("imu axes, clock, lever arm", "requires a gyroscope")
    else:
        motion = Motion.from_flight(flight, imu, fixes if array is None else array.fixes, array)
        if not quick:
            _check_all(flight, motion, out)
        elif axes_finding(motion, 0.0) is not None:  # with another clock they may be right
            coarse = coarse_offset(clock_searches(motion, motion.integrals_at()))
            out.add(axes_finding(motion, 0.0 if coarse is None else coarse.offset_s))


def _check_all(flight: Flight, motion: Motion, out: _Findings) -> None:
    """Check axes, clock, lever arm and mounting."""
    integrals_at = motion.integrals_at()
    searches = clock_searches(motion, integrals_at)
    coarse = coarse_offset(searches)
    near = next((s for s in searches if s.is_better and abs(s.offset_s) <= COARSE_S), None)
    best = coarse or near
    start_s = 0.0 if best is None else best.offset_s
    clocks = [clock_of(motion, series, integrals_at, start_s) for series in motion.series]
    fitted = [clock for clock in clocks if clock is not None]
    if not fitted:
        return out.skip("imu axes, clock, lever arm", "too few epochs of GNSS within its record")
    main = min(fitted, key=lambda clock: (clock.bound_s, np.trace(clock.arm_covariance_m2)))
    # With a clock that fits them axes may be right that seem wrong beside it.
    offsets_s = [start_s, *([main.offset_s] if main.bound_s < COARSE_S else [])]
    axes = [axes_finding(motion, offset_s) for offset_s in offsets_s]
    if None not in axes and out.add(axes[0]):
        return out.skip("imu clock, lever arm", "not before its axes are right")
    if any(finding.name == "velocity delay" for finding in out.found):
        main = fitted[0]  # by positions
    _check_clock(main, searches, coarse, motion.imu, out)
    _check_arm(main, motion, flight, out)
    if motion.attitudes is None:
        integrals = integrals_at(main.offset_s)
        mounting, certain = mounting_finding(motion.fixes, integrals, main, flight.vehicle)
        if mounting is not None:
            (out.found if certain else out.unchecked).append(mounting)
    return None


def _check_clock(
    clock: Clock, searches: list[Search], coarse: Search | None, imu: Imu, out: _Findings
) -> None:
    """Test for an offset that chance and half a sample do not explain."""
    half_s = float(np.median(np.diff(imu.t_s))) / 2
    offset_s, evidence = clock.offset_s, f"(± {clock.sigma_s:.3f} s)"
    if coarse is not None and not clock.bound_s < COARSE_S:
        offset_s, evidence = coarse.offset_s, str(coarse)
    if coarse is not None or max(clock.bound_s, half_s) < abs(offset_s) <= COARSE_S:
        leap = ", the leap seconds of UTC" if round(abs(offset_s)) == _LEAP_S else ""
        text = f"timestamps are {-offset_s:+.3f} s off those of GNSS{leap} {evidence}"
        mend, where = f"add {offset_s:+.3f} s to [imu] clock_offset_s", "[imu] samples, t_s"
        out.add(Finding("imu clock", text, mend, where, certain=coarse is not None))
    elif not any(search.is_unique and abs(search.offset_s) <= COARSE_S for search in searches):
        shown = "; ".join(
            f"{-s.offset_s:+.1f} or {-s.runner_up_s:+.1f} s by {s.by}" for s in searches
        )
        reason = f"offset not observable from this motion ({shown})"
        out.skip("imu clock", reason if shown else "too few windows with motion")


def _check_arm(clock: Clock, motion: Motion, flight: Flight, out: _Findings) -> None:
    """Test by Hotelling's T squared whether the lever arm errs by more than it is measured to."""
    array, dof = motion.attitudes, clock.arm_dof
    if array is not None and motion.imu.w_b_radps is None and not array.rates_exceed_noise():
        return out.skip("imu lever arm", "body rates do not exceed the noise of attitudes")
    if dof < 3:
        return out.skip("imu lever arm", "too few windows with rotation")
    error_b_m = clock.arm_b_m - motion.arm_b_m
    covariance = clock.arm_covariance_m2 + _ARM_SIGMA_M**2 * np.eye(3)
    statistic = float(error_b_m @ np.linalg.solve(covariance, error_b_m))
    sigma_m = float(np.sqrt(np.linalg.eigvalsh(clock.arm_covariance_m2)[-1]))
    if statistic * (dof - 2) / (3 * dof) > fdtri(3, dof - 2, 1 - FALSE_ALARM):
        antenna_b_m = flight.antenna(motion.fixes.antenna).position_b_m
        shown = ", ".join(f"{x:.2f}" for x in antenna_b_m - clock.arm_b_m + 0.0)
        error_m = np.linalg.norm(error_b_m)
        text = f"velocities put it {error_m:.2f} m from its place (± {sigma_m:.2f} m)"
        mend = f"position_b_m = [{shown}] of the imu would fit"
        out.add(Finding("imu lever arm", text, mend, "[imu] position_b_m"))
    elif sigma_m > _ARM_M:
        out.skip("imu lever arm", f"the motion determines it to {sigma_m:.2f} m only")
    return None


def _leap_finding(flight: Flight, observations: Observations) -> Finding | None:
    """Return a finding where code fits satellites only with times moved by the leap seconds."""
    if _share_solved(flight, observations) >= _SOLVED:
        return None
    for leap_s in (_LEAP_S, -_LEAP_S):
        t_s, tag_s = observations.t_s + leap_s, observations.tag_s + leap_s
        share = _share_solved(flight, replace(observations, t_s=t_s, tag_s=tag_s))
        if share >= _SOLVED:
            text = (
                f"code fits the satellites only {leap_s:+.0f} s later ({100 * share:.0f} % of "
                "epochs have a position, as given none): UTC taken for GPS time?"
            )
            return Finding("gnss clock", text)
    return None


def _share_solved(flight: Flight, observations: Observations) -> float:
    """Return the share of a few epochs that have a position by code."""
    tracked = np.flatnonzero(observations.tracked[:, 0].sum(axis=1) > 3)
    chosen = np.linspace(0, len(tracked) - 1, min(_TRIED, len(tracked))).astype(np.int64)
    chosen_epochs = replace(flight, observations=observations[tracked[chosen]])
    try:
        return len(code_solution(chosen_epochs).t_s) / max(len(chosen), 1)
    except NoSolutionError:
        return 0.0
