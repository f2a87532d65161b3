"""Fixes by code and Doppler: as a receiver would state them."""

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.gnss.single_point.solution import code_solution
from fgnav.types.flight import Fixes, Flight


def fixes_by_code(flight: Flight) -> Fixes:
    """Return positions and velocities of the first antenna by code and Doppler.

    Raises
    ------
    NoSolutionError
        If fewer than two epochs have both.
    """
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
