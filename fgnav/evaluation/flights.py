"""Several flights through several methods: each figure pooled, each method against the first.

A flight is the unit of every interval and test, see ``paired``.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fgnav.checks import FgnavError, FloatArray
from fgnav.evaluation.comparison import Watch, compare
from fgnav.evaluation.figures import FIGURES, flight_figures
from fgnav.evaluation.paired import Interval, Paired, paired, pooled
from fgnav.types.estimate import Estimator
from fgnav.types.flight import Flight

PAIRED = [name for name, figure in FIGURES.items() if figure.title]
BOOTSTRAP_SEED = 0x5EED  # intervals are the same whenever the flights are


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightOutcome:
    """Figures of all methods on one flight."""

    flight: str  # what tables call it: its folder
    # by method and name of ``FIGURES``; empty where the flight came to nothing
    figures: Mapping[str, Mapping[str, float]]
    seconds: Mapping[str, float]
    failures: Mapping[str, str]  # of methods without an answer
    detail: Mapping[str, Any]  # the comparison in plain types
    failure: str | None = None  # why no method could be asked


@dataclass(frozen=True, eq=False, slots=True, kw_only=True, repr=False)
class FlightsComparison:
    """The outcome of several methods on several flights.

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> comparison = fgnav.compare({"first": flight, "second": flight}, ["rtk"])
    >>> comparison
    <FlightsComparison: rtk on 2 flights>
    >>> comparison.figure("attitude_rmse_deg", "rtk").shape
    (2,)
    """

    # in the order asked; the first is the one that others are held against
    methods: tuple[str, ...]
    flights: tuple[FlightOutcome, ...]

    def __repr__(self) -> str:
        """Return the names of the methods and the number of flights."""
        return f"<FlightsComparison: {', '.join(self.methods)} on {len(self.flights)} flights>"

    @property
    def failure(self) -> str | None:
        """Why no method has a solution of any flight; None where one has."""
        if any(outcome.figures for outcome in self.flights):
            return None
        why = self.flights[0].failure or "; ".join(self.flights[0].failures.values())
        return f"no method has a solution of any flight, of the first: {why}"

    @property
    def contradictions(self) -> list[str]:
        """Flights whose measurements some method found inconsistent."""
        return [
            outcome.flight
            for outcome in self.flights
            if any(method.get("verdicts") for method in outcome.detail.get("methods", {}).values())
        ]

    def figure(self, name: str, method: str) -> FloatArray:
        """Return a figure of each flight, (n,); NaN where a method has none."""
        return np.array(
            [outcome.figures.get(method, {}).get(name, np.nan) for outcome in self.flights]
        )

    def pooled(self, name: str, method: str) -> Interval:
        """Return a figure over flights with its interval: root mean square, or mean."""
        return pooled(self.figure(name, method), _rng(name), squared=FIGURES[name].is_rms)

    def bound_deg(self, kind: str, angle: str) -> FloatArray:
        """Return a bound of each flight, (n,): ``"crlb_deg"`` or ``"posterior_deg"``."""
        return np.array(
            [outcome.detail.get("bound", {}).get(kind, {}).get(angle) for outcome in self.flights],
            dtype=float,
        )

    def innovations(self, method: str) -> dict[str, tuple[float, int]]:
        """Return by kind of measurement its NIS over all flights, and the degrees of freedom."""
        by_kind: dict[str, list[tuple[float, int]]] = {}
        for outcome in self.flights:
            for test in outcome.detail.get("methods", {}).get(method, {}).get("consistency", ()):
                by_kind.setdefault(test["what"], []).append((test["nis"], test["freedom"]))
        total = {kind: sum(n for _, n in tests) for kind, tests in by_kind.items()}
        return {
            kind: (sum(nis * n for nis, n in tests) / total[kind], total[kind])
            for kind, tests in by_kind.items()
            if total[kind]
        }

    def paired(self, name: str, method: str, against: str | None = None) -> Paired:
        """Return the gain of a method over another, by default over the first."""
        other = self.figure(name, against or self.methods[0])
        return paired(self.figure(name, method), other, _rng(name))

    def to_dict(self) -> dict[str, Any]:
        """Return every figure in plain types; None, and null in JSON, where there is none."""
        others = self.methods[1:]
        content = {
            "flights": {outcome.flight: _flight(outcome) for outcome in self.flights},
            "pooled": {
                method: {name: asdict(self.pooled(name, method)) for name in FIGURES}
                for method in self.methods
            },
            "paired": {
                method: {
                    name: asdict(gain) | {"is_significant": gain.is_significant}
                    for name in PAIRED
                    if (gain := self.paired(name, method)).flights
                }
                for method in others
            },
            "against": self.methods[0],
        }
        plain: dict[str, Any] = without_nan(content)
        return plain


def _rng(name: str) -> np.random.Generator:
    return np.random.default_rng([BOOTSTRAP_SEED, list(FIGURES).index(name)])


def compare_flights(
    flights: Iterable[tuple[str, Flight | FgnavError]],
    estimators: Sequence[Estimator],
    *,
    watch: Watch,
) -> FlightsComparison:
    """Run estimators on flights, one after the other, and keep their figures.

    Parameters
    ----------
    flights : iterable of tuple
        What tables call it, and the flight or why it cannot be had. Only one is held at a time.
    watch : callable
        From an estimator's name to a context that it runs in.
    """
    outcomes = tuple(_outcomes(flights, estimators, watch))
    return FlightsComparison(methods=tuple(e.name for e in estimators), flights=outcomes)


def _outcomes(
    flights: Iterable[tuple[str, Flight | FgnavError]],
    estimators: Sequence[Estimator],
    watch: Watch,
) -> Iterator[FlightOutcome]:
    for name, flight in flights:
        if isinstance(flight, FgnavError):
            yield _lost(name, flight)
            continue
        try:
            comparison = compare(flight, estimators, watch=watch)
        except FgnavError as error:  # one flight must not end all others
            yield _lost(name, error)
            continue
        failed = {m.name: m.score.failure for m in comparison.methods}
        yield FlightOutcome(
            flight=name,
            figures={
                key: figures
                for key, figures in flight_figures(comparison).items()
                if failed[key] is None
            },
            seconds={m.name: m.score.seconds for m in comparison.methods},
            failures={key: why for key, why in failed.items() if why is not None},
            detail=comparison.to_dict(),
        )


def _lost(name: str, error: FgnavError) -> FlightOutcome:
    return FlightOutcome(
        flight=name, figures={}, seconds={}, failures={}, detail={}, failure=str(error)
    )


def _flight(outcome: FlightOutcome) -> dict[str, Any]:
    figures = {method: dict(values) for method, values in outcome.figures.items()}
    return {**outcome.detail, "figures": figures, "failure": outcome.failure}


def without_nan(content: Any) -> Any:  # noqa: ANN401  # any plain content
    """Return plain content with None where a number is none."""
    if isinstance(content, dict):
        return {key: without_nan(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [without_nan(value) for value in content]
    return None if isinstance(content, float) and not np.isfinite(content) else content
