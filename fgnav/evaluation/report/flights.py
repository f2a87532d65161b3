"""The report of several flights: pooled figures, paired differences, and every flight."""

import numpy as np

from fgnav.evaluation.flights import BOOTSTRAP_SEED, FlightsComparison
from fgnav.evaluation.report.blocks import Blocks, Part, Report, grid, paragraph, table
from fgnav.evaluation.report.drawing.chart import Axis, Chart, Line, decades, log10
from fgnav.evaluation.report.flights_table import (
    ANGLE_HEADS,
    COUNT_HEADS,
    SUMMARY,
    angle_rows,
    count_rows,
    failure_lines,
    innovation_rows,
    number,
    paired_rows,
    pooled_rows,
)
from fgnav.evaluation.report.palette import method_marks
from fgnav.evaluation.report.sections.facts import versions

_BESIDE = 0.2  # flights: methods on either side of where their flight is, so that equal ones show
_HEADS = [f"{head} {unit}".strip() for head, unit, _ in SUMMARY]
_CHARTS = (
    ("attitude RMS, deg", "attitude_rmse_deg"),
    ("95th percentile of attitude error, deg", "attitude_p95_deg"),
    ("position RMS, m", "position_rmse_m"),
    ("velocity RMS, m/s", "velocity_rmse_mps"),
    ("energy score of attitude, deg", "attitude_energy_score_deg"),
)


def flights_report(comparison: FlightsComparison) -> Report:
    """Return the report of several flights."""
    methods = list(comparison.methods)
    seed = paragraph(
        f"Bootstrap of flights: 2000 resamples, seed {BOOTSTRAP_SEED:#x}. No method here draws "
        "random numbers."
    )
    parts = [
        Part(name=name, title=title, blocks=blocks)
        for name, title, blocks in (
            ("summary", "Summary", _pooled(comparison) + _angles_and_counts(comparison)),
            ("paired", f"Against {methods[0]}, flight by flight", _paired(comparison)),
            ("consistency", "Consistency", _innovations(comparison)),
            ("flights", "Every flight", _charts(comparison) + _per_flight(comparison)),
            ("failures", "Failures", paragraph(*failure_lines(comparison))),
            ("versions", "Versions and seeds", seed + versions()),
        )
        if blocks
    ]
    title = f"{len(comparison.flights)} flights: {', '.join(methods)}"
    return Report(title=title, methods=methods, parts=parts)


def _pooled(comparison: FlightsComparison) -> Blocks:
    caption = (
        "Over flights: root mean square of RMS figures, mean of others, with intervals of 95 % by "
        "bootstrap of flights."
    )
    return table(["method", *_HEADS], pooled_rows(comparison), caption)


def _angles_and_counts(comparison: FlightsComparison) -> Blocks:
    caption = "RMS over flights by angle, and the least that any unbiased estimate has"
    bounds = (
        "A smoother looks at more than one epoch; the bound of the flight is for motions drawn "
        "from the prior, and an estimate of one of them may lie below."
    )
    return (
        table(ANGLE_HEADS, angle_rows(comparison), caption)
        + paragraph(bounds)
        + table(COUNT_HEADS, count_rows(comparison), "links over all flights; mean time of one")
    )


def _innovations(comparison: FlightsComparison) -> Blocks:
    heads = ["method", "measurement", "freedom", "NIS", "low", "high", "in the band"]
    caption = (
        "Normalised innovations squared by degree of freedom, over all flights, with the band that "
        "holds 95 % of means of independent innovations. NEES with its interval is in the summary."
    )
    return table(heads, innovation_rows(comparison), caption)


def _paired(comparison: FlightsComparison) -> Blocks:
    heads = ["figure", "method", "flights", "difference", "ratio", "Wilcoxon p", "significant"]
    caption = (
        "Figures of each method less those of the first, on flights that both have; a ratio below "
        "1 is better. * where both the interval of the ratio and the test exclude chance at 5 %."
    )
    return table(heads, paired_rows(comparison), caption)


def _per_flight(comparison: FlightsComparison) -> Blocks:
    heads = ["flight", "method", *_HEADS, "time, s"]
    rows = [
        [
            one.flight,
            method,
            *(number(figures.get(name, np.nan)) for _, _, name in SUMMARY),
            number(one.seconds.get(method, np.nan)),
        ]
        for one in comparison.flights
        for method, figures in one.figures.items()
    ]
    return table(heads, rows)


def _charts(comparison: FlightsComparison) -> Blocks:
    """Return a dot for each flight and method, in the order of the flights."""
    marks = method_marks(list(comparison.methods))
    place = np.arange(1.0, len(comparison.flights) + 1)
    charts = []
    for title, name in _CHARTS:
        values = {method: comparison.figure(name, method) for method in comparison.methods}
        positive = {method: v for method, v in values.items() if (v > 0).any()}
        if not positive:
            continue
        beside = np.linspace(-_BESIDE, _BESIDE, len(positive)) if len(positive) > 1 else np.zeros(1)
        lines = [
            Line(mark=marks[m], name=m, x=place + shift, y=log10(v), dots=True)
            for (m, v), shift in zip(positive.items(), beside.tolist(), strict=True)
        ]
        charts.append(
            Chart(
                title=title,
                x=Axis(name="flight", low=0.5, high=len(place) + 0.5),
                y=decades(title.rpartition(", ")[2], [line.y for line in lines], margin=0.15),
                lines=lines,
            ).drawing()
        )
    return grid(charts)
