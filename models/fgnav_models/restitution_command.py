"""The command ``fgnav restitution``; everything heavy is imported when it runs."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path


def restitution(*, out: Path, seeds: int = 3, processes: int = 2) -> None:
    """Restore commanded angles by the source paper's method and by others.

    Ramps and sines of 5 to 45 degrees, in the layout of the paper's Tables 5 to 7: tables.txt,
    tables.csv, runs.csv and restitution.png in a folder. The same seeds give the same bytes.

    Example: fgnav restitution --seeds 3 --out /tmp/restitution

    Parameters
    ----------
    out : Path
        Folder for the tables; made if absent.
    seeds : int
        How many times each motion is flown, each time at another hour with other noise.
    processes : int
        How many flights at a time.
    """
    from fgnav.evaluation.report.save import check_report  # noqa: PLC0415  # lazy, like all below
    from fgnav.io.atomic_write import made_folder  # noqa: PLC0415
    from fgnav_models.restitution import cases, restitute  # noqa: PLC0415
    from fgnav_models.restitution_report import FIGURE, write_report  # noqa: PLC0415

    todo = cases(seeds)
    folder = made_folder(out)
    check_report(folder / FIGURE)
    with _shown(len(todo)) as watch:
        runs = restitute(todo, processes=processes, watch=watch)
    lines = write_report(runs, folder)
    print("\n".join([*lines, f"tables and figure are in {folder}"]))  # noqa: T201


@contextmanager
def _shown(total: int) -> Iterator[Callable[[int], None]]:
    """Show a bar on a terminal, nothing on a pipe."""
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import (  # noqa: PLC0415
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    columns = (TextColumn("flights"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    hidden = not console.is_terminal
    with Progress(*columns, console=console, disable=hidden, transient=True) as bar:
        task = bar.add_task("flights", total=total)
        yield lambda done: bar.update(task, completed=done)
