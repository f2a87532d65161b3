"""Run the benchmarks, write bench.json and print a table: ``python -m tests.benchmarks [name]``.

A benchmark is a module beside this one with ``run() -> list[Row]``. A module may list the names of
its rows in ``NAMES``, so that asking for one row does not run the others' modules.
"""

import json
import os
import sys
import traceback
from importlib import import_module
from pathlib import Path
from types import ModuleType

from rich.console import Console
from rich.table import Table

from fgnav.io.atomic_write import write_text
from tests.benchmarks._rows import KEYS, ROOT, Row

HERE = Path(__file__).resolve().parent
BENCH_JSON = ROOT / "bench.json"


def main(only: str = "") -> int:
    """Run all benchmarks, or one; return 1 if any failed or there is none of that name."""
    rows, failed = [], []
    for path in sorted(HERE.glob("[!_]*.py")):
        try:
            module = import_module(f"{__package__}.{path.stem}")
            if not hasattr(module, "run") or not wanted(module, path.stem, only):
                continue
            print(f"{path.stem} …", flush=True)
            found = module.run()
        except Exception:  # noqa: BLE001  # one broken benchmark must not take the others along
            traceback.print_exc()
            failed.append(path.stem)
            continue
        rows += [row for row in found if only in ("", path.stem, row["name"])]
    write_text(BENCH_JSON, json.dumps(rows, indent=2) + "\n")
    show(rows)
    for stem in failed:
        print(f"{stem}: failed")
    if only and not rows:
        print(f"no benchmark is named {only}")
    return int(bool(failed) or not rows)


def wanted(module: ModuleType, stem: str, only: str) -> bool:
    """Return whether a module may have the row asked for."""
    names = getattr(module, "NAMES", None)
    return not only or only == stem or names is None or only in names


def show(rows: list[Row]) -> None:
    """Print the rows as a table."""
    table = Table(*KEYS, title=BENCH_JSON.name)
    for name, *figures, unit, note in (row.values() for row in rows):
        table.add_row(name, *map(figure, figures), unit, note)
    Console(width=None if sys.stdout.isatty() else 140).print(table)


def figure(value: float | None) -> str:
    """Return four digits of a figure, or a dash where there is no peer."""
    return "–" if value is None else f"{value:.4g}"


if __name__ == "__main__":
    # One core: numpy's threads would make small products slower, and their waiting counts as time.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    sys.exit(main(*sys.argv[1:2]))
