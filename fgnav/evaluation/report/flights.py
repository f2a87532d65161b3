"""Several flights: pooled figures, paired differences, and every flight."""

from collections.abc import Iterator, Mapping

import numpy as np

from fgnav.evaluation.figures import FIGURES
from fgnav.evaluation.flights import BOOTSTRAP_SEED, PAIRED, FlightsComparison
from fgnav.evaluation.report.charts import Chart, Line
from fgnav.evaluation.report.parts import (
    NONE,
    Blocks,
    Report,
    grid,
    interval,
    paragraph,
    report,
    significant,
    table,
)
from fgnav.evaluation.report.sections.consistency import NIS_CAPTION, NIS_HEADS, nis_cells
from fgnav.evaluation.report.sections.facts import versions
from fgnav.evaluation.scores import EULER, rms

_SUMMARY = {figure.head: name for name, figure in FIGURES.items() if figure.head}
_BOUNDS = {
    "crlb_deg": "Cramér-Rao, one epoch of phase",
    "posterior_deg": "Cramér-Rao, flight, prior of motion",
}
_COUNTS = ("right", "wrong", "refused")
_BESIDE = 0.2  # flights: methods on either side of where their flight is, so that equal ones show


def flights_report(comparison: FlightsComparison) -> Report:
    """Return the report of several flights."""
    methods = list(comparison.methods)
    seed = f"Bootstrap of flights: 2000 resamples, seed {BOOTSTRAP_SEED:#x}."
    parts = (
        ("summary", "Summary", summary(comparison)),
        ("paired", f"Against {methods[0]}, flight by flight", paired(comparison)),
        ("consistency", "Consistency", innovations(comparison)),
        ("flights", "Every flight", _charts(comparison) + _per_flight(comparison)),
        ("failures", "Failures", paragraph(*remarks(comparison))),
        (
            "versions",
            "Versions and seeds",
            paragraph(f"{seed} No method here draws random numbers.") + versions(),
        ),
    )
    return report(f"{len(comparison.flights)} flights: {', '.join(methods)}", methods, parts)


def on_screen(comparison: FlightsComparison) -> Blocks:
    """Return the tables of several flights for a terminal."""
    rows = [
        [
            outcome.flight,
            *(_cell(outcome.figures, m, "attitude_rmse_deg") for m in comparison.methods),
        ]
        for outcome in comparison.flights
    ]
    caption = f"{len(rows)} flights: attitude RMS errors, deg"
    errors = table(["flight", *comparison.methods], rows, caption)
    return errors + summary(comparison) + paired(comparison) + paragraph(*remarks(comparison))


def summary(comparison: FlightsComparison) -> Blocks:
    """Return pooled figures, errors by angle beside their bounds, and integers."""
    pooled = [
        [method, *(interval(comparison.pooled(name, method)) for name in _SUMMARY.values())]
        for method in comparison.methods
    ]
    return (
        table(
            ["method", *_SUMMARY],
            pooled,
            "Over flights: root mean square of RMS figures, mean of others, with intervals of 95 % "
            "by bootstrap of flights.",
        )
        + table(
            ["method or bound", *(f"{angle}, deg RMS" for angle in EULER)],
            _angle_rows(comparison),
            "RMS over flights by angle, and the least that any unbiased estimate has. A smoother "
            "looks at more than one epoch; the bound of the flight is for motions drawn from the "
            "prior, and an estimate of one of them may lie below.",
        )
        + table(
            ["method", *(f"integers {kind}" for kind in _COUNTS), "time, s"],
            _count_rows(comparison),
            "links over all flights; mean time of one",
        )
    )


def _angle_rows(comparison: FlightsComparison) -> Iterator[list[str]]:
    """Yield each method's RMS errors of roll, pitch and yaw, then the bounds, RMS over flights."""
    for method in comparison.methods:
        pooled = (comparison.pooled(f"{angle}_rmse_deg", method) for angle in EULER)
        yield [method, *map(interval, pooled)]
    for kind, name in _BOUNDS.items():
        values = [comparison.bound_deg(kind, angle) for angle in EULER]
        finite = [bound[np.isfinite(bound)] for bound in values]
        if any(map(len, finite)):
            yield [name, *map(significant, map(rms, finite))]


def _count_rows(comparison: FlightsComparison) -> Iterator[list[str]]:
    """Yield each method's integers right, wrong and refused, summed over flights, and its time."""
    for method in comparison.methods:
        counts = [comparison.figure(f"integers_{kind}", method) for kind in _COUNTS]
        seconds = [
            outcome.seconds[method] for outcome in comparison.flights if method in outcome.seconds
        ]
        sums = [f"{np.nansum(n):.0f}" if np.isfinite(n).any() else NONE for n in counts]
        yield [method, *sums, significant(float(np.mean(seconds)) if seconds else None)]


def paired(comparison: FlightsComparison) -> Blocks:
    """Return the gain of each method over the first one, flight by flight."""
    rows = []
    for name in PAIRED:
        for method in comparison.methods[1:]:
            pair = comparison.paired(name, method)
            figures = [interval(pair.difference), interval(pair.ratio), significant(pair.p_value)]
            mark = "*" if pair.is_significant else ""
            if pair.flights:
                rows.append([FIGURES[name].title, method, str(pair.flights), *figures, mark])
    caption = (
        f"Less {comparison.methods[0]!r}, flight by flight, on flights that both have; a ratio "
        "below 1 is better. * where both the interval of the ratio and the test exclude chance at "
        "5 %."
    )
    heads = ["figure", "method", "flights", "difference", "ratio", "Wilcoxon p", "significant"]
    return table(heads, rows, caption)


def innovations(comparison: FlightsComparison) -> Blocks:
    """Return NIS by kind of measurement with its band of 95 %."""
    rows = [
        [method, kind, str(freedom), *nis_cells(nis, freedom)]
        for method in comparison.methods
        for kind, (nis, freedom) in comparison.innovations(method).items()
    ]
    caption = f"{NIS_CAPTION} Over all flights; NEES with its interval is in the summary."
    return table(["method", "measurement", "freedom", *NIS_HEADS], rows, caption)


def remarks(comparison: FlightsComparison) -> Iterator[str]:
    """Yield whose truth is an estimate itself, and why a flight or a method has no figures."""
    against = [f.flight for f in comparison.flights if f.detail.get("judged_by") == "reference"]
    if against:
        more = f" and {len(against) - 3} more" if len(against) > 3 else ""
        named = ", ".join(against[:3]) + more
        yield f"errors and NEES of {named} are against a reference that is an estimate itself"
    for outcome in comparison.flights:
        if outcome.failure is not None:
            yield f"{outcome.flight}: not compared: {outcome.failure}"
        for method, why in outcome.failures.items():
            yield f"{outcome.flight}: {method}: no solution: {why}"


def _per_flight(comparison: FlightsComparison) -> Blocks:
    rows = [
        [
            outcome.flight,
            method,
            *(_cell(outcome.figures, method, name) for name in _SUMMARY.values()),
            significant(outcome.seconds.get(method)),
        ]
        for outcome in comparison.flights
        for method in outcome.figures
    ]
    return table(["flight", "method", *_SUMMARY, "time, s"], rows)


def _cell(figures: Mapping[str, Mapping[str, float]], method: str, name: str) -> str:
    return significant(figures.get(method, {}).get(name))


def _charts(comparison: FlightsComparison) -> Blocks:
    """Return a dot for each flight and method, in the order of the flights."""
    number = np.arange(1.0, len(comparison.flights) + 1)
    charts = []
    for name in PAIRED:
        title = FIGURES[name].title
        values = {method: comparison.figure(name, method) for method in comparison.methods}
        positive = {method: v for method, v in values.items() if (v > 0).any()}
        shifts = np.linspace(-_BESIDE, _BESIDE, len(positive)) if len(positive) > 1 else [0.0]
        lines = [
            Line(method, number + shift, v, dots=True)
            for (method, v), shift in zip(positive.items(), shifts, strict=False)
        ]
        limits = (0.5, len(number) + 0.5)
        unit = title.rpartition(", ")[2]
        if lines:
            charts.append(Chart(title, unit, lines, "flight", x_limits=limits, log="y"))
    return grid(charts)
