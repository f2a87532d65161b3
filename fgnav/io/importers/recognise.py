"""Of which format a file is: by its first bytes, by its name where these say nothing."""

import re
from pathlib import Path

from fgnav.checks import BadInputError, quoted
from fgnav.io.importers import importer_names

# First bytes, as the formats' documents have them.
_MAGIC = (
    (b"ULog\x01\x12\x35", "ulog"),
    (b"\xa3\x95", "ardupilot"),
    (b"\xb5\x62", "ubx"),
    (b"$@", "sbf"),
    (b"\xaa\x44", "novatel"),
    (b"\x89MCAP0", "mcap"),
    (b"#ROSBAG", "rosbag"),
    (b"SQLite format 3", "rosbag"),
    (b"#c", "sp3"),
    (b"#d", "sp3"),
    (b"\xd3", "rtcm3"),
)
_SUFFIXES = {
    ".csv": "csv",
    ".pos": "pos",
    ".ubx": "ubx",
    ".sbf": "sbf",
    ".gps": "novatel",
    ".rtcm3": "rtcm3",
    ".nmea": "nmea",
    ".sp3": "sp3",
    ".bin": "ardupilot",
    ".gz": "rinex",
    ".crx": "rinex",
}
_HEAD_BYTES = 4096


class UnknownFormatError(BadInputError):
    """Nothing tells what format a file is of."""


def recognised(path: Path) -> str:
    """Return the name of a file's format.

    Raises
    ------
    BadInputError
        If there is no such file.
    UnknownFormatError
        If nothing tells its format: the text lists what there is.
    """
    if (path / "metadata.yaml").is_file():
        return "rosbag"
    if not path.is_file():
        raise BadInputError(f"{path}: no such file; check the name")
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    for magic, name in _MAGIC:
        if head.startswith(magic):
            return name
    lines = head.split(b"\n")
    if any(mark in lines[0] for mark in (b"RINEX VERSION / TYPE", b"CRINEX VERS")):
        return "rinex"
    if any(line.startswith(b"%") and re.search(rb"[ ,;\t]Q[ ,;\t]", line) for line in lines):
        return "pos"
    if any(re.match(rb"\$[A-Z]{2}(?:GGA|RMC|GNS|GST|ZDA|GLL|VTG|GS[AV]),", one) for one in lines):
        return "nmea"
    named = _SUFFIXES.get(path.suffix.lower())
    if named is None:
        raise UnknownFormatError(
            f"{path}: of no known format, it starts with {quoted(head[:12])}; state it by fgnav "
            f"import --format, one of {', '.join(importer_names())}"
        )
    return named
