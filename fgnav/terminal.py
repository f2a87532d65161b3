"""What a command shows on a terminal and writes as JSON; with ``cli`` the only one that prints."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from fgnav.evaluation.comparison import Comparison
    from fgnav.set_up import SetUp

_PIPE_WIDTH = 110  # columns of a table that goes to no terminal


@contextmanager
def progress() -> "Iterator[Progress]":
    """Show steps on a terminal, nothing on a pipe."""
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn  # noqa: PLC0415

    console = Console(stderr=True)
    columns = (
        SpinnerColumn(finished_text="✓"),
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
    )
    hidden = not console.is_terminal
    with Progress(*columns, console=console, disable=hidden, transient=True) as shown:
        yield shown


@contextmanager
def step(shown: "Progress", what: str) -> Iterator[None]:
    """Show one step while it lasts."""
    task = shown.add_task(what, total=1)
    yield
    shown.update(task, completed=1)


def _console() -> "Console":
    """Return standard output; as wide as a table needs where nobody's window limits it."""
    from rich.console import Console  # noqa: PLC0415

    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=_PIPE_WIDTH)


def check_places(json: str | None) -> None:
    """Raise where a file could not be written at the end: better before minutes of work."""
    if json is not None and json != "-":
        from fgnav.evaluation.report.whole_file import check_place  # noqa: PLC0415

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
    from fgnav.evaluation.report.whole_file import write_text  # noqa: PLC0415

    write_text(Path(place), text)


def show_comparison(comparison: "Comparison") -> None:
    """Print the table of a comparison and what is to be said of it."""
    from fgnav.evaluation.report.table import comparison_table, remarks  # noqa: PLC0415

    console = _console()
    console.print(comparison_table(comparison))
    for line in remarks(comparison):
        console.print(line, markup=False, soft_wrap=True)


def show_set_up(set_up: "SetUp") -> None:
    """Print what is in a flight, what is wrong with it, and what could not be checked."""
    from fgnav.evaluation.report.table import loss_lines  # noqa: PLC0415

    print(set_up.flight)
    facts = list(_facts(set_up))
    width = max(len(name) for name, _ in facts)
    for name, text in facts:
        print(f"  {name:<{width}} {text}")
    print("findings" if set_up.findings else "no findings")
    for finding in set_up.findings:
        print(f"  {finding.name}: {finding.text}")
    if set_up.unchecked:
        print("not checked")
    for unchecked in set_up.unchecked:
        print(f"  {unchecked.name}: {unchecked.text}")
    for line in loss_lines({"files": set_up.losses}):
        print(f"  {line}")


def _facts(set_up: "SetUp") -> Iterator[tuple[str, str]]:
    """Yield what is in a flight, a name and a line each."""
    yield "antennas", f"{len(set_up.antennas)}: {' '.join(set_up.antennas)}".rstrip(": ")
    yield "channels", ", ".join(f"{n} × {name}" for name, n in set_up.channels.items()) or "none"
    yield "orbits", ", ".join(set_up.orbits) or "none"
    yield "gyroscope", "yes" if set_up.gyroscope else "no"
    for name, series in set_up.series.items():
        span = f"{series.first_s:.3f} to {series.last_s:.3f} s"
        yield name, f"{series.samples} samples, {series.rate_hz:.4g} Hz, {span}"
