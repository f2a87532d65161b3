"""The command ``fgnav warm``: everything that is compiled, compiled before it is needed."""

from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

from fgnav.terminal import progress

_METHODS = "closed-form,maximum-likelihood,smoother,forward,batch,rtk"
# Scenarios whose sensors differ: an array alone, a detector, one antenna with a magnetometer and a
# barometer. Each is simulated, checked and estimated by these methods; nothing of it is kept.
_FLIGHTS = {"demo": _METHODS, "approach": "smoother,batch", "surroundings": "smoother,batch"}


def warm() -> None:
    """Compile everything once, so that no later run waits for it.

    After an install or an update the first run of each command compiles what it uses, a minute in
    all. This does it at one go, such as when an image or a machine is set up.

    Example: fgnav warm
    """
    from fgnav.cli.program import run  # noqa: PLC0415  # lazy: the program knows this command

    with TemporaryDirectory(prefix="fgnav-warm-") as folder, progress(3 * len(_FLIGHTS)) as step:
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
