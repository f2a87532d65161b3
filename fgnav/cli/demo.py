"""The command ``fgnav demo``: the others, one after the other."""

import shlex
import tempfile
from pathlib import Path


def demo(folder: Path | None = None, /) -> None:
    """Simulate a minute of flight, compare five methods on it and write one estimate.

    Prints each command before it runs; they can be typed as they stand. Leaves flight/,
    compare.json, report.png with a picture of each part, and smoother/ in a folder.

    Example: fgnav demo my-first-flight

    Parameters
    ----------
    folder
        Where to; made if absent. A new temporary folder where none is given.
    """
    from importlib.util import find_spec  # noqa: PLC0415

    from fgnav.checks import BadInputError  # noqa: PLC0415  # lazy, like all below
    from fgnav.cli.program import run  # noqa: PLC0415

    if folder is not None and folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BadInputError(f"{folder}: must be a new or an empty folder")
    place = Path(tempfile.mkdtemp(prefix="fgnav-demo-")) if folder is None else folder
    flight, figures = str(place / "flight"), ["--json", str(place / "compare.json")]
    place.mkdir(parents=True, exist_ok=True)
    draws = find_spec("matplotlib") is not None
    if draws:
        figures += ["--report", str(place / "report.png")]
    # The flight states its own noise right: identifying it would only compile for longer.
    simple = ["--noise", "stated"]
    for words in (
        ["simulate", "demo", "--seed", "1", "--out", flight],
        ["compare", flight, *simple, *figures],
        ["run", flight, *simple, "--out", str(place / "smoother")],
    ):
        print(f"\n$ fgnav {shlex.join(words)}", flush=True)
        run(words)
    missing = "" if draws else "; pip install 'fgnav[report]' draws report.png, too"
    print(f"\nAll of it is in {place}{missing}")
