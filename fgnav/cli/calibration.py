"""The command ``fgnav calibration``."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from fgnav.json_file import JsonFile, write_json
from fgnav.terminal import progress, show_lines


def calibration(
    manifest: Path,
    /,
    *,
    flights: Annotated[list[Path], Parameter(consume_multiple=True)],
    json: JsonFile = None,
) -> None:
    """Judge a network's covariance on flights with truth, beside the constant one that fits them.

    Example: fgnav calibration heading.toml --flights a/flight b/flight

    Parameters
    ----------
    manifest
        TOML or JSON, the ONNX file beside it.
    flights
        Folders with a flight.toml, of flights that it was not trained on.
    """
    from fgnav.cli.arguments.estimators import load  # noqa: PLC0415  # lazy, like all below
    from fgnav.json_file import check_places  # noqa: PLC0415
    from fgnav.neural.calibration import calibration as judged  # noqa: PLC0415

    check_places(json)
    with progress(1 + len(flights)) as step:
        loaded = [load(folder, step) for folder in flights]
        with step("judging"):
            judgement = judged(manifest, [(flight, {}) for flight in loaded])
    write_json(json, asdict(judgement))
    if json != "-":
        show_lines(str(judgement).splitlines())
