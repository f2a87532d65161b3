"""Output of commands on a terminal; with ``cli`` the only module that prints."""

import logging
import os
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from fgnav.progress import watched_by, watcher

if TYPE_CHECKING:
    from rich.progress import Progress

    from fgnav.diagnostics import Diagnosis
    from fgnav.evaluation.comparison import Comparison
    from fgnav.evaluation.report.parts import Blocks

_LOG = logging.getLogger("fgnav")
_PIPE_WIDTH = 120  # columns of a table that goes to no terminal
# Of `fgnav demo` where nothing is compiled yet, on a core that others share.
_KERNELS, _COMPILING_S = 24, 25


class Steps:
    """Steps of a piece of work, so many in all: each is shown while it lasts, with its share."""

    def __init__(self, steps: int, show: Callable[[str, float], None]) -> None:
        self._steps, self._show, self._done, self._what = steps, show, 0, ""

    @contextmanager
    def __call__(self, what: str) -> Iterator[None]:
        """Show one step while it lasts; work inside it may ``report`` its share."""
        self._what, began_s = what, perf_counter()
        self.share(0.0)
        with watched_by(self.share):
            yield
        self.share(1.0)
        self._done += 1
        _LOG.info("%s: %.1f s", what, perf_counter() - began_s)

    def share(self, share: float) -> None:
        """Show which share of the step at work is done."""
        self._show(self._what, (self._done + share) / self._steps)


@contextmanager
def progress(steps: int) -> "Iterator[Steps]":
    """Show so many steps on a terminal: which is at work, the share done, the time to come.

    Nothing on a pipe. Within a step of other work, the share of that work is all that is shown.
    """
    outer = watcher()
    if outer is not None:
        yield Steps(steps, lambda _, share: outer(share))
        return
    with _bars() as shown:
        task = shown.add_task("", total=1.0)
        yield Steps(steps, lambda what, to: shown.update(task, description=what, completed=to))


@contextmanager
def _bars() -> "Iterator[Progress]":
    """Show bars on a terminal while this lasts, and one that counts kernels while they compile."""
    from rich.console import Console  # noqa: PLC0415  # lazy: keeps the command line quick
    from rich.progress import (  # noqa: PLC0415
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    from fgnav.kernels.announcement import announced_to  # noqa: PLC0415

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    hidden = not console.is_terminal or not _LOG.isEnabledFor(logging.WARNING)
    with Progress(*columns, console=console, disable=hidden, transient=True) as shown:
        kernels = shown.add_task("", total=_KERNELS, visible=False)

        def compiling(name: str) -> None:
            shown.advance(kernels)
            text = f"Compiling once, about {_COMPILING_S} s: {name}"
            shown.update(kernels, description=text, visible=True)

        with announced_to(compiling):
            yield shown


def width() -> int:
    """Return the columns of the terminal, or of COLUMNS; as a table needs where neither is."""
    return shutil.get_terminal_size((_PIPE_WIDTH, 24)).columns


def show_lines(lines: Sequence[str]) -> None:
    """Print lines, folded at words with a hanging indent; each whole on a pipe without COLUMNS."""
    folds = sys.stdout.isatty() or "COLUMNS" in os.environ
    for line in lines:
        if folds:
            indent = " " * (len(line) - len(line.lstrip()) + 2)
            line = textwrap.fill(  # noqa: PLW2901  # the same line, folded
                line,
                max(width(), 20),
                subsequent_indent=indent,
                break_long_words=False,
                break_on_hyphens=False,
            )
        print(line)


def show_report(files: Sequence[Path]) -> None:
    """Print that a report is more than the one file that was asked for, where it is."""
    if len(files) > 1:
        first, second, *_ = files
        show_lines([f"{first} and {len(files) - 1} more, by parts: {second.name} and so on"])


def show_names(texts: Mapping[str, str]) -> None:
    """Print names with a text each, the texts folded beside them."""
    indent = max(map(len, texts), default=0) + 2
    for name, text in texts.items():
        print(
            textwrap.fill(
                text,
                max(width(), indent + 20),
                initial_indent=name.ljust(indent),
                subsequent_indent=" " * indent,
                break_long_words=False,
                break_on_hyphens=False,
            )
        )


def check_outputs(
    flight: Path,
    json: str | None = None,
    *,
    report: Path | None = None,
    folder: Path | None = None,
) -> None:
    """Raise where results could not be written, or would replace what the flight is made of.

    Better before minutes of work.

    Parameters
    ----------
    flight : Path
    json : str, optional
        File of figures; a dash is standard output.
    report : Path, optional
        File of a report.
    folder : Path, optional
        That of an estimate.
    """
    from fgnav.checks import BadInputError  # noqa: PLC0415  # lazy, like all below
    from fgnav.io.atomic_write import check_folder, check_place  # noqa: PLC0415
    from fgnav.io.exports.tables import ESTIMATE, SUMMARY  # noqa: PLC0415
    from fgnav.io.flight.folder import files_of  # noqa: PLC0415

    paths = [] if report is None else [report]
    if json is not None and json != "-":
        check_place(Path(json))
        paths.append(Path(json))
    if folder is not None:
        check_folder(folder)
        paths += [folder / ESTIMATE, folder / SUMMARY]
    paths = [path for path in paths if path.exists()]
    for recorded in files_of(flight) if paths else ():
        for path in paths:
            if recorded.exists() and recorded.samefile(path):
                raise BadInputError(f"{path}: is a file of the flight itself; name another")


def show_blocks(blocks: "Blocks") -> None:
    """Print tables and paragraphs of a report."""
    from fgnav.evaluation.report.text import text_lines  # noqa: PLC0415  # lazy, like all below

    print("\n".join(text_lines(blocks, width())))


def show_comparison(comparison: "Comparison") -> None:
    """Print the table of a comparison and what is to be said of it."""
    from fgnav.evaluation.report.summary import method_table, remarks  # noqa: PLC0415

    show_blocks([method_table(comparison)])
    show_lines(remarks(comparison))


def show_diagnosis(diagnosis: "Diagnosis") -> None:
    """Print what is in a flight, what is wrong with it, and what could not be checked."""
    from fgnav.evaluation.report.summary import unused_lines  # noqa: PLC0415

    facts = list(_facts(diagnosis))
    name_width = max(len(name) for name, _ in facts)
    lines = [diagnosis.flight]
    lines += [f"  {name:<{name_width}} {text}" for name, text in facts]
    lines.append("findings" if diagnosis.findings else "no findings")
    lines += [f"  {finding}" for finding in diagnosis.findings]
    lines += ["not checked"] if diagnosis.unchecked else []
    lines += [f"  {unchecked}" for unchecked in diagnosis.unchecked]
    show_lines([*lines, *(f"  {line}" for line in unused_lines({"files": diagnosis.unused}))])


def _facts(diagnosis: "Diagnosis") -> Iterator[tuple[str, str]]:
    """Yield what is in a flight, a name and a line each."""
    yield "antennas", f"{len(diagnosis.antennas)}: {' '.join(diagnosis.antennas)}".rstrip(": ")
    yield "channels", ", ".join(f"{n} × {name}" for name, n in diagnosis.channels.items()) or "none"
    yield "orbits", ", ".join(diagnosis.orbits) or "none"
    yield "gyroscope", "yes" if diagnosis.gyroscope else "no"
    for name, series in diagnosis.series.items():
        yield name, str(series)


def show_shipped(package: str, kind: str, name: str | None, json: str | None) -> None:
    """Print the files of a kind that come with a package, with what each is; or one of them."""
    from fgnav.json_file import check_places, write_json  # noqa: PLC0415  # lazy, like all below
    from fgnav.shipped import file_or_shipped, shipped, summary  # noqa: PLC0415

    check_places(json)
    if name is not None:
        print(file_or_shipped(name, package, kind).read_text(encoding="utf-8"), end="")
        return
    texts = {stem: summary(file) for stem, file in shipped(package, kind).items()}
    write_json(json, texts)
    if json != "-":
        show_names(texts)
