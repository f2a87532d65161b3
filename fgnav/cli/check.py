"""The command ``fgnav check``."""

from pathlib import Path

from fgnav.cli.arguments.estimators import load
from fgnav.json_file import JsonFile, write_json
from fgnav.terminal import check_outputs, progress, show_diagnosis


def check(flight: Path, /, *, json: JsonFile = None, strict: bool = False) -> None:
    """Say what is in a flight, and what is wrong with its set-up, by name.

    Example: fgnav check demo/flight

    Parameters
    ----------
    flight
        Folder with a flight.toml.
    strict
        Exit with status 1 if there is a finding.
    """
    from fgnav.checks import NoSolutionError  # noqa: PLC0415  # lazy, like all below
    from fgnav.diagnostics import describe  # noqa: PLC0415

    check_outputs(flight, json)
    with progress(2) as step:
        data = load(flight, step)
        with step("looking for mistakes"):
            diagnosis = describe(data)
    write_json(json, diagnosis.to_dict())
    if json != "-":
        show_diagnosis(diagnosis)
    if strict and diagnosis.findings:
        names = ", ".join(finding.name for finding in diagnosis.findings)
        raise NoSolutionError(f"--strict: the set-up has mistakes: {names}")
