"""Several flights on screen: each flight's attitude error, pooled figures, paired differences."""

from collections.abc import Iterator

from fgnav.evaluation.flights import PAIRED, FlightsComparison
from fgnav.evaluation.paired import Interval, Paired
from fgnav.evaluation.report.table import folded_table

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
_NONE = "–"


def flights_lines(comparison: FlightsComparison, width: int) -> list[str]:
    """Return the lines of all tables, and a line per failure."""
    count = len(comparison.flights)
    lines = [f"{count} flights: attitude RMS errors, deg", *_per_flight(comparison, width), ""]
    lines += [
        "Over flights: root mean square of RMS figures, mean of others, with intervals of 95 % by "
        "bootstrap of flights",
        *_pooled(comparison, width),
    ]
    paired = list(paired_rows(comparison))
    if paired:
        heads = [["figure", "method", "flights", "difference", "ratio", "p", ""]]
        lines += [
            "",
            f"Less {comparison.methods[0]!r}, flight by flight; * where interval of the ratio and "
            "Wilcoxon's test exclude chance",
            *folded_table(heads, paired, width),
        ]
    return lines + list(failure_lines(comparison))


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
    rows = [
        [method, *(interval(comparison.pooled(name, method)) for _, _, name in SUMMARY)]
        for method in comparison.methods
    ]
    heads = [["method", *(head for head, _, _ in SUMMARY)], ["", *(unit for _, unit, _ in SUMMARY)]]
    return folded_table(heads, rows, width)


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
    return _NONE if value != value else f"{value:.3g}"  # NaN
