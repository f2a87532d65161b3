"""The command ``fgnav restitution``; everything heavy is imported when it runs."""

from pathlib import Path

from fgnav.terminal import counting


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
    with counting("flights") as watch:
        runs = restitute(todo, processes=processes, watch=lambda done: watch(done, len(todo)))
    lines = write_report(runs, folder)
    print("\n".join([*lines, f"tables and figure are in {folder}"]))  # noqa: T201
