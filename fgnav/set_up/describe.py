"""All that can be said of a flight before it is estimated, a quick solve of its array included."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fgnav.attitude.flight_vectors import track_of
from fgnav.checks import IntArray, NoSolutionError
from fgnav.gnss.difference import double_differences
from fgnav.gnss.single_point.solution import code_solution
from fgnav.set_up.contents import contents
from fgnav.set_up.field_angle import angle_findings
from fgnav.set_up.findings import Finding, SetUp
from fgnav.set_up.instruments import instrument_findings
from fgnav.set_up.mean_force import mean_forces, share_of_least
from fgnav.set_up.samples import sample_findings
from fgnav.set_up.sizes import expected_force, size_findings
from fgnav.set_up.stretch import by_a_stretch
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight, Imu
from fgnav.types.observations import Observations

_LEAP_S = 18.0
_TRIED = 20  # epochs
_APART_S = 1.0  # of a pair of them
_SOLVED = 0.5  # share of epochs with a position below which the time is doubted
_LONGEST = 3000  # epochs that are solved; of a longer flight the stretch that has it all


def describe(flight: Flight, *, quick: bool = False) -> SetUp:
    """Return what a flight holds and every mistake in its set-up that its data give away.

    Quick: only what costs a small part of an estimate: files, sizes, whether velocities are the
    change of positions, places of antennas, axes and units by a stretch of the flight, but no
    clock, whose search takes a third of a smoother's time on fixes alone.

    Raises
    ------
    BadInputError
        Only for input that could not be a flight; mistakes are findings.
    """
    found = contents(flight)
    findings: list[Finding] = []
    unchecked: list[Finding] = []
    samples = [] if flight.imu is None else sample_findings(flight.imu)
    if any(finding.certain for finding in samples):
        return replace(found, findings=(*found.findings, *samples))
    if flight.observations is not None and len(flight.observations.t_s):
        findings, unchecked = (by_a_stretch(flight), []) if quick else _solved_findings(flight)
    elif quick:
        findings = by_a_stretch(flight)
    elif flight.imu is not None:
        findings, unchecked = _track_findings(flight, flight.imu)
    if flight.imu is not None:
        judged = {finding.name.split()[0] for finding in findings}  # by motion, which knows better
        findings += [
            size
            for size in _by_track(flight, flight.imu, quick=quick)
            if size.name.split()[0] not in judged
        ]
    findings = [*samples, *instrument_findings(flight), *findings]
    return replace(found, findings=(*found.findings, *findings), unchecked=tuple(unchecked))


def _solved_findings(flight: Flight) -> tuple[list[Finding], list[Finding]]:
    """Solve the array quickly and hold everything else against it."""
    late = _leap_finding(flight)
    if late is not None:
        return [late], []
    if len(flight.antennas) < 2:
        text = "a single antenna has no baseline"
        return by_a_stretch(flight), [Finding(name="antennas", text=text)]
    differences = double_differences(flight)
    if not differences.resolvable.any():
        return [], [Finding(name="antennas", text="no double differences of code and phase")]
    from fgnav.set_up.antennas import antenna_findings  # noqa: PLC0415  # lazy: scipy

    findings = antenna_findings(flight, differences)
    if findings:
        return findings, [Finding(name="motion", text="until the antennas are right")]
    return _motion_findings(flight, differences[_stretch(flight, differences)])


def _motion_findings(
    flight: Flight, differences: DoubleDifferences
) -> tuple[list[Finding], list[Finding]]:
    from fgnav.set_up.array.inertial import inertial_findings  # noqa: PLC0415  # lazy: scipy
    from fgnav.set_up.array.quick import quick_solve  # noqa: PLC0415
    from fgnav.set_up.array.sight import sight_findings  # noqa: PLC0415

    imu, seeker = flight.imu, flight.seeker
    imu = imu if imu is not None and len(imu.t_s) > 1 else None
    if imu is None and seeker is None:
        return [], []
    try:
        quick = quick_solve(flight, differences)
    except NoSolutionError as error:
        return [], [Finding(name="motion", text=str(error))]
    checks: dict[str, Callable[[], tuple[list[Finding], list[Finding]]]] = {}
    if imu is not None:
        checks["imu"] = lambda: inertial_findings(flight, imu, quick)
    if seeker is not None:
        checks["seeker"] = lambda: (sight_findings(flight, seeker, quick), [])
    findings: list[Finding] = []
    unchecked: list[Finding] = []
    for name, check in checks.items():
        try:
            found, missing = check()
        except NoSolutionError as error:
            found, missing = [], [Finding(name=name, text=str(error))]
        findings += found
        unchecked += missing
    return findings, unchecked


def _track_findings(flight: Flight, imu: Imu) -> tuple[list[Finding], list[Finding]]:
    """Hold fixes and inertial unit against each other."""
    fixes = flight.fixes
    if fixes is None or len(imu.t_s) < 2:
        reason = "needs fixes, or raw GNSS data of three antennas or more"
        return [], [Finding(name="imu axes, lever arm, clock", text=reason)]
    from fgnav.set_up.track.inertial import track_findings  # noqa: PLC0415  # lazy

    return track_findings(flight, imu, fixes)


def _by_track(flight: Flight, imu: Imu, *, quick: bool) -> list[Finding]:
    """Judge samples by the track; quick: of raw data by that of a few pairs of epochs."""
    observations = flight.observations
    try:
        if quick and observations is not None:
            rows = _tracked_rows(observations)
            later = np.searchsorted(observations.t_s, observations.t_s[rows] + _APART_S)
            pairs = np.unique(np.append(rows, later.clip(max=len(observations.t_s) - 1)))
            track = track_of(replace(flight, observations=observations[pairs]))
        else:
            track = track_of(flight)
    except NoSolutionError:  # it has no track
        return size_findings(imu)
    forces = mean_forces(imu, track, flight.origin)
    share = None if forces is None else share_of_least(imu, forces)
    findings = size_findings(imu, expected_force(track, flight.origin), share)
    if findings or forces is None or flight.magnetometer is None:
        return findings
    return angle_findings(imu, flight.magnetometer, forces)


def _leap_finding(flight: Flight) -> Finding | None:
    """Return a finding where code makes sense only with its times moved by the leap seconds."""
    observations = flight.observations
    if observations is None or _share_solved(flight) >= _SOLVED:
        return None
    for leap_s in (_LEAP_S, -_LEAP_S):
        moved = replace(
            observations, t_s=observations.t_s + leap_s, tag_s=observations.tag_s + leap_s
        )
        share = _share_solved(replace(flight, observations=moved))
        if share >= _SOLVED:
            text = (
                f"code fits the satellites only {leap_s:+.0f} s later ({100 * share:.0f} % of "
                "epochs have a position, none as stated): UTC taken for GPS time?"
            )
            return Finding(name="gnss clock", text=text)
    return None


def _share_solved(flight: Flight) -> float:
    """Return the share of a few epochs that have a position by code that fits."""
    observations = flight.observations
    if observations is None:
        return 0.0
    rows = _tracked_rows(observations)
    try:
        return len(code_solution(replace(flight, observations=observations[rows])).t_s) / max(
            len(rows), 1
        )
    except NoSolutionError:
        return 0.0


def _tracked_rows(observations: Observations) -> IntArray:
    """Return a few epochs, evenly over those that track four satellites."""
    tracked = np.flatnonzero(observations.tracked[:, 0].sum(axis=1) > 3)
    return tracked[np.linspace(0, len(tracked) - 1, min(_TRIED, len(tracked))).astype(np.int64)]


def _stretch(flight: Flight, differences: DoubleDifferences) -> slice:
    """Return the epochs to solve: all of a short flight, else those around the first sights."""
    n = len(differences.t_s)
    if n <= _LONGEST:
        return slice(n)
    centre = n // 2
    if flight.seeker is not None and len(flight.seeker.t_s):
        centre = int(np.searchsorted(differences.t_s, np.median(flight.seeker.t_s)))
    first = min(max(centre - _LONGEST // 2, 0), n - _LONGEST)
    return slice(first, first + _LONGEST)
