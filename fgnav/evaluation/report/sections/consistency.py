"""Whether stated covariances are honest: innovations and errors against their chi-square bands."""

from collections.abc import Sequence

import numpy as np
from scipy.special import bdtrik, chdtri

from fgnav.checks import FloatArray
from fgnav.evaluation.comparison import Method
from fgnav.evaluation.report.blocks import Blocks, folded, grid, number, paragraph, table
from fgnav.evaluation.report.drawing.chart import Axis, Chart, Line, nested, spanning

_FREEDOM = 3
_TAILS = np.array([0.975, 0.025])  # of probability above the two ends of a band of 95 %
_BINS = 40  # of a histogram
_FIELDS = (("attitude", "nees"), ("position", "position_nees"), ("velocity", "velocity_nees"))


def consistency_parts(methods: Sequence[Method], marks: dict[str, str], time: Axis) -> Blocks:
    """Return tables and diagrams of NIS and NEES; empty where no method states a covariance."""
    return (
        _innovations(methods)
        + _innovation_histograms(methods, marks)
        + _normalised_errors(methods, marks, time)
    )


def _innovations(methods: Sequence[Method]) -> Blocks:
    """Return a row for each method and kind of measurement, with the band of its mean."""
    rows = []
    for method in methods:
        for one in method.score.consistency:
            if not one.freedom:
                continue
            low, high = chdtri(one.freedom, _TAILS) / one.freedom
            inside = "yes" if low <= one.nis <= high else "above" if one.nis > high else "below"
            rows.append(
                [
                    method.name,
                    one.what,
                    str(one.count),
                    number(one.nis),
                    number(float(low)),
                    number(float(high)),
                    inside,
                    f"{100 * one.beyond_99:.2f} %",
                ]
            )
    heads = ["method", "measurement", "tested", "NIS", "low", "high", "in the band", "beyond 99 %"]
    caption = (
        "Normalised innovations squared by degree of freedom; 1 is expected. The band holds "
        "95 % of means of independent innovations; 1 % are expected beyond the gate."
    )
    return table(heads, rows, caption)


def _innovation_histograms(methods: Sequence[Method], marks: dict[str, str]) -> Blocks:
    """Return a histogram for each kind of measurement, by deciles of what is expected of it."""
    kinds = dict.fromkeys(
        one.what for m in methods for one in m.score.consistency if any(one.deciles)
    )
    charts = []
    edges = np.repeat(np.arange(11) / 10, 2)[1:-1]
    for kind in kinds:
        of = {
            m.name: np.array(one.deciles)
            for m in methods
            for one in m.score.consistency
            if one.what == kind and any(one.deciles)
        }
        count = max(int(counts.sum()) for counts in of.values())
        ends = np.ceil(bdtrik(1 - _TAILS, count, 0.1)) / count
        low, high = (100 * ends).tolist()
        lines = [
            Line(
                mark=marks[name],
                name=name,
                x=edges,
                y=np.repeat(100 * counts / counts.sum(), 2),
                as_is=True,
                width=width,
            )
            for (name, counts), width in zip(of.items(), nested(len(of)).tolist(), strict=True)
        ]
        most = max([15.0, high, *(float(line.y.max()) for line in lines)])
        charts.append(
            Chart(
                title=f"NIS of {kind}: share by decile of chi-square",
                x=Axis(name="probability of less", low=0.0, high=1.0),
                y=Axis(name="share, %", low=0.0, high=1.05 * most),
                lines=lines,
                rules={low: "", high: f"95 % of {count} independent"},
            ).drawing()
        )
    explanation = paragraph(
        "Ten per cent in each decile where the noise is what it is stated to be: more at the "
        "right, noise is larger; at the left, smaller; at both ends, outliers or a mixture."
    )
    return folded("histograms of NIS", explanation + grid(charts)) if charts else []


def _normalised_errors(methods: Sequence[Method], marks: dict[str, str], time: Axis) -> Blocks:
    low, high = chdtri(_FREEDOM, _TAILS).tolist()
    charts, histograms, rows = [], [], []
    for quantity, field in _FIELDS:
        of = {
            m.name: (m.errors.t_s, values)
            for m in methods
            if m.errors is not None
            and (values := getattr(m.errors, field)) is not None
            and np.isfinite(values).any()
        }
        if not of:
            continue
        charts.append(_in_time(quantity, of, marks, time, (low, high)).drawing())
        histograms.append(_histogram(quantity, of, marks).drawing())
        for name, (_, values) in of.items():
            finite = values[np.isfinite(values)]
            inside = float(((finite >= low) & (finite <= high)).mean())
            rows.append(
                [
                    name,
                    quantity,
                    str(len(finite)),
                    number(float(finite.mean()), 2),
                    f"{100 * inside:.1f} %",
                ]
            )
    if not rows:
        return []
    caption = (
        f"Normalised errors squared; 3 is expected, and 95 % between {low:.2f} and {high:.2f}. "
        "Errors of neighbouring epochs are alike in a smoother: one flight says little of the "
        "mean."
    )
    heads = ["method", "state", "epochs", "mean NEES", "in the band"]
    return (
        table(heads, rows, caption)
        + grid(charts)
        + folded(
            "histograms of NEES",
            paragraph("Density of NEES by its logarithm; dashed: chi-square, three degrees.")
            + grid(histograms),
        )
    )


def _in_time(
    quantity: str,
    of: dict[str, tuple[FloatArray, FloatArray]],
    marks: dict[str, str],
    time: Axis,
    band: tuple[float, float],
) -> Chart:
    lines = [
        Line(mark=marks[name], name=name, x=t_s, y=_log10(values), dots=True)
        for name, (t_s, values) in of.items()
    ]
    low, high = np.log10(band).tolist()
    ends = [np.array([-2.0, high + 0.3]), *(_ends(line.y) for line in lines)]
    y = spanning(f"NEES of {quantity}", ends)
    return Chart(
        title=f"NEES of {quantity}, 3 degrees of freedom",
        x=time,
        y=Axis(name=y.name, low=y.low, high=y.high, log=True),
        lines=lines,
        rules={low: "2.5 %", high: "97.5 %"},
    )


def _histogram(
    quantity: str, of: dict[str, tuple[FloatArray, FloatArray]], marks: dict[str, str]
) -> Chart:
    """Return densities of the logarithm, which shows both tails."""
    edges = np.linspace(-2.0, 3.0, _BINS + 1)
    middle = (edges[:-1] + edges[1:]) / 2
    lines = []
    for name, (_, values) in of.items():
        finite = _log10(values[np.isfinite(values)]).clip(edges[0], edges[-1])
        density = np.histogram(finite, edges)[0] / len(finite) / np.diff(edges)
        lines.append(Line(mark=marks[name], name=name, x=middle, y=density, as_is=True))
    nees = 10**middle
    density = np.sqrt(nees / (2 * np.pi)) * np.exp(-nees / 2)  # of chi-square, three degrees
    expected = density * nees * np.log(10)
    lines.append(Line(mark="truth", name="chi-square", x=middle, y=expected, as_is=True))
    return Chart(
        title=f"NEES of {quantity}",
        x=Axis(name="NEES", low=-2.0, high=3.0, log=True),
        y=spanning("density of log10", [line.y for line in lines]),
        lines=lines,
    )


def _log10(values: FloatArray) -> FloatArray:
    return np.asarray(np.log10(np.maximum(values, 1e-3)))


def _ends(y: FloatArray) -> FloatArray:
    """Return what most of a series lies between."""
    return np.asarray(np.nanpercentile(y, [0.5, 99.5]))
