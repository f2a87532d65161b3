"""Judged networks as tables and figures: answers, reliability, worth in a method."""

from collections.abc import Iterator

import numpy as np

from fgnav.evaluation.networks.calibration import Calibration
from fgnav.evaluation.networks.comparison import (
    NO_NETWORK,
    WORTH,
    NetworksComparison,
    constant_of,
)
from fgnav.evaluation.report.charts import TRUTH, Chart, Line
from fgnav.evaluation.report.flights import flights_report, remarks
from fgnav.evaluation.report.parts import (
    Blocks,
    Part,
    Report,
    grid,
    interval,
    paragraph,
    significant,
    table,
)

_DEGREES = 180 / np.pi


def networks_report(comparison: NetworksComparison) -> Report:
    """Return the report: the networks, then the flights."""
    flights = flights_report(comparison.flights)
    charts = grid(map(_reliability_chart, comparison.calibrations))
    parts = [
        Part("summary", "Answers", charts + _answers(comparison) + _reliability(comparison)),
        Part("worth", "Worth in the method", _worth(comparison)),
        *(section for section in flights.parts if section.name != "summary"),
    ]
    names = ", ".join(item.name for item in comparison.calibrations)
    return Report(f"{names} on {len(comparison.flights.flights)} flights", flights.methods, parts)


def on_screen(comparison: NetworksComparison) -> Blocks:
    """Return the lines for a terminal."""
    tables = _answers(comparison) + _reliability(comparison) + _worth(comparison)
    return tables + paragraph(*remarks(comparison.flights))


def _in_degrees(item: Calibration) -> tuple[float, str]:
    """Return the factor from SI to what people read, and its unit."""
    return (_DEGREES, "deg") if item.unit == "rad" else (1.0, item.unit)


def _answers(comparison: NetworksComparison) -> Blocks:
    rows = []
    for item in comparison.calibrations:
        scale, unit = _in_degrees(item)
        sigma = ", ".join(f"{scale * s:.3g}" for s in np.mean(item.sigmas, axis=0))
        for name, scores in (
            (f"{item.name}, {unit}", item.network),
            (f"constant {sigma} {unit}", item.constant),
        ):
            of_network = scores is item.network
            rows.append(
                [
                    name,
                    f"{100 * item.answered:.0f}" if of_network else "",
                    significant(scale * item.rmse) if of_network else "",
                    *map(significant, (scores.nees, scores.nll)),
                    interval(item.gain) if of_network else "",
                    significant(scale * scores.energy),
                ]
            )
    heads = ["covariance", "answered, %", "RMSE", "NEES, of 1", "NLL", "less constant's", "energy"]
    caption = (
        "Answers against truth. The constant sigma is the best of the other flights' answers, its "
        "mean is shown; the difference of NLL is a mean over flights with its interval of 95 %."
    )
    return table(heads, rows, caption) + paragraph(*map(_correlation, comparison.calibrations))


def _correlation(item: Calibration) -> str:
    together = item.together
    return (
        f"{item.name}: {item.count} answers, {item.outside} windows outside the domain or "
        f"with gaps; {item.lasting:.0%} of the error variance is constant over a flight, half-life "
        f"of the rest {item.half_life_s:.3g} s; NEES of 1 of a flight's answers "
        f"together {together[0]:.3g} as the factor counts them, {together[1]:.3g} as if independent"
    )


def _reliability(comparison: NetworksComparison) -> Blocks:
    rows = []
    for item in comparison.calibrations:
        scale, unit = _in_degrees(item)
        rows += [
            [
                f"{item.name}, {unit}",
                *map(significant, (scale * b.predicted, scale * b.rms, b.nees)),
                str(b.count),
            ]
            for b in item.bins
        ]
    heads = ["reliability", "predicted sigma", "RMS of errors", "NEES, of 1", "answers"]
    return table(heads, rows, "By predicted sigma, of each axis.")


def _reliability_chart(item: Calibration) -> Chart:
    scale, unit = _in_degrees(item)
    predicted, rms = scale * np.array([(b.predicted, b.rms) for b in item.bins]).T
    ends = np.array([min(predicted.min(), rms.min()), max(predicted.max(), rms.max())])
    lines = [Line(TRUTH, ends, ends), Line(item.name, predicted, rms, dots=True)]
    return Chart(
        f"Reliability of {item.name}", f"RMS of errors, {unit}", lines, f"sigma, {unit}", log="xy"
    )


def _worth(comparison: NetworksComparison) -> Blocks:
    heads = ["figure", "flights", "none", "constant", "network", "network less none"]
    caption = (
        "the method without it, with its answers at the constant sigma, and with it: over flights; "
        "mean differences on the flights that both have, with intervals of 95 %."
    )
    return [
        block
        for network in (item.name for item in comparison.calibrations)
        for block in table(
            [*heads, "less constant"], _worth_rows(comparison, network), f"{network}: {caption}"
        )
    ]


def _worth_rows(comparison: NetworksComparison, network: str) -> Iterator[list[str]]:
    others = (NO_NETWORK, constant_of(network))
    for key, title in WORTH.items():
        pairs = [comparison.worth(key, network, against) for against in others]
        if pairs[0].flights:
            yield [
                title,
                str(pairs[0].flights),
                *(significant(comparison.flights.pooled(key, m).value) for m in (*others, network)),
                *(interval(pair.difference) for pair in pairs),
            ]
