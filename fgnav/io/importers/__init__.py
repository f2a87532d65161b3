"""Foreign recordings as flights, by format name.

An importer is a function ``(path, settings, scratch) -> Recording``: it says what is in one file,
in the flight format's columns and units; ``fgnav.io.importers.assemble`` makes a flight folder of
what one importer or several have found. Third parties add theirs through the entry-point group
``fgnav.importers``.
"""

from pathlib import Path
from typing import Protocol

from fgnav import plugins
from fgnav.io.importers.recording import Recording
from fgnav.io.importers.settings import Settings

GROUP = "fgnav.importers"
_FORMATS = "fgnav.io.importers.formats"
IMPORTERS = {
    "csv": f"{_FORMATS}.text_columns:read_csv",
    "pos": f"{_FORMATS}.pos:read_pos",
    "kfgins": f"{_FORMATS}.kfgins:read_kfgins",
    "ulog": f"{_FORMATS}.ulog:read_ulog",
    "ardupilot": f"{_FORMATS}.ardupilot:read_ardupilot",
    "rosbag": f"{_FORMATS}.ros:read_bag",
    "mcap": f"{_FORMATS}.ros:read_bag",
    "nmea": f"{_FORMATS}.receivers:read_stream",
    "ubx": f"{_FORMATS}.receivers:read_stream",
    "sbf": f"{_FORMATS}.receivers:read_stream",
    "novatel": f"{_FORMATS}.receivers:read_stream",
    "rtcm3": f"{_FORMATS}.receivers:read_stream",
    "rinex": f"{_FORMATS}.receivers:read_rinex_file",
    "sp3": f"{_FORMATS}.receivers:read_sp3_file",
}


class Importer(Protocol):
    """Reads one file of a format."""

    def __call__(self, path: Path, settings: Settings, scratch: Path, /) -> Recording:
        """Return what the file holds.

        Parameters
        ----------
        settings : Settings
            What the user says about the files.
        scratch : Path
            Folder for files that the recording names; it lasts until the flight is written.

        Raises
        ------
        BadInputError
            If the file is damaged, or holds nothing of use: one line that names it and the mend.
        """
        ...


def importer_names() -> tuple[str, ...]:
    """Return the names of all formats: the library's own, then installed ones."""
    return plugins.names(GROUP, IMPORTERS)


def importer_named(name: str) -> Importer:
    """Return the importer of that format.

    Raises
    ------
    BadInputError
        If there is none; the text lists what there is.
    """
    importer: Importer = plugins.named(GROUP, IMPORTERS, name, kind="format")
    return importer
