"""Foreign recordings as flights, by format name.

An importer is a function ``(path, settings, scratch) -> Recording``: it says what is in one file,
in the flight format's columns and units; ``fgnav.io.importers.assemble`` makes a flight folder of
what one importer or several have found. Third parties add theirs through the entry-point group
``fgnav.importers``.
"""

from pathlib import Path
from typing import NamedTuple, Protocol

from fgnav import plugins
from fgnav.io.importers.recording import Recording
from fgnav.io.importers.settings import Settings

GROUP = "fgnav.importers"


class Format(NamedTuple):
    """A format: its importer, and the marks by which it is recognised."""

    importer: str
    begins: tuple[bytes, ...] = ()  # of the file, as the format's document has it
    line: bytes = b"(?!)"  # pattern of one of the first lines
    suffix: str = ""  # of the name, where the content tells nothing


FORMATS = {
    "csv": Format("text_columns:read_csv", suffix=".csv"),
    "pos": Format("pos:read_pos", line=rb"%.*[ ,;\t]Q[ ,;\t]", suffix=".pos"),
    "kfgins": Format("kfgins:read_kfgins"),
    "ulog": Format("ulog:read_ulog", (b"ULog\x01\x12\x35",)),
    "ardupilot": Format("ardupilot:read_ardupilot", (b"\xa3\x95",), suffix=".bin"),
    "rosbag": Format("ros:read_bag", (b"#ROSBAG", b"SQLite format 3")),
    "mcap": Format("ros:read_bag", (b"\x89MCAP0",)),
    "nmea": Format(
        "receivers:read_stream",
        line=rb".{,80}\$(?:[A-Z]{5}|P[A-Z0-9]+),[\x20-\x7e]*\*[0-9A-Fa-f]{2}\s*$"
        rb"|\$G[A-Z](?:GGA|GNS|RMC),[\x20-\x7e]*\s*$",
        suffix=".nmea",
    ),
    "ubx": Format("receivers:read_stream", (b"\xb5\x62",), suffix=".ubx"),
    "sbf": Format("receivers:read_stream", (b"$@",), suffix=".sbf"),
    "novatel": Format(
        "receivers:read_stream",
        (b"\xaa\x44",),
        line=rb"[#%](?:BESTPOS|BESTVEL|RANGE|HEADING2?)A,",
        suffix=".gps",
    ),
    "rtcm3": Format("receivers:read_stream", (b"\xd3",), suffix=".rtcm3"),
    "rinex": Format(
        "receivers:read_rinex_file",
        line=rb".{60}(?:RINEX VERSION / TYPE|CRINEX VERS)",
        suffix=".crx",
    ),
    "sp3": Format("receivers:read_sp3_file", line=rb"#[a-d][PV]\d{4} ", suffix=".sp3"),
}
IMPORTERS = {name: f"fgnav.io.importers.formats.{spec.importer}" for name, spec in FORMATS.items()}


class Importer(Protocol):
    """Reads one file of a format."""

    def __call__(self, path: Path, settings: Settings, scratch: Path, /) -> Recording:
        """Return the content of a file.

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

    Examples
    --------
    >>> importer_named("ulog").__name__
    'read_ulog'
    """
    importer: Importer = plugins.named(GROUP, IMPORTERS, name, kind="format")
    return importer
