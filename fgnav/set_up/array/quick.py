"""A quick solve for checks: attitudes of the array and motion by code, epoch by epoch."""

from dataclasses import dataclass

import numpy as np

from fgnav.attitude.array import agreeing
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import FloatArray, NoSolutionError
from fgnav.gnss.single_point.solution import code_solution
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight

_FEWEST = 20  # epochs that say anything of motion


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Quick:
    """What the GNSS array alone says of a flight, at epochs that have it all."""

    t_s: FloatArray  # (n,)
    R_nb: FloatArray  # (n, 3, 3)
    covariance_rad2: FloatArray  # (n, 3, 3)
    # p_n_m, v_n_mps: (n, 3); of the first antenna
    p_n_m: FloatArray
    v_n_mps: FloatArray
    gravity_n_mps2: FloatArray  # (n, 3)


def quick_solve(flight: Flight, differences: DoubleDifferences) -> Quick:
    """Solve each epoch on its own.

    Raises
    ------
    NoSolutionError
        If fewer than 20 epochs have attitude, position and velocity.
    """
    code = code_solution(flight)
    if code.v_n_mps is None:
        raise NoSolutionError("no Doppler, so no velocity")
    integers = Constrained()(differences, flight)
    _, attitude, _ = agreeing(RotationQuadratic.of_double_differences(differences, integers))
    if attitude.unobservable():
        raise NoSolutionError(f"the array leaves {' '.join(attitude.unobservable())} open")
    good = np.flatnonzero(
        attitude.solved & attitude.consistent() & ~attitude.open_axis_b.any(axis=1)
    )
    _, rows, of_code = np.intersect1d(differences.t_s[good], code.t_s, return_indices=True)
    moving = np.isfinite(code.v_n_mps[of_code]).all(axis=1)
    rows, of_code = good[rows[moving]], of_code[moving]
    if len(rows) < _FEWEST:
        raise NoSolutionError(f"{len(rows)} epochs have attitude, position and velocity")
    p_n_m = code.p_n_m[of_code]
    return Quick(
        t_s=differences.t_s[rows],
        R_nb=attitude.R_nb[rows],
        covariance_rad2=attitude.covariance_rad2[rows],
        p_n_m=p_n_m,
        v_n_mps=code.v_n_mps[of_code],
        gravity_n_mps2=flight.origin.gravity_n_mps2(p_n_m),
    )
