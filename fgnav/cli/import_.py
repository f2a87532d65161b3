"""The command ``fgnav import``."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from fgnav.json_file import JsonFile, check_places, write_json
from fgnav.terminal import progress, show_lines


def import_(
    recording: Path,
    /,
    *,
    out: Path,
    format: Annotated[str, Parameter(help="umn, or an installed one.")],  # noqa: A002
    json: JsonFile = None,
) -> None:
    """Turn a foreign recording into a flight folder.

    Example: fgnav import thor75.mat --format umn --out flights/thor75

    Parameters
    ----------
    recording
        The file to read.
    out
        Folder for the flight; made, and refused if it holds anything.
    """
    from fgnav.evaluation.report.table import loss_lines  # noqa: PLC0415  # lazy, like all below
    from fgnav.io.flight.folder import save_flight  # noqa: PLC0415
    from fgnav.io.importers import importer_named  # noqa: PLC0415

    importer = importer_named(format)
    check_places(json)
    with progress(2) as step:
        with step(f"reading {recording}"):
            flight = importer(recording)
        with step(f"writing {out}"):
            save_flight(flight, out)
    losses = [asdict(loss) for loss in flight.losses]
    write_json(json, {"flight": flight.name, "folder": str(out), "losses": losses})
    if json != "-":
        lines = loss_lines({"recording": flight.losses})
        show_lines([f"{flight.name}: written to {out}", *lines])
