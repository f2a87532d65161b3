"""Consistency of covariances: normalised innovations and errors."""

from collections.abc import Sequence

import numpy as np
from scipy.special import bdtrik, chdtri

from fgnav.checks import FloatArray
from fgnav.evaluation.comparison import Method
from fgnav.evaluation.report.charts import TRUTH, Chart, Line, Span, time_charts
from fgnav.evaluation.report.parts import Blocks, folded, grid, number, paragraph, table

_FREEDOM = 3
_TAILS = np.array([0.975, 0.025])  # of probability above the two ends of a band of 95 %
_FIELDS = (("attitude", "nees"), ("position", "position_nees"), ("velocity", "velocity_nees"))
_DECILES = (
    "Ten per cent in each decile where the noise is what it is stated to be: more at the right, "
    "noise is larger; at the left, smaller; at both ends, outliers or a mixture."
)
NIS_HEADS = ["NIS", "low", "high", "in the band"]
NIS_CAPTION = (
    "Normalised innovations squared by degree of freedom; 1 is expected. The band holds 95 % of "
    "means of independent innovations."
)


def consistency_blocks(methods: Sequence[Method], time: Span) -> Blocks:
    """Return tables and figures of NIS and NEES; empty where no method states a covariance."""
    rows = [
        [
            *(method.name, test.what, str(test.count), *nis_cells(test.nis, test.freedom)),
            f"{100 * test.beyond_99:.2f} %",
        ]
        for method in methods
        for test in method.score.consistency
        if test.freedom
    ]
    heads = ["method", "measurement", "tested", *NIS_HEADS, "beyond 99 %"]
    return (
        table(heads, rows, f"{NIS_CAPTION} 1 % are expected beyond the gate.")
        + _innovation_histograms(methods)
        + _normalised_errors(methods, time)
    )


def nis_cells(nis: float, freedom: int) -> list[str]:
    """Return normalised innovations squared with their band of 95 %."""
    low, high = (chdtri(freedom, _TAILS) / freedom).tolist()
    inside = "yes" if low <= nis <= high else "above" if nis > high else "below"
    return [number(nis), number(low), number(high), inside]


def _innovation_histograms(methods: Sequence[Method]) -> Blocks:
    """Return a histogram for each kind of measurement, by deciles of what is expected of it."""
    by_kind: dict[str, dict[str, FloatArray]] = {}
    for method in methods:
        for test in method.score.consistency:
            if any(test.deciles):
                by_kind.setdefault(test.what, {})[method.name] = np.array(test.deciles, dtype=float)
    charts = []
    for kind, of in by_kind.items():
        count = max(int(counts.sum()) for counts in of.values())
        low, high = (100 * np.ceil(bdtrik(1 - _TAILS, count, 0.1)) / count).tolist()
        edges = np.repeat(np.arange(11) / 10, 2)[1:-1]
        shares = {name: np.repeat(100 * counts / counts.sum(), 2) for name, counts in of.items()}
        most = max([15.0, high, *(float(share.max()) for share in shares.values())])
        charts.append(
            Chart(
                f"NIS of {kind}: share by decile of chi-square",
                "share, %",
                [Line(name, edges, share) for name, share in shares.items()],
                "probability of less",
                x_limits=(0.0, 1.0),
                y_limits=(0.0, 1.05 * most),
                rules={low: "", high: f"95 % of {count} independent"},
            )
        )
    return folded("histograms of NIS", paragraph(_DECILES) + grid(charts) if charts else [])


def _normalised_errors(methods: Sequence[Method], time: Span) -> Blocks:
    """Return NEES in time and as histograms, and their means."""
    low, high = chdtri(_FREEDOM, _TAILS).tolist()
    series, rows = [], []
    for quantity, field in _FIELDS:
        for method in methods:
            nees = getattr(method.errors, field, None)
            if method.errors is None or nees is None or not np.isfinite(nees).any():
                continue
            line = Line(method.name, method.errors.t_s, nees, dots=True)
            series.append((f"NEES of {quantity}, 3 degrees of freedom", "NEES", line))
            finite = nees[np.isfinite(nees)]
            inside = f"{100 * float(((finite >= low) & (finite <= high)).mean()):.1f} %"
            mean = number(float(finite.mean()), 2)
            rows.append([method.name, quantity, str(len(finite)), mean, inside])
    charts = time_charts(series, time, _decades, log="y", rules={low: "2.5 %", high: "97.5 %"})
    caption = (
        f"Normalised errors squared; 3 is expected, and 95 % between {low:.2f} and {high:.2f}. "
        "Errors of neighbouring epochs are alike in a smoother: one flight says little of the "
        "mean."
    )
    explanation = "Density of NEES by its logarithm; dashed: chi-square, three degrees."
    histograms = grid(map(_histogram, charts))
    return (
        table(["method", "state", "epochs", "mean NEES", "in the band"], rows, caption)
        + grid(charts)
        + folded("histograms of NEES", paragraph(explanation) + histograms if rows else [])
    )


def _decades(lines: Sequence[Line]) -> Span:
    """Return limits that hold most of NEES, and its band."""
    ends = [end for line in lines for end in np.nanpercentile(line.y, [0.5, 99.5]).tolist()]
    return max(min(0.01, *ends), 1e-3), max(20.0, *ends)


def _histogram(in_time: Chart) -> Chart:
    """Return densities of the logarithm, which shows both tails."""
    edges = np.linspace(-2.0, 3.0, 41)
    nees = 10 ** ((edges[:-1] + edges[1:]) / 2)
    lines = []
    for line in in_time.lines:
        logs = np.log10(line.y[np.isfinite(line.y)].clip(10 ** edges[0], 10 ** edges[-1]))
        density = np.histogram(logs, edges)[0] / len(logs) / np.diff(edges)
        lines.append(Line(line.style, nees, density))
    density = np.sqrt(nees / (2 * np.pi)) * np.exp(-nees / 2)  # of chi-square, three degrees
    lines.append(Line(TRUTH, nees, density * nees * np.log(10), "chi-square"))
    return Chart(in_time.title, "density of log10", lines, "NEES", log="x")
