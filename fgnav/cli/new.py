"""The command ``fgnav new``."""

from pathlib import Path

from fgnav.json_file import JsonFile, check_places, write_json
from fgnav.terminal import progress, show_lines


def new(*recordings: Path, out: Path, json: JsonFile = None) -> None:
    """Look at files of any format and write a flight folder to edit.

    Its flight.toml says beside each key what it means, and, marked EDIT, what no file states. Files
    of no known format, such as a README, are named and passed over.

    Example: fgnav new imu.csv rover.pos --out flights/first

    Parameters
    ----------
    recordings
        RINEX, SP3, CSV, .pos, ULog, DataFlash, ROS bags, UBX, SBF, NovAtel, RTCM 3.
    out
        Folder for the flight; made, and refused if it holds anything.
    """
    from tempfile import TemporaryDirectory  # noqa: PLC0415  # lazy, like all below

    from fgnav.checks import BadInputError  # noqa: PLC0415
    from fgnav.evaluation.report.table import loss_lines  # noqa: PLC0415
    from fgnav.io.flight.writer import check_empty  # noqa: PLC0415
    from fgnav.io.importers import importer_named  # noqa: PLC0415
    from fgnav.io.importers.assemble import SETTINGS_NAME, assemble, write  # noqa: PLC0415
    from fgnav.io.importers.comments import comments  # noqa: PLC0415
    from fgnav.io.importers.guess import guessed  # noqa: PLC0415
    from fgnav.io.importers.recognise import UnknownFormatError, recognised  # noqa: PLC0415
    from fgnav.io.importers.settings import Settings  # noqa: PLC0415

    if not recordings:
        raise BadInputError("recordings: name a file to look at, or several")
    check_empty(out)
    check_places(json)
    formats, passed_over = {}, list[UnknownFormatError]()
    for one in recordings:
        try:
            formats[one] = recognised(one)
        except UnknownFormatError as error:
            passed_over.append(error)
    if not formats:
        raise passed_over[0]
    tables = tuple(guessed(one) for one, name in formats.items() if name == "csv")
    settings = Settings(csv=tables)
    with (
        progress(len(recordings) + 1) as step,
        TemporaryDirectory(prefix="fgnav-") as scratch,
    ):
        found = []
        for one, name in formats.items():
            with step(f"reading {one}"):
                found.append(importer_named(name)(one, settings, Path(scratch)))
        with step(f"writing {out}"):
            assembled = assemble(found, settings)
            texts = comments(assembled)
            write(
                assembled, out, verify=False, comments=texts, settings=settings if tables else None
            )
    edits = {key: text.partition("EDIT")[2] for key, text in texts.items() if "EDIT" in text}
    names = {str(one): name for one, name in formats.items()}
    write_json(json, {"folder": str(out), "formats": names, "edit": list(edits)})
    if json != "-":
        lines = [f"{one}: {name}" for one, name in names.items()]
        lines += [f"passed over: {str(error).partition(';')[0]}" for error in passed_over]
        lines += [f"{one.file}: columns guessed, see {out / SETTINGS_NAME}" for one in tables]
        lines += loss_lines({"recording": assembled.flight.losses})
        lines += [f"edit {key}" for key in edits]
        show_lines([*lines, f"written to {out}; edit flight.toml there, then: fgnav check {out}"])
