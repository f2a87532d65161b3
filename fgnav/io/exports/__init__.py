"""Estimates as files: lossless, as the CSV of ``fgnav run``, and in formats of other programs.

An exporter is a function ``(RecordedEstimate, Path) -> None``. Third parties add theirs through the
entry-point group ``fgnav.exporters``.
"""

from collections.abc import Callable
from pathlib import Path

from fgnav import plugins
from fgnav.io.exports.recorded import RecordedEstimate

GROUP = "fgnav.exporters"
EXPORTERS = {
    "tum": "fgnav.io.exports.trajectories:write_tum",
    "pos": "fgnav.io.exports.trajectories:write_pos",
    "kml": "fgnav.io.exports.trajectories:write_kml",
    "gpx": "fgnav.io.exports.trajectories:write_gpx",
    "csv": "fgnav.io.exports.tables:write_csv",
    "parquet": "fgnav.io.exports.tables:write_parquet",
    "mcap": "fgnav.io.exports.mcap:write_mcap",
}


def exporter_named(name: str) -> Callable[[RecordedEstimate, Path], None]:
    """Return the exporter of that format.

    Raises
    ------
    BadInputError
        If there is none; the text lists what there is.

    Examples
    --------
    >>> exporter_named("tum").__name__
    'write_tum'
    """
    exporter: Callable[[RecordedEstimate, Path], None] = plugins.named(
        GROUP, EXPORTERS, name, kind="format"
    )
    return exporter
