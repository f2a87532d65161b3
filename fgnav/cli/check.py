"""The command ``fgnav check``."""

from pathlib import Path

from fgnav.cli.arguments.estimators import load
from fgnav.json_file import JsonFile, write_json
from fgnav.terminal import check_outputs, progress, show_diagnosis


def check(flight: Path, /, *, json: JsonFile = None) -> None:
    """Say what is in a flight, and what is wrong with its set-up, by name.

    Example: fgnav check demo/flight

    Parameters
    ----------
    flight
        Folder with a flight.toml.
    """
    from fgnav.diagnostics import describe  # noqa: PLC0415  # lazy, like all below

    check_outputs(flight, json)
    with progress(2) as step:
        data = load(flight, step)
        with step("looking for mistakes"):
            diagnosis = describe(data)
    write_json(json, diagnosis.to_dict())
    if json != "-":
        show_diagnosis(diagnosis)
