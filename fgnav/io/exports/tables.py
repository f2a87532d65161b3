"""Estimates as tables: what ``fgnav run`` leaves, and all that an estimate states."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import euler_sigma
from fgnav.io.atomic_write import atomic_file
from fgnav.io.exports.recorded import RecordedEstimate
from fgnav.io.flight.columns import (
    EULER,
    EULER_SIGMA,
    FORMATS,
    PLACE,
    POSITION_SIGMA,
    VELOCITY,
    VELOCITY_SIGMA,
    Block,
    Samples,
    samples,
)
from fgnav.io.flight.local_frame import attitude_of_n, place_of_n, velocity_of_n
from fgnav.io.tables import write_table
from fgnav.types.estimate import Estimate
from fgnav.types.estimate_table import estimate_table

ESTIMATE, SUMMARY = "estimate.csv", "summary.json"


def write_outcome(
    folder: Path, estimate: Estimate, origin: Origin, figures: Mapping[str, Any]
) -> None:
    """Write ``estimate.csv`` and ``summary.json``, its figures and the estimate's sha256.

    Both are on the disk before either takes its name, the summary last: a folder with a summary
    holds the estimate that it speaks of.

    Columns are t_s; latitude_deg, longitude_deg, height_m; vn_mps, ve_mps, vd_mps; roll_deg,
    pitch_deg, yaw_deg; and the standard deviations of what has a covariance. Velocity and attitude
    refer to the NED axes at the vehicle; without a position, to those at the origin. Columns of
    what the method does not estimate are absent.
    """
    place = folder / SUMMARY
    with atomic_file(place) as summary, atomic_file(folder / ESTIMATE) as table:
        write_table(table, _table(estimate, origin), FORMATS)
        written = {
            "file": ESTIMATE,
            "rows": len(estimate.t_s),
            "sha256": hashlib.sha256(table.read_bytes()).hexdigest(),
        }
        content = json.dumps({**figures, "estimate": written}, indent=2, allow_nan=False)
        summary.write_text(content + "\n", encoding="utf-8")
        place.unlink(missing_ok=True)


def _table(estimate: Estimate, origin: Origin) -> Samples:
    """Return the columns."""
    n = len(estimate.t_s)
    p_n_m = estimate.p_n_m if estimate.p_n_m is not None else np.zeros((n, 3))
    R_ln = origin.local_ned(p_n_m).swapaxes(1, 2)
    blocks = list[Block]()
    if estimate.p_n_m is not None:
        blocks.append((PLACE, place_of_n(origin, p_n_m)))
    if estimate.v_n_mps is not None:
        blocks.append((VELOCITY, velocity_of_n(origin, p_n_m, estimate.v_n_mps)))
    blocks.append((EULER, attitude_of_n(origin, p_n_m, estimate.R_nb)))
    if estimate.position_covariance_m2 is not None:
        blocks.append((POSITION_SIGMA, _sigma(estimate.position_covariance_m2, R_ln)))
    if estimate.velocity_covariance_m2ps2 is not None:
        blocks.append((VELOCITY_SIGMA, _sigma(estimate.velocity_covariance_m2ps2, R_ln)))
    if estimate.attitude_covariance_rad2 is not None:
        sigma_rad = euler_sigma(R_ln @ estimate.R_nb, estimate.attitude_covariance_rad2)
        blocks.append((EULER_SIGMA, np.degrees(sigma_rad)))
    return samples(estimate.t_s, *blocks)


def _sigma(covariance: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Return (n, 3) standard deviations of ``jacobian @ x`` for x with the covariance."""
    variance = np.einsum("nij,njk,nik->ni", jacobian, covariance, jacobian)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def write_csv(recorded: RecordedEstimate, path: Path) -> None:
    """Write a CSV of every column, 17 digits each: what is read back is what was estimated."""
    table = _every_column(recorded)
    rows = np.column_stack(list(table.values()))
    with atomic_file(path) as part:
        np.savetxt(part, rows, fmt="%.17g", delimiter=",", header=",".join(table), comments="")


def write_parquet(recorded: RecordedEstimate, path: Path) -> None:
    """Write the same columns as Parquet, with flight, method and GPS time of ``t_s = 0``."""
    try:
        from pyarrow import Table  # noqa: PLC0415  # lazy: an extra
        from pyarrow.parquet import write_table  # noqa: PLC0415
    except ModuleNotFoundError:
        raise BadInputError("parquet needs pyarrow; pip install 'fgnav[tables]'") from None
    about = {
        "flight": recorded.flight,
        "method": recorded.estimate.method,
        "start_gps_s": repr(recorded.start_gps_s),
    }
    with atomic_file(path) as part:
        write_table(Table.from_pydict(_every_column(recorded)).replace_schema_metadata(about), part)


def _every_column(recorded: RecordedEstimate) -> dict[str, FloatArray]:
    """Return the estimate's columns, geodetic places behind the time where it has positions."""
    table = estimate_table(recorded.estimate)
    if recorded.estimate.p_n_m is None:
        return table
    place = place_of_n(recorded.origin, recorded.estimate.p_n_m)
    return {"t_s": table["t_s"], **dict(zip(PLACE, place.T, strict=True)), **table}
