"""Estimates as CSV, in the axes and units that other programs read."""

import os
import tempfile
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.earth import Origin
from fgnav.estimate import Estimate
from fgnav.io.columns import EULER, FORMATS, PLACE, POSITION_SIGMA, VELOCITY, VELOCITY_SIGMA
from fgnav.io.local_frame import attitude_of_n, place_of_n, velocity_of_n
from fgnav.io.tables import write_table
from fgnav.rotations import euler_jacobian

EULER_SIGMA = ("sigma_roll_deg", "sigma_pitch_deg", "sigma_yaw_deg")


def write_estimate(estimate: Estimate, origin: Origin, path: Path) -> None:
    """Write an estimate as CSV; the file appears whole or not at all.

    Columns are t_s; latitude_deg, longitude_deg, height_m; vn_mps, ve_mps, vd_mps; roll_deg,
    pitch_deg, yaw_deg; and the standard deviations of what has a covariance. Velocity and attitude
    refer to the NED axes at the vehicle; without a position, to those at the origin. Columns of
    what the method does not estimate are absent.

    Parameters
    ----------
    estimate : Estimate
    origin : Origin
        Where the frame ``n`` is fixed.
    path : Path

    Raises
    ------
    BadInputError
        If the file cannot be written.
    """
    table = _table(estimate, origin)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}-", dir=path.parent)
        os.close(handle)
    except OSError as error:
        raise BadInputError(f"{path}: cannot be written, {error.strerror}") from error
    temporary = Path(name)
    try:
        write_table(temporary, table, FORMATS)
        temporary.chmod(0o644)
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _table(estimate: Estimate, origin: Origin) -> dict[str, FloatArray]:
    """Return the columns."""
    n = len(estimate.t_s)
    p_n_m = estimate.p_n_m if estimate.p_n_m is not None else np.zeros((n, 3))
    to_n = origin.local_ned(p_n_m)
    table = {"t_s": estimate.t_s}

    def add(names: tuple[str, ...], values: FloatArray) -> None:
        table.update({name: values[:, k] for k, name in enumerate(names)})

    if estimate.p_n_m is not None:
        add(PLACE, place_of_n(origin, p_n_m))
    if estimate.v_n_mps is not None:
        add(VELOCITY, velocity_of_n(origin, p_n_m, estimate.v_n_mps))
    add(EULER, attitude_of_n(origin, p_n_m, estimate.R_nb))
    if estimate.position_covariance_m2 is not None:
        add(POSITION_SIGMA, _sigma(estimate.position_covariance_m2, to_n.swapaxes(1, 2)))
    if estimate.velocity_covariance_m2ps2 is not None:
        add(VELOCITY_SIGMA, _sigma(estimate.velocity_covariance_m2ps2, to_n.swapaxes(1, 2)))
    if estimate.attitude_covariance_rad2 is not None:
        jacobian = euler_jacobian(to_n.swapaxes(1, 2) @ estimate.R_nb)
        add(EULER_SIGMA, np.degrees(_sigma(estimate.attitude_covariance_rad2, jacobian)))
    return table


def _sigma(covariance: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Return (n, 3) standard deviations of ``jacobian @ x`` for x with the covariance."""
    variance = np.einsum("nij,njk,nik->ni", jacobian, covariance, jacobian)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
