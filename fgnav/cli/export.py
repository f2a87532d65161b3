"""The command ``fgnav export``."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from fgnav.terminal import show_lines


def export(
    estimate: Path,
    /,
    *,
    format: Annotated[  # noqa: A002
        str, Parameter(help="tum, pos, kml, gpx, csv, parquet, mcap, or an installed one.")
    ],
    out: Path | None = None,
) -> None:
    """Write an estimate in a format of another program.

    Example: fgnav export demo/smoother --format kml

    Parameters
    ----------
    estimate
        Folder that fgnav run has written, or the estimate.npz in it.
    out
        File to write; by default the estimate's, with the format for a suffix.
    """
    from fgnav.io.atomic_write import check_place  # noqa: PLC0415  # lazy
    from fgnav.io.exports import exporter_named  # noqa: PLC0415
    from fgnav.io.exports.recorded import FILE, load_estimate  # noqa: PLC0415

    write = exporter_named(format)
    file = estimate / FILE if estimate.is_dir() else estimate
    suffix = format if format != "csv" else "full.csv"  # run's own is estimate.csv
    target = file.with_suffix(f".{suffix}") if out is None else out
    check_place(target)
    recorded = load_estimate(file)
    write(recorded, target)
    show_lines([f"{recorded.estimate.method}: {len(recorded.estimate.t_s)} epochs in {target}"])
