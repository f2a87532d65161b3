"""The option ``--json FILE|-`` of every command: its type, its check and its writing."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def _file_or_dash(_type: object, place: str | None) -> None:
    if place is not None and place.startswith("-") and place != "-":
        raise ValueError(f"wants a file or -, got {place!r}")


JsonFile = Annotated[
    str | None,
    Parameter(
        help="Write all figures here; - for standard output, and nothing else is printed there.",
        allow_leading_hyphen=True,
        validator=_file_or_dash,
    ),
]


def check_places(json: str | None) -> None:
    """Raise where a file could not be written at the end: better before minutes of work."""
    if json is not None and json != "-":
        from fgnav.io.atomic_write import check_place  # noqa: PLC0415

        check_place(Path(json))


def write_json(place: str | None, content: object) -> None:
    """Write JSON to a file, or to standard output for a dash."""
    if place is None:
        return
    from json import dumps  # noqa: PLC0415

    text = dumps(content, indent=2, allow_nan=False) + "\n"
    if place == "-":
        sys.stdout.write(text)
        return
    from fgnav.io.atomic_write import write_text  # noqa: PLC0415

    write_text(Path(place), text)
