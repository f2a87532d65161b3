"""The program ``fgnav``: its commands by name, imported when they run; errors and exit status."""

import logging
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from difflib import get_close_matches
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING

from fgnav import __version__

if TYPE_CHECKING:
    from cyclopts import App

    from fgnav.checks import FgnavError

_LONGEST_ERROR = 600  # characters: names of files may have thousands
_HELP = """\
Attitude, position and velocity from recorded flights, with honest uncertainty.

A flight is a folder with a flight.toml and the files it names. Start with:

    fgnav demo

or, step by step:

    fgnav simulate demo --seed 1 --out demo/flight
    fgnav check demo/flight
    fgnav compare demo/flight --report demo/report.png

Exit status: 0 done, 1 no solution, 2 bad input.
"""
# The library's own, each a target and its line of help; shown without importing what they need.
_COMMANDS = {
    "demo": (
        "fgnav.cli.demo:demo",
        "Simulate a flight and compare three methods on it.",
    ),
    "check": ("fgnav.cli.check:check", "Say what is in a flight and what is wrong with it."),
    "run": ("fgnav.cli.run:run", "Estimate a flight with one method; write its estimates."),
    "compare": ("fgnav.cli.compare:compare", "Run several methods on flights and judge them."),
    "campaign": ("fgnav.cli.campaign:campaign", "Fly and compare many scenarios at once."),
    "new": ("fgnav.cli.new:new", "Look at files of any format; write a flight folder to edit."),
    "import": ("fgnav.cli.import_:import_", "Turn foreign recordings into one flight folder."),
    "export": ("fgnav.cli.export:export", "Write an estimate in a format of another program."),
    "methods": ("fgnav.cli.listings:methods", "List the methods, installed too."),
    "resolvers": (
        "fgnav.cli.listings:resolvers",
        "List who resolves integers, installed too.",
    ),
    "factors": ("fgnav.cli.listings:factors", "List the factors of the graph, installed too."),
    "referee": (
        "fgnav.cli.referee:referee",
        "Judge networks on flights with truth: answers, and worth in a smoother.",
    ),
    "warm": ("fgnav.cli.demo:warm", "Compile everything once, so that no later run waits for it."),
}
# Shown without importing the packages that bring these commands.
_INSTALLED_HELP = {
    "simulate": "Fly a scenario and write what its sensors would have recorded.",
    "scenarios": "List the scenarios that come along, or print one.",
    "data-set": "Draw a data set for training from a world, in shards.",
    "worlds": "List the worlds that come along, or print one.",
    "train": "Train a network from a recipe.",
    "recipes": "List the recipes that come along, or print one.",
    "cards": "List what is known of each released network, or print its card.",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status: 0 done, 1 no solution, 2 bad input."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if not words or words[0] in ("-h", "--help"):
        return _status(_show_help)
    if words[0] == "--version":
        return _status(lambda: print(__version__))
    from fgnav.cli.log import logged  # noqa: PLC0415  # lazy: --help does without

    with ExitStack() as log:
        return _status(lambda: run(log.enter_context(logged(words))))


def _status(work: Callable[[], None]) -> int:
    """Do a piece of work; say in one line what is wrong, and return the exit status."""
    try:
        work()
        sys.stdout.flush()
    except _deliberate() as error:
        from fgnav.checks import NoSolutionError  # noqa: PLC0415

        return _fail(error, 1 if isinstance(error, NoSolutionError) else 2)
    except BrokenPipeError:  # the reader of our output has gone; leave the rest to nobody
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        return _fail(error, 2)
    except MemoryError as error:  # numpy's text says how much was asked for
        return _fail(f"not enough memory for this flight: {str(error) or 'nothing is left'}", 2)
    except KeyboardInterrupt:
        return _fail("interrupted", 130)
    return 0


def commands() -> dict[str, tuple[str, str]]:
    """Return the target and the line of help of each command, installed ones too, by name."""
    available = dict(_COMMANDS)
    for entry in entry_points(group="fgnav.commands"):
        if entry.name not in available:
            text = _INSTALLED_HELP.get(entry.name) or f"From {_brought_by(entry)}."
            available[entry.name] = (entry.value, text)
    return available


def _brought_by(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else "an installed package"


def program(command: str, available: dict[str, tuple[str, str]]) -> "App":
    """Return the command line, of one command or of all that are available."""
    from cyclopts import App, Parameter  # noqa: PLC0415  # lazy: --help does without

    app = App(
        name="fgnav",
        help=_HELP,
        help_format="plaintext",
        default_parameter=Parameter(
            negative=(), show_default=lambda value: str(value) if value else None
        ),
        version=__version__,
        result_action="return_value",
        suppress_keyboard_interrupt=False,
    )
    app.register_install_completion_command()
    for name in [command] if command in available else available:
        target, text = available[name]
        app.command(target, name=name, help=text)
    return app


def run(words: list[str]) -> None:
    """Run a command.

    Raises
    ------
    BadInputError
        Also where the words are no command of this program.
    """
    from cyclopts import CycloptsError  # noqa: PLC0415  # lazy, as above

    from fgnav.checks import BadInputError  # noqa: PLC0415

    available = commands()
    if words[0] not in available and not words[0].startswith("-"):
        meant = get_close_matches(words[0], available, n=1)
        hint = f"did you mean {meant[0]}?" if meant else "fgnav --help lists them"
        raise BadInputError(f"{words[0]}: no such command; {hint}")
    try:
        program(words[0], available)(words, exit_on_error=False, print_error=False, verbose=False)
    except CycloptsError as error:
        raise BadInputError(str(error)) from None


def _show_help() -> None:
    """Print the program's help, which every newcomer sees first, without loading what runs it."""
    from shutil import get_terminal_size  # noqa: PLC0415
    from textwrap import fill  # noqa: PLC0415

    from fgnav.terminal import show_names  # noqa: PLC0415

    width = get_terminal_size().columns
    text = "\n".join(fill(line, width) for line in _HELP.splitlines())
    print(f"Usage: fgnav COMMAND [OPTIONS]\n\n{text}\n\nCommands:")
    show_names({f"  {name}": text for name, (_, text) in commands().items()})
    print("\nOptions:")
    from fgnav.cli.log import OPTIONS  # noqa: PLC0415

    options = {
        "--help, -h": "Show this, or a command's own help after its name.",
        "--version": "Show the version.",
        "--install-completion": "Let bash, zsh or fish complete commands and options.",
    }
    show_names({f"  {name}": text for name, text in (options | OPTIONS).items()})


def _deliberate() -> "type[FgnavError]":
    """Return the base of all deliberate errors; asked only once something was raised."""
    from fgnav.checks import FgnavError  # noqa: PLC0415

    return FgnavError


def _fail(error: object, status: int) -> int:
    """Print an error as one line; return the exit status."""
    text = " ".join(str(error).split())
    text = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)
    if len(text) > _LONGEST_ERROR:
        text = f"{text[:_LONGEST_ERROR]}..."
    logger = logging.getLogger("fgnav")
    if logger.handlers:
        logger.error("fgnav: %s", text)
    else:  # it is the log that cannot be had
        print("fgnav:", text, file=sys.stderr)
    return status
