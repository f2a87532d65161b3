"""The commands ``fgnav demo`` and ``fgnav warm``: others, one after another."""

import shlex
import tempfile
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

from fgnav.terminal import progress

METHODS = "closed-form,rtk,smoother"
_WARMED = "closed-form,maximum-likelihood,smoother,forward,batch,rtk"
# Scenarios whose sensors differ: an array alone, a detector, one antenna with a magnetometer and a
# barometer. Each is simulated, checked and estimated by these methods; nothing of it is kept.
_FLIGHTS = {"demo": _WARMED, "approach": "smoother,batch", "surroundings": "smoother,batch"}


def demo(folder: Path | None = None, /) -> None:
    """Simulate the flight of the source paper and compare closed form, RTK and smoother on it.

    Prints each command before it runs; they can be typed as they stand. Leaves flight/,
    compare.json, report.html, which any browser shows, and the estimates, each in a folder by its
    method's name, in a folder.

    Example: fgnav demo my-first-flight

    Parameters
    ----------
    folder
        Where to; made if absent. A new temporary folder where none is given.
    """
    from fgnav.checks import BadInputError  # noqa: PLC0415  # lazy, like all below
    from fgnav.cli.program import run  # noqa: PLC0415

    if folder is not None and folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BadInputError(f"{folder}: must be a new or an empty folder")
    target = Path(tempfile.mkdtemp(prefix="fgnav-demo-")) if folder is None else folder
    flight = str(target / "flight")
    figures = ["--json", str(target / "compare.json"), "--report", str(target / "report.html")]
    target.mkdir(parents=True, exist_ok=True)
    # The flight states its own noise right, and LAMBDA finds the integers that the default resolver
    # finds: identifying noise and searching under the array's shape would only take longer.
    simple = ["--noise", "nominal", "--integers", "lambda", "--factors", "gravity"]
    kinds = ["--without", "baselines,gravity,line-of-sight,vehicle"]
    for words in (
        ["simulate", "paper", "--seed", "1", "--out", flight],
        ["compare", flight, "--method", METHODS, *simple, "--out", str(target), *figures],
    ):
        print(f"\n$ fgnav {shlex.join(words)}", flush=True)
        run(words)
    next_words = shlex.join(["compare", flight, "--method", "smoother", *kinds, *simple])
    print(f"\nAll of it is in {target}; report.html shows it.")
    print(f"What each kind of factor is worth, half a minute more:\n$ fgnav {next_words}")


def warm() -> None:
    """Compile everything once, so that no later run waits for it.

    After an install or an update the first run of each command compiles what it uses, a minute in
    all. This does it at one go, such as when an image or a machine is set up.

    Example: fgnav warm
    """
    from fgnav.cli.program import run  # noqa: PLC0415  # lazy: the program knows this command

    with (
        tempfile.TemporaryDirectory(prefix="fgnav-warm-") as folder,
        progress(3 * len(_FLIGHTS)) as step,
    ):
        for name, methods in _FLIGHTS.items():
            flight = str(Path(folder) / name)
            for words in (
                ["simulate", name, "--seed", "1", "--out", flight],
                ["check", flight],
                ["compare", flight, "--method", methods],
            ):
                with step(f"compiling for {words[0]} of {name}"), redirect_stdout(StringIO()):
                    run(words)
    print("compiled; later runs start at once")
