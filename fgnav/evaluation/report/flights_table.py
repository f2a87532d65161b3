"""Several flights on screen: each flight's attitude error, pooled figures, paired differences."""

import textwrap
from collections.abc import Iterator
from itertools import groupby
from operator import itemgetter

import numpy as np

from fgnav.evaluation.flights import PAIRED, FlightsComparison
from fgnav.evaluation.paired import Interval, Paired
from fgnav.evaluation.report.blocks import NONE
from fgnav.evaluation.report.table import folded_table
from fgnav.evaluation.scores import EULER, rms

# Heading, unit, figure.
SUMMARY = (
    ("epochs", "", "available"),
    ("attitude", "deg RMS", "attitude_rmse_deg"),
    ("matched", "deg RMS", "matched_attitude_rmse_deg"),
    ("median", "deg", "attitude_median_deg"),
    ("95 %", "deg", "attitude_p95_deg"),
    ("position", "m RMS", "position_rmse_m"),
    ("velocity", "m/s RMS", "velocity_rmse_mps"),
    ("NEES", "of 3", "attitude_nees"),
    ("NLL", "", "attitude_nll"),
    ("energy", "deg", "attitude_energy_score_deg"),
)
TITLES = {
    "matched_attitude_rmse_deg": "attitude RMS on common epochs, deg",
    "attitude_median_deg": "median attitude error, deg",
    "attitude_p95_deg": "95th percentile of attitude error, deg",
    "position_rmse_m": "position RMS, m",
    "velocity_rmse_mps": "velocity RMS, m/s",
    "attitude_energy_score_deg": "energy score of attitude, deg",
}
BOUNDS = {
    "crlb_deg": "Cramér-Rao, one epoch of phase",
    "posterior_deg": "Cramér-Rao, flight, prior of motion",
}
ANGLE_HEADS = ["method or bound", *(f"{angle}, deg RMS" for angle in EULER)]
_COUNTS = ("right", "wrong", "refused")
COUNT_HEADS = ["method", *(f"integers {kind}" for kind in _COUNTS), "time, s"]


def flights_lines(comparison: FlightsComparison, width: int) -> list[str]:
    """Return the lines of all tables, and what is to be said of failures, folded to a width."""
    count = len(comparison.flights)
    lines = [f"{count} flights: attitude RMS errors, deg", *_per_flight(comparison, width), ""]
    lines += [
        *_folded(
            "Over flights: root mean square of RMS figures, mean of others, with intervals of 95 % "
            "by bootstrap of flights",
            width,
        ),
        *_pooled(comparison, width),
    ]
    lines += ["", *folded_table([ANGLE_HEADS], list(angle_rows(comparison)), width)]
    lines += ["", *folded_table([COUNT_HEADS], list(count_rows(comparison)), width)]
    rows = list(_by_figure(comparison))
    if rows:
        text = (
            f"Less {comparison.methods[0]!r}, flight by flight; * where interval of the ratio and "
            "Wilcoxon's test exclude chance"
        )
        heads = [["figure, method", "flights", "difference", "ratio", "p", ""]]
        lines += ["", *_folded(text, width), *folded_table(heads, rows, width)]
    remarks = [*reference_lines(comparison), *failure_lines(comparison)]
    return lines + [part for line in remarks for part in _folded(line, width)]


def _folded(text: str, width: int) -> list[str]:
    return textwrap.wrap(text, width, subsequent_indent="  ", break_long_words=False)


def _by_figure(comparison: FlightsComparison) -> Iterator[list[str]]:
    """Yield each figure, and below it a row for each method."""
    for figure, rows in groupby(paired_rows(comparison), key=itemgetter(0)):
        yield [figure]
        for _, method, *cells in rows:
            yield [f"  {method}", *cells]


def reference_lines(comparison: FlightsComparison) -> list[str]:
    """Return a line of the flights whose truth is an estimate itself."""
    judge = {one.flight: one.detail.get("judged_by") for one in comparison.flights}
    against = [flight for flight, by in judge.items() if by == "reference"]
    if not against:
        return []
    named = ", ".join(against[:3]) + (f" and {len(against) - 3} more" if len(against) > 3 else "")
    return [f"errors and NEES of {named} are against a reference that is an estimate itself"]


def _per_flight(comparison: FlightsComparison, width: int) -> list[str]:
    rows = [
        [
            one.flight,
            *(
                number(one.figures.get(method, {}).get("attitude_rmse_deg", float("nan")))
                for method in comparison.methods
            ),
        ]
        for one in comparison.flights
    ]
    return folded_table([["flight", *comparison.methods]], rows, width)


def _pooled(comparison: FlightsComparison, width: int) -> list[str]:
    heads = [["method", *(head for head, _, _ in SUMMARY)], ["", *(unit for _, unit, _ in SUMMARY)]]
    return folded_table(heads, pooled_rows(comparison), width)


def pooled_rows(comparison: FlightsComparison) -> list[list[str]]:
    """Return a row of ``SUMMARY`` for each method, over all flights."""
    return [
        [method, *(interval(comparison.pooled(name, method)) for _, _, name in SUMMARY)]
        for method in comparison.methods
    ]


def angle_rows(comparison: FlightsComparison) -> Iterator[list[str]]:
    """Yield each method's RMS errors of roll, pitch and yaw, then the bounds, RMS over flights."""
    for method in comparison.methods:
        own = (comparison.pooled(f"{angle}_rmse_deg", method) for angle in EULER)
        yield [method, *map(interval, own)]
    for kind, name in BOUNDS.items():
        values = [comparison.bound_deg(kind, angle) for angle in EULER]
        finite = [own[np.isfinite(own)] for own in values]
        if any(map(len, finite)):
            pooled = map(rms, finite)
            yield [name, *(NONE if value is None else number(value) for value in pooled)]


def count_rows(comparison: FlightsComparison) -> Iterator[list[str]]:
    """Yield each method's integers right, wrong and refused, summed over flights, and its time."""
    for method in comparison.methods:
        counts = [comparison.figure(f"integers_{kind}", method) for kind in _COUNTS]
        seconds = [one.seconds[method] for one in comparison.flights if method in one.seconds]
        sums = [f"{np.nansum(own):.0f}" if np.isfinite(own).any() else NONE for own in counts]
        yield [method, *sums, number(float(np.mean(seconds)) if seconds else np.nan)]


def innovation_rows(comparison: FlightsComparison) -> Iterator[list[str]]:
    """Yield method, measurement, degrees of freedom, NIS and its band of 95 %."""
    from scipy.special import chdtri  # noqa: PLC0415  # lazy, as the table is

    for method in comparison.methods:
        for kind, (nis, freedom) in comparison.innovations(method).items():
            low, high = (chdtri(freedom, [0.975, 0.025]) / freedom).tolist()
            inside = "yes" if low <= nis <= high else "above" if nis > high else "below"
            figures = [f"{value:.3f}" for value in (nis, low, high)]
            yield [method, kind, str(freedom), *figures, inside]


def paired_rows(comparison: FlightsComparison) -> Iterator[list[str]]:
    """Yield figure, method, flights, difference, ratio, p-value and mark of each pair."""
    for name in PAIRED:
        for method in comparison.methods[1:]:
            own: Paired = comparison.paired(name, method)
            if own.flights:
                yield [
                    TITLES[name],
                    method,
                    str(own.flights),
                    interval(own.difference),
                    interval(own.ratio),
                    number(own.p_value),
                    "*" if own.is_significant else "",
                ]


def failure_lines(comparison: FlightsComparison) -> Iterator[str]:
    """Yield why a flight or a method on it has no figures."""
    for one in comparison.flights:
        if one.failure is not None:
            yield f"{one.flight}: not compared: {one.failure}"
        for method, why in one.failures.items():
            yield f"{one.flight}: {method}: no solution: {why}"


def interval(own: Interval) -> str:
    """Return a figure with its bounds, where it has any."""
    if own.low != own.low:  # NaN: flights are too few to tell
        return number(own.value)
    return f"{number(own.value)} ({number(own.low)} to {number(own.high)})"


def number(value: float) -> str:
    """Return three significant digits; a dash for none."""
    return NONE if value != value else f"{value:.3g}"  # NaN
