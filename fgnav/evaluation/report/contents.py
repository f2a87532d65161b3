"""The report of a comparison: its parts, in the order in which they are read."""

from fgnav.evaluation.comparison import Comparison, Method
from fgnav.evaluation.report.blocks import Blocks, Part, Report, Source, folded, paragraph
from fgnav.evaluation.report.drawing.chart import Axis
from fgnav.evaluation.report.palette import method_marks
from fgnav.evaluation.report.sections.consistency import consistency_parts
from fgnav.evaluation.report.sections.errors import error_charts
from fgnav.evaluation.report.sections.facts import (
    constants_table,
    gaps_and_exclusions,
    method_table,
    set_up,
    versions,
)
from fgnav.evaluation.report.sections.inertial import allan_parts
from fgnav.evaluation.report.sections.integers import integer_parts
from fgnav.evaluation.report.sections.motion import motion_charts, rate_and_bias_charts
from fgnav.evaluation.report.sections.quality import quality_strips
from fgnav.evaluation.report.sections.receivers import receiver_parts
from fgnav.evaluation.report.sections.residuals import residual_parts
from fgnav.evaluation.report.sections.separation import separation_parts
from fgnav.evaluation.report.sections.sigmas import sigma_parts
from fgnav.evaluation.report.sections.sky import sky_charts
from fgnav.types.flight import Flight


def comparison_report(
    comparison: Comparison, flight: Flight, *, seed: int | None = None, source: str = ""
) -> Report:
    """Return the report of a comparison.

    Parameters
    ----------
    comparison : Comparison
        At least one of its methods has an estimate.
    flight : Flight
        The one compared.
    seed : int, optional
        Of a simulated flight, where it is known.
    source : str
        Text of its ``flight.toml``.
    """
    solved, names = comparison.solved, [method.name for method in comparison.methods]
    marks = method_marks(names)
    time = _time(flight, solved)
    constants = rate_and_bias_charts(flight, solved, marks, time) + constants_table(solved)
    parts = [
        Part(name=name, title=title, blocks=blocks)
        for name, title, blocks in (
            ("summary", "Summary", method_table(comparison)),
            ("errors", "Errors", error_charts(solved, marks, time)),
            ("motion", "Motion", motion_charts(flight, solved, marks, time)),
            ("sigmas", "Stated uncertainty", sigma_parts(flight, solved, marks, time)),
            (
                "receivers",
                "Residuals of fixes and baselines",
                receiver_parts(flight, solved, marks, time),
            ),
            ("sky", "Sky and signals", sky_charts(flight, time)),
            (
                "residuals",
                "Residuals by satellite",
                residual_parts(flight, comparison, marks, time),
            ),
            ("quality", "Quality of answers", quality_strips(flight, solved, time)),
            ("integers", "Integers", integer_parts(flight, comparison, marks, time)),
            (
                "exclusions",
                "Gaps and exclusions",
                gaps_and_exclusions(flight, comparison.methods),
            ),
            ("consistency", "Consistency", consistency_parts(solved, marks, time)),
            ("separation", "Forward against smoother", separation_parts(solved, marks, time)),
            ("constants", "Rates, biases and calibration parameters", constants),
            ("allan", "Allan deviation of the inertial unit", allan_parts(flight)),
            ("set-up", "Set-up as read", set_up(flight) + _source(source)),
            ("versions", "Versions and seeds", _seeds(seed) + versions()),
        )
        if blocks
    ]
    return Report(title=f"{comparison.flight}: {', '.join(names)}", methods=names, parts=parts)


def _time(flight: Flight, solved: list[Method]) -> Axis:
    """Return the axis of time that all diagrams share."""
    spans = [m.estimate.t_s for m in solved if m.estimate is not None and len(m.estimate.t_s)]
    if flight.observations is not None and len(flight.observations.t_s):
        spans.append(flight.observations.t_s)
    low = min((float(t_s[0]) for t_s in spans), default=0.0)
    high = max((float(t_s[-1]) for t_s in spans), default=1.0)
    return Axis(name="time, s", low=low, high=high if high > low else low + 1.0)


def _source(text: str) -> Blocks:
    return folded("flight.toml", [Source(text)]) if text else []


def _seeds(seed: int | None) -> Blocks:
    """Return where chance came in: nowhere but in a simulated flight."""
    own = "" if seed is None else f" The flight was simulated with seed {seed}."
    return paragraph(f"No method here draws random numbers.{own}")
