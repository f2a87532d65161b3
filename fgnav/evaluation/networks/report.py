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
        *(part for part in flights.parts if part.name != "summary"),
    ]
    names = ", ".join(one.name for one in comparison.calibrations)
    return Report(f"{names} on {len(comparison.flights.flights)} flights", flights.methods, parts)


def on_screen(comparison: NetworksComparison) -> Blocks:
    """Return what a terminal shows."""
    tables = _answers(comparison) + _reliability(comparison) + _worth(comparison)
    return tables + paragraph(*remarks(comparison.flights))


def _in_degrees(one: Calibration) -> tuple[float, str]:
    """Return the factor from SI to what people read, and its unit."""
    return (_DEGREES, "deg") if one.unit == "rad" else (1.0, one.unit)


def _answers(comparison: NetworksComparison) -> Blocks:
    rows = []
    for one in comparison.calibrations:
        scale, unit = _in_degrees(one)
        sigma = ", ".join(f"{scale * s:.3g}" for s in np.mean(one.sigmas, axis=0))
        for name, scores in (
            (f"{one.name}, {unit}", one.network),
            (f"constant {sigma} {unit}", one.constant),
        ):
            of_network = scores is one.network
            rows.append(
                [
                    name,
                    f"{100 * one.answered:.0f}" if of_network else "",
                    significant(scale * one.rmse) if of_network else "",
                    *map(significant, (scores.nees, scores.nll)),
                    interval(one.gain) if of_network else "",
                    significant(scale * scores.energy),
                ]
            )
    heads = ["covariance", "answered, %", "RMSE", "NEES, of 1", "NLL", "less constant's", "energy"]
    caption = (
        "Answers against truth. The constant sigma is the best of the other flights' answers, its "
        "mean is shown; the difference of NLL is a mean over flights with its interval of 95 %."
    )
    return table(heads, rows, caption) + paragraph(*map(_correlation, comparison.calibrations))


def _correlation(one: Calibration) -> str:
    together = one.together
    return (
        f"{one.name}: {one.count} answers, {one.outside} windows outside the domain or with gaps; "
        f"{one.lasting:.0%} of the error variance is constant over a flight, half-life of the rest "
        f"{one.half_life_s:.3g} s; NEES of 1 of a flight's answers together {together[0]:.3g} as "
        f"the factor counts them, {together[1]:.3g} as if independent"
    )


def _reliability(comparison: NetworksComparison) -> Blocks:
    rows = []
    for one in comparison.calibrations:
        scale, unit = _in_degrees(one)
        rows += [
            [
                f"{one.name}, {unit}",
                *map(significant, (scale * b.predicted, scale * b.rms, b.nees)),
                str(b.count),
            ]
            for b in one.bins
        ]
    heads = ["reliability", "predicted sigma", "RMS of errors", "NEES, of 1", "answers"]
    return table(heads, rows, "By predicted sigma, of each axis.")


def _reliability_chart(one: Calibration) -> Chart:
    scale, unit = _in_degrees(one)
    predicted, rms = scale * np.array([(b.predicted, b.rms) for b in one.bins]).T
    ends = np.array([min(predicted.min(), rms.min()), max(predicted.max(), rms.max())])
    lines = [Line(TRUTH, ends, ends), Line(one.name, predicted, rms, dots=True)]
    return Chart(
        f"Reliability of {one.name}", f"RMS of errors, {unit}", lines, f"sigma, {unit}", log="xy"
    )


def _worth(comparison: NetworksComparison) -> Blocks:
    heads = ["figure", "flights", "none", "constant", "network", "network less none"]
    caption = (
        "the method without it, with its answers at the constant sigma, and with it: over flights; "
        "mean differences on the flights that both have, with intervals of 95 %."
    )
    return [
        block
        for network in (one.name for one in comparison.calibrations)
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
