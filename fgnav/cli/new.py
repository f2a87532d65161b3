"""The command ``fgnav new``."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from fgnav.cli.import_ import FORMATS, unused_lines
from fgnav.json_file import JsonFile, check_places, write_json
from fgnav.terminal import progress, show_lines


def new(
    *recordings: Path,
    out: Path,
    format: Annotated[str | None, Parameter(help=FORMATS)] = None,  # noqa: A002
    json: JsonFile = None,
) -> None:
    """Look at files of any format and write a flight folder to edit.

    Its flight.toml says beside each key what it means, and, marked EDIT, what no file states. Files
    of no known format, such as a README, are named and passed over.

    Example: fgnav new imu.csv rover.pos --out flights/first

    Parameters
    ----------
    recordings
        RINEX, SP3, CSV, .pos, ULog, DataFlash, ROS bags, NMEA, UBX, SBF, NovAtel, RTCM 3; packed
        or not.
    out
        Folder for the flight; made, and refused if it holds anything.
    """
    from tempfile import TemporaryDirectory  # noqa: PLC0415  # lazy, like all below

    from fgnav.checks import BadInputError  # noqa: PLC0415
    from fgnav.io.flight.writer import check_empty  # noqa: PLC0415
    from fgnav.io.importers import importer_named  # noqa: PLC0415
    from fgnav.io.importers.assemble import SETTINGS_NAME, assemble, write  # noqa: PLC0415
    from fgnav.io.importers.comments import comments  # noqa: PLC0415
    from fgnav.io.importers.guess import guess_table  # noqa: PLC0415
    from fgnav.io.importers.recognise import UnknownFormatError, recognise_format  # noqa: PLC0415
    from fgnav.io.importers.settings import Settings  # noqa: PLC0415

    if not recordings:
        raise BadInputError("recordings: name a file to look at, or several")
    check_empty(out)
    check_places(json)
    files, passed_over = dict[Path, tuple[str, Path]](), list[UnknownFormatError]()
    with (
        progress(len(recordings) + 1) as step,
        TemporaryDirectory(prefix="fgnav-") as scratch,
    ):
        for recording in recordings:
            try:
                files[recording] = recognise_format(recording, Path(scratch), format)
            except UnknownFormatError as error:
                passed_over.append(error)
        if not files:
            raise passed_over[0]
        tables = tuple(guess_table(file) for name, file in files.values() if name == "csv")
        settings = Settings(csv=tables)
        imported = []
        for recording, (name, file) in files.items():
            with step(f"reading {recording}"):
                imported.append(importer_named(name)(file, settings, Path(scratch)))
        with step(f"writing {out}"):
            assembled = assemble(imported, settings)
            texts = comments(assembled)
            write(
                assembled, out, verify=False, comments=texts, settings=settings if tables else None
            )
    edits = {key: text.partition("EDIT")[2] for key, text in texts.items() if "EDIT" in text}
    names = {str(recording): name for recording, (name, _) in files.items()}
    unused = assembled.unused
    counted = [asdict(loss) for loss in unused]
    content = {"folder": str(out), "formats": names, "unused": counted, "edit": list(edits)}
    write_json(json, content)
    if json != "-":
        lines = [f"{recording}: {name}" for recording, name in names.items()]
        lines += [f"passed over: {str(error).partition(';')[0]}" for error in passed_over]
        lines += [f"{table.file}: columns guessed, see {out / SETTINGS_NAME}" for table in tables]
        lines += unused_lines(unused)
        lines += [f"edit {key}" for key in edits]
        show_lines([*lines, f"written to {out}; edit flight.toml there, then: fgnav check {out}"])
