"""Everything an estimate states, as a table: full covariances, biases, rates."""

from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.io.atomic_write import atomic_file
from fgnav.io.exports.recorded import RecordedEstimate
from fgnav.io.flight.columns import PLACE
from fgnav.io.flight.local_frame import place_of_n
from fgnav.types.estimate_table import estimate_table


def write_csv(recorded: RecordedEstimate, path: Path) -> None:
    """Write a CSV of every column, 17 digits each: what is read back is what was estimated."""
    table = _table(recorded)
    rows = np.column_stack(list(table.values()))
    with atomic_file(path) as part:
        np.savetxt(part, rows, fmt="%.17g", delimiter=",", header=",".join(table), comments="")


def write_parquet(recorded: RecordedEstimate, path: Path) -> None:
    """Write the same columns as Parquet, with flight, method and GPS time of ``t_s = 0``.

    Raises
    ------
    BadInputError
        If pyarrow is not installed.
    """
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
        write_table(Table.from_pydict(_table(recorded)).replace_schema_metadata(about), part)


def _table(recorded: RecordedEstimate) -> dict[str, FloatArray]:
    """Return the estimate's columns, geodetic places behind the time where it has positions."""
    table = estimate_table(recorded.estimate)
    if recorded.estimate.p_n_m is None:
        return table
    place = place_of_n(recorded.origin, recorded.estimate.p_n_m)
    return {"t_s": table["t_s"], **dict(zip(PLACE, place.T, strict=True)), **table}
