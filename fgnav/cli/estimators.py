"""Methods as the command line asks for them, and a flight compared by them, each step shown."""

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fgnav.terminal import Steps, progress

if TYPE_CHECKING:
    from fgnav.estimate import Estimator
    from fgnav.evaluation.comparison import Comparison
    from fgnav.flight import Flight


@contextmanager
def _loading() -> Iterator[None]:
    """Let the garbage collector rest: what modules make stays, and counting it takes 0.1 s."""
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


@dataclass(frozen=True, slots=True)
class Asked:
    """What the command line says of smoothers, as text."""

    gravity: str | None
    estimate: str
    lag_s: float | None
    solver: str | None
    factors: str
    causal: bool
    noise: str | None


@_loading()
def estimators_named(methods: str, integers: str, asked: Asked) -> "list[Estimator]":
    """Return the methods of a comma-separated list, all with one resolver and the same options."""
    from fgnav.checks import BadInputError  # noqa: PLC0415
    from fgnav.gravity import gravity_named  # noqa: PLC0415
    from fgnav.integers.registry import resolver_named  # noqa: PLC0415
    from fgnav.methods import SMOOTHERS, WITH_LAG, Options, method_named  # noqa: PLC0415

    resolver, names = resolver_named(integers), list(_words(methods))
    options = Options(
        gravity=None if asked.gravity is None else gravity_named(asked.gravity),
        estimate=_words(asked.estimate),
        factors=_words(asked.factors),
        solver=asked.solver,
        causal=asked.causal,
        noise=asked.noise,
        lag_s=asked.lag_s,
    )
    if not names:
        raise BadInputError(f"--method: names no method, got {methods!r}")
    takers = {
        "--gravity": (options.gravity is not None, SMOOTHERS),
        "--estimate": (bool(options.estimate), SMOOTHERS),
        "--factors": (bool(options.factors), SMOOTHERS),
        "--solver": (options.solver is not None, SMOOTHERS),
        "--noise": (options.noise is not None, SMOOTHERS),
        "--causal": (options.causal, ("smoother",)),
        "--lag": (options.lag_s is not None, WITH_LAG),
    }
    for option, (is_given, taken_by) in takers.items():
        if is_given and not set(names) & set(taken_by):
            raise BadInputError(f"{option}: only {', '.join(taken_by)} use it, got {methods!r}")
    return [method_named(name, resolver, options=options) for name in names]


def _words(text: str) -> tuple[str, ...]:
    """Return what stands between commas."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def compare_flight(folder: Path, by: "list[Estimator]") -> "tuple[Flight, Comparison]":
    """Read a flight and compare methods on it, showing each step."""
    from fgnav.evaluation.comparison import compare as compare_methods  # noqa: PLC0415

    with progress(2 + len(by)) as step:
        flight = load(folder, step)
        with step("checking"):
            _check_set_up(flight)
        return flight, compare_methods(flight, by, watch=step)


def _check_set_up(flight: "Flight") -> None:
    """Print what a quick check finds to standard error, which no table or JSON goes to.

    Raises
    ------
    BadInputError
        For what makes every estimate of the flight worthless.
    """
    from fgnav.checks import BadInputError  # noqa: PLC0415
    from fgnav.set_up import describe  # noqa: PLC0415

    findings = describe(flight, quick=True).findings
    for finding in findings:
        if finding.certain:
            raise BadInputError(f"{flight.name}: {finding}")
    for finding in findings:
        print(f"check: {finding}", file=sys.stderr)


def load(folder: Path, step: Steps) -> "Flight":
    """Read a flight, showing the step."""
    from fgnav.io.flight_folder import load_flight  # noqa: PLC0415

    with step(f"reading {folder}"):
        return load_flight(folder)
