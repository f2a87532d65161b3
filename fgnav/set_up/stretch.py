"""What a stretch of a flight gives away in a tenth of a second: axes, units, antennas' places.

So much is asked before every estimate. A clock is not: its search takes a third of a smoother's
time on fixes alone.
"""

from dataclasses import replace

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.gnss.difference import double_differences
from fgnav.gnss.single_point.solution import code_solution
from fgnav.set_up.findings import Finding
from fgnav.types.flight import Fixes, Flight

_ARRAY = 3  # antennas of an attitude
_EPOCHS, _EPOCHS_OF_ONE = 200, 600  # looked at of an array, of one antenna


def by_a_stretch(flight: Flight) -> list[Finding]:
    """Return what the middle of a flight excludes by its array, by Doppler, or by fixes."""
    observations = flight.observations
    try:
        if observations is None or not len(observations.t_s):
            return [] if flight.fixes is None else _by_fixes(flight, flight.fixes)
        if len(flight.antennas) >= _ARRAY:
            return _by_array(_middle(flight, _EPOCHS))
        return _axes(flight, _fixes_by_code(_middle(flight, _EPOCHS_OF_ONE)))
    except NoSolutionError:
        return []


def _by_array(flight: Flight) -> list[Finding]:
    from fgnav.set_up.antennas import antenna_findings  # noqa: PLC0415  # lazy: scipy
    from fgnav.set_up.array.inertial import axes_findings  # noqa: PLC0415
    from fgnav.set_up.array.quick import quick_solve  # noqa: PLC0415

    differences = double_differences(flight)
    findings = antenna_findings(flight, differences) if differences.resolvable.any() else []
    if findings or flight.imu is None or len(flight.imu.t_s) < 2:
        return findings
    return axes_findings(flight, flight.imu, quick_solve(flight, differences))


def _by_fixes(flight: Flight, fixes: Fixes) -> list[Finding]:
    """Return whether velocities are no change of positions, else axes and units beside them."""
    from fgnav.identification.track.series import where_it_moves  # noqa: PLC0415  # lazy
    from fgnav.set_up.track.velocities import velocity_findings  # noqa: PLC0415

    if len(fixes.t_s) < 2:
        return []
    return velocity_findings(where_it_moves(fixes))[0] or _axes(flight, fixes)


def _axes(flight: Flight, fixes: Fixes) -> list[Finding]:
    from fgnav.set_up.track.inertial import axes_findings  # noqa: PLC0415  # lazy

    imu = flight.imu
    if imu is None or imu.w_b_radps is None or len(imu.t_s) < 2:
        return []
    return axes_findings(flight, imu, fixes)


def _fixes_by_code(flight: Flight) -> Fixes:
    """Return positions and velocities of the first antenna where both are known."""
    code = code_solution(flight)
    if code.v_n_mps is None or code.velocity_covariance_m2ps2 is None:
        raise NoSolutionError("no Doppler, so no velocity")
    rows = np.isfinite(code.v_n_mps).all(axis=1)
    if rows.sum() < 2:
        raise NoSolutionError("no two epochs with a velocity")
    return Fixes(
        t_s=code.t_s[rows],
        antenna=flight.antennas[0].name,
        p_n_m=code.p_n_m[rows],
        v_n_mps=code.v_n_mps[rows],
        position_sigma_m=np.sqrt(np.einsum("nii->ni", code.position_noise_m2[rows])),
        velocity_sigma_mps=np.sqrt(np.einsum("nii->ni", code.velocity_covariance_m2ps2[rows])),
    )


def _middle(flight: Flight, count: int) -> Flight:
    """Return a flight with so many epochs of its middle."""
    if flight.observations is None:
        return flight
    first = max(len(flight.observations.t_s) - count, 0) // 2
    return replace(flight, observations=flight.observations[slice(first, first + count)])
