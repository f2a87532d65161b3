"""The command ``fgnav import``."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from fgnav.json_file import JsonFile, check_places, write_json
from fgnav.terminal import progress, show_lines

if TYPE_CHECKING:
    from fgnav.checks import Unused

FORMATS = (
    "Of all files: csv, pos, kfgins, ulog, ardupilot, rosbag, mcap, nmea, ubx, sbf, novatel, "
    "rtcm3, rinex, sp3, or an installed one; else told by each file's content."
)


def unused_lines(unused: "Sequence[Unused]") -> list[str]:
    """Return a line for everything that files hold and the flight has not."""
    return [f"not used: {loss.count} × {loss.what}: {loss.reason}" for loss in unused]


def import_(
    *recordings: Path,
    out: Path,
    format: Annotated[str | None, Parameter(help=FORMATS)] = None,  # noqa: A002
    settings: Path | None = None,
    json: JsonFile = None,
) -> None:
    """Turn foreign recordings into one flight folder.

    Example: fgnav import log.ulg rover.ubx --settings drone.toml --out flights/first

    Parameters
    ----------
    recordings
        The files to read.
    out
        Folder for the flight; made, and refused if it holds anything.
    settings
        TOML with what no file states: columns and units of CSV, antennas, axes of the unit.
    """
    from tempfile import TemporaryDirectory  # noqa: PLC0415  # lazy, like all below

    from fgnav.checks import BadInputError  # noqa: PLC0415
    from fgnav.io.flight.writer import check_empty  # noqa: PLC0415
    from fgnav.io.importers import importer_named  # noqa: PLC0415
    from fgnav.io.importers.assemble import assemble, write  # noqa: PLC0415
    from fgnav.io.importers.recognise import recognise_format  # noqa: PLC0415
    from fgnav.io.importers.settings import read_settings  # noqa: PLC0415

    if not recordings:
        raise BadInputError("recordings: name a file to import, or several")
    given = read_settings(settings)
    check_empty(out)
    check_places(json)
    with (
        progress(len(recordings) + 1) as step,
        TemporaryDirectory(prefix="fgnav-") as scratch,
    ):
        imported = []
        for recording in recordings:
            name, file = recognise_format(recording, Path(scratch), format)
            with step(f"reading {recording}"):
                imported.append(importer_named(name)(file, given, Path(scratch)))
        with step(f"writing {out}"):
            assembled = assemble(imported, given)
            gnss, files = assembled.table.gnss, assembled.files
            write(assembled, out, verify=not files or bool(gnss.navigation or gnss.orbits))
    flight, unused = assembled.table.name, [asdict(loss) for loss in assembled.unused]
    write_json(
        json,
        {
            "flight": flight,
            "folder": str(out),
            "unused": unused,
            "notes": dict(assembled.notes),
            "missing": dict(assembled.missing),
        },
    )
    if json != "-":
        lines = unused_lines(assembled.unused)
        notes = [f"{key}: {text}" for key, text in (assembled.notes | assembled.missing).items()]
        show_lines([f"{flight}: written to {out}", *lines, *notes])
