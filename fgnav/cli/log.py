"""Log of every command beside its results: level, colour, and file."""

import logging
import os
import sys
from argparse import ArgumentError, ArgumentParser
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

OPTIONS = {
    "--quiet": "Of every command: errors alone, no remarks, no progress.",
    "--verbose": "Of every command: each step with its seconds.",
    "--log FILE": "Of every command: all that, with the time of day, appended to a file.",
}
_COLOURS = {logging.WARNING: "\033[33m", logging.ERROR: "\033[31m"}


class _StandardError(logging.Handler):
    """Writes to standard error as it is at the time, which a progress bar may replace."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write one line, in the colour of its level on a terminal."""
        text, colour = self.format(record), _COLOURS.get(record.levelno, "")
        if colour and sys.stderr.isatty() and "NO_COLOR" not in os.environ:
            text = f"{colour}{text}\033[0m"
        print(text, file=sys.stderr)


@contextmanager
def logged(words: Sequence[str]) -> Iterator[list[str]]:
    """Return the words without these options; log as they say while this lasts.

    Raises
    ------
    BadInputError
        If the log cannot be written.
    """
    from fgnav.checks import BadInputError  # noqa: PLC0415  # lazy: --help does without

    parser = ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    parser.add_argument("--quiet", action="store_true")
    parser.add_argument("--verbose", action="store_true")
    parser.add_argument("--log")
    handlers: list[logging.Handler] = [_StandardError()]
    try:
        options, others = parser.parse_known_args(words)
    except ArgumentError as error:
        raise BadInputError(f"--{str(error).partition('--')[2]}") from None
    try:
        if options.log is not None:
            handlers.append(logging.FileHandler(options.log, encoding="utf-8"))
    except OSError as error:
        raise BadInputError(f"--log {options.log}: {error.strerror or error}") from None
    handlers[0].setLevel(logging.INFO if options.verbose else logging.WARNING)
    for handler in handlers[1:]:
        handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    logger = logging.getLogger("fgnav")
    before = logger.level, logger.propagate
    logger.setLevel(logging.ERROR if options.quiet else logging.INFO)
    logger.propagate = False
    for handler in handlers:
        logger.addHandler(handler)
    try:
        if options.log is not None:
            logger.info("fgnav %s", " ".join(others))
        yield others
    finally:
        logger.level, logger.propagate = before
        for handler in handlers:
            logger.removeHandler(handler)
            handler.close()
