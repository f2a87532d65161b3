"""One run: make the flight, have every method estimate it, return the figures."""

import math
from collections.abc import Mapping
from functools import lru_cache
from importlib.metadata import entry_points
from typing import Any, Protocol

import numpy as np

from fgnav.campaign.order import MethodTable, Order, Run, seed_of, start_shift_s
from fgnav.checks import BadInputError, FgnavError
from fgnav.types.estimate import Estimator
from fgnav.types.flight import Flight

GROUP = "fgnav.flight_sources"  # of entry points: the library knows no simulator
Record = dict[str, Any]
_TEXT = 200  # characters of a failure that are kept


class FlightSource(Protocol):
    """Simulator of flights whose truth is known."""

    def check(self, scenario: str, changes: Mapping[str, Any]) -> None:
        """Raise ``BadInputError`` unless a scenario, so changed, can be flown."""
        ...

    def fly(
        self,
        scenario: str,
        changes: Mapping[str, Any],
        start_shift_s: int,
        rng: np.random.Generator,
    ) -> Flight:
        """Return a flight of it."""
        ...


def flight_source() -> FlightSource:
    """Return the installed one.

    Raises
    ------
    BadInputError
        If there is none.
    """
    for entry in entry_points(group=GROUP):
        source: FlightSource = entry.load()()
        return source
    raise BadInputError(f"no simulator is installed: nothing stands in entry-point group {GROUP}")


def estimator_of(table: MethodTable) -> Estimator:
    """Return the method that a table names.

    Raises
    ------
    BadInputError
        Naming the table and what it asks that is not there.
    """
    from fgnav.evaluation.ablation import restricted  # noqa: PLC0415  # lazy: brings methods
    from fgnav.face import method  # noqa: PLC0415

    try:
        estimator = method(
            table.method,
            integers=table.integers,
            gravity=table.gravity,
            calibrate=table.calibrate,
            factors=table.factors,
            causal=table.causal,
            lag_s=table.lag_s,
        )
        return restricted(table.title, estimator, table.without)
    except BadInputError as error:
        raise BadInputError(f"[[method]] {table.title!r}: {error}") from None


def check_order(order: Order) -> None:
    """Raise unless every method and every case of an order can be had, before any run starts."""
    for method in order.method:
        estimator_of(method)
    source = flight_source()
    for case in order.case:
        for column in range(case.columns):
            try:
                source.check(case.scenario, case.changed(column))
            except BadInputError as error:
                raise BadInputError(f"case {case.title!r}: {error}") from None


def fly(order: Order, run: Run) -> Record:
    """Return the record of every method on one flight: plain types, NaN as None.

    A flight that cannot be made, and an error nobody foresaw, are a record of why.
    """
    try:
        return _flown(order, run)
    except FgnavError as error:
        return failed(order, run, str(error))
    except Exception as error:  # noqa: BLE001  # one run must not end a campaign
        return failed(order, run, f"{type(error).__name__}: {error}")


def failed(order: Order, run: Run, why: str) -> Record:
    """Return the record of a run that came to nothing."""
    return _head(order, run) | {"failure": " ".join(why.split())[:_TEXT], "methods": {}}


def _head(order: Order, run: Run) -> Record:
    case = order.case[run.case]
    value = None if case.sweep is None else case.sweep.values[run.column]
    return {
        "campaign": order.digest,
        "case": case.title,
        "column": run.column,
        "value": value,
        "flight": run.flight,
    }


def _flown(order: Order, run: Run) -> Record:
    from fgnav.evaluation.comparison import compare  # noqa: PLC0415
    from fgnav.evaluation.figures import flight_figures  # noqa: PLC0415

    case, seed = order.case[run.case], seed_of(order, run)
    flight = flight_source().fly(
        case.scenario,
        case.changed(run.column),
        start_shift_s(case, seed),
        np.random.default_rng(seed),
    )
    comparison = compare(flight, _estimators(order.method))
    figures = flight_figures(comparison)
    methods = {
        m.name: {
            "figures": _plain(figures[m.name]),
            "converged": m.score.converged,
            "failure": None if m.score.failure is None else m.score.failure[:_TEXT],
            "nis": {test.what: test.nis for test in m.score.consistency},
            "seconds": m.score.seconds,
        }
        for m in comparison.methods
    }
    bound = {
        name: getattr(comparison.bound, name) for name in ("roll", "pitch", "yaw")
    }  # Cramer-Rao, degrees
    return _head(order, run) | {"failure": None, "bound_deg": bound, "methods": methods}


def _plain(figures: Mapping[str, float]) -> dict[str, float | None]:
    return {name: value if math.isfinite(value) else None for name, value in figures.items()}


@lru_cache(maxsize=1)
def _estimators(tables: tuple[MethodTable, ...]) -> list[Estimator]:
    """Return a campaign's methods, made once in a process: networks load for a second."""
    return [estimator_of(table) for table in tables]
