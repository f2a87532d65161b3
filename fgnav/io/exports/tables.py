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
from fgnav.io.flight import columns as col
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

    Examples
    --------
    >>> recorded = fgnav.load_estimate("run")
    >>> write_outcome(Path(), recorded.estimate, recorded.origin, {"flight": recorded.flight})
    >>> json.loads(Path("summary.json").read_text())["estimate"]["rows"]
    4
    """
    path = folder / SUMMARY
    with atomic_file(path) as summary, atomic_file(folder / ESTIMATE) as table:
        write_table(table, _table(estimate, origin), col.FORMATS)
        written = {
            "file": ESTIMATE,
            "rows": len(estimate.t_s),
            "sha256": hashlib.sha256(table.read_bytes()).hexdigest(),
        }
        content = json.dumps({**figures, "estimate": written}, indent=2, allow_nan=False)
        summary.write_text(content + "\n", encoding="utf-8")
        path.unlink(missing_ok=True)


def _table(estimate: Estimate, origin: Origin) -> col.Samples:
    """Return the columns."""
    n = len(estimate.t_s)
    p_n_m = estimate.p_n_m if estimate.p_n_m is not None else np.zeros((n, 3))
    R_ln = origin.local_ned(p_n_m).swapaxes(1, 2)
    blocks = list[col.Block]()
    if estimate.p_n_m is not None:
        blocks.append((col.PLACE, place_of_n(origin, p_n_m)))
    if estimate.v_n_mps is not None:
        blocks.append((col.VELOCITY, velocity_of_n(origin, p_n_m, estimate.v_n_mps)))
    blocks.append((col.EULER, attitude_of_n(origin, p_n_m, estimate.R_nb)))
    for columns, covariance in (
        (col.POSITION_SIGMA, estimate.position_covariance_m2),
        (col.VELOCITY_SIGMA, estimate.velocity_covariance_m2ps2),
    ):
        if covariance is not None:
            variance = np.einsum("nij,njk,nik->ni", R_ln, covariance, R_ln)
            blocks.append((columns, np.sqrt(np.maximum(variance, 0.0))))
    if estimate.attitude_covariance_rad2 is not None:
        sigma_rad = euler_sigma(R_ln @ estimate.R_nb, estimate.attitude_covariance_rad2)
        blocks.append((col.EULER_SIGMA, np.degrees(sigma_rad)))
    return col.samples(estimate.t_s, *blocks)


def write_csv(recorded: RecordedEstimate, path: Path) -> None:
    """Write a CSV of every column, 17 digits each: what is read back is what was estimated.

    Examples
    --------
    >>> write_csv(fgnav.load_estimate("run"), Path("run.csv"))
    >>> Path("run.csv").read_text().splitlines()[1].split(",")[0]
    '0'
    """
    table = _every_column(recorded)
    rows = np.column_stack(list(table.values()))
    with atomic_file(path) as temporary:
        np.savetxt(temporary, rows, fmt="%.17g", delimiter=",", header=",".join(table), comments="")


def write_parquet(recorded: RecordedEstimate, path: Path) -> None:
    """Write the same columns as Parquet, with flight, method and GPS time of ``t_s = 0``.

    Examples
    --------
    >>> write_parquet(fgnav.load_estimate("run"), Path("run.parquet"))
    """
    try:
        from pyarrow import Table  # noqa: PLC0415  # lazy: an extra
        from pyarrow.parquet import write_table  # noqa: PLC0415
    except ModuleNotFoundError:
        raise BadInputError("parquet needs pyarrow; pip install 'fgnav[tables]'") from None
    metadata = {
        "flight": recorded.flight,
        "method": recorded.estimate.method,
        "start_gps_s": repr(recorded.start_gps_s),
    }
    table = Table.from_pydict(_every_column(recorded)).replace_schema_metadata(metadata)
    with atomic_file(path) as temporary:
        write_table(table, temporary)


def _every_column(recorded: RecordedEstimate) -> dict[str, FloatArray]:
    """Return the estimate's columns, geodetic places behind the time where it has positions."""
    table = estimate_table(recorded.estimate)
    if recorded.estimate.p_n_m is None:
        return table
    coordinates = place_of_n(recorded.origin, recorded.estimate.p_n_m)
    return {"t_s": table["t_s"], **col.vectors(col.PLACE, coordinates), **table}
