"""The report of a comparison: its parts, in the order in which they are read."""

import json
from pathlib import Path
from typing import Any

from fgnav.evaluation.comparison import Comparison, Method
from fgnav.evaluation.report.charts import Span
from fgnav.evaluation.report.parts import Report, folded, paragraph, report
from fgnav.evaluation.report.sections.consistency import consistency_blocks
from fgnav.evaluation.report.sections.epochs import integer_blocks
from fgnav.evaluation.report.sections.errors import error_charts, sigma_charts
from fgnav.evaluation.report.sections.facts import (
    constants_table,
    gaps_and_exclusions,
    set_up,
    versions,
)
from fgnav.evaluation.report.sections.motion import motion_charts, rate_and_bias_charts
from fgnav.evaluation.report.sections.receivers import receiver_blocks
from fgnav.evaluation.report.sections.satellites import satellite_blocks
from fgnav.evaluation.report.sections.signals import sky_charts
from fgnav.evaluation.report.summary import method_table, remarks
from fgnav.io.flight.folder import files_of
from fgnav.types.flight import Flight

_DRAWN = "dispersions.json"  # of the simulator: says the seed
_ONE_FLIGHT = (
    "Errors of neighbouring epochs are alike, so one flight cannot tell a better method from a "
    "lucky one: name several flights, or a folder of them, for differences with their intervals."
)


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
    time = _time(flight, solved)
    toml = folded("flight.toml", paragraph(source) if source else [])
    note = paragraph(_ONE_FLIGHT) if len(solved) > 1 else []
    in_short = folded("notes, failures and unused in short", paragraph(*remarks(comparison)))
    simulated = "" if seed is None else f" The flight was simulated with seed {seed}."
    seeds = f"No method here draws random numbers.{simulated}"
    constants = rate_and_bias_charts(flight, solved, time) + constants_table(solved)
    signals = sky_charts(flight, time) + satellite_blocks(flight, comparison)
    parts = (
        ("summary", "Summary", [method_table(comparison), *note, *in_short]),
        ("errors", "Errors", error_charts(solved, time)),
        ("motion", "Motion", motion_charts(flight, solved, time)),
        ("sigmas", "Stated uncertainty", sigma_charts(flight, solved, time)),
        ("receivers", "Residuals of fixes and baselines", receiver_blocks(flight, solved, time)),
        ("sky", "Sky and signals", signals),
        ("integers", "Integers", integer_blocks(flight, comparison, time)),
        ("exclusions", "Gaps and exclusions", gaps_and_exclusions(flight, comparison.methods)),
        ("consistency", "Consistency", consistency_blocks(solved, time)),
        ("constants", "Rates, biases and calibration parameters", constants),
        ("set-up", "Set-up as read", set_up(flight) + toml),
        ("versions", "Versions and seeds", paragraph(seeds) + versions()),
    )
    return report(f"{comparison.flight}: {', '.join(names)}", names, parts)


def source_of(folder: Path) -> dict[str, Any]:
    """Read seed and text of a flight's folder for ``comparison_report`` to quote."""
    toml = files_of(folder)[0]
    try:
        seed = json.loads(toml.with_name(_DRAWN).read_text(encoding="utf-8"))["seed"]
    except (OSError, ValueError, KeyError, TypeError):
        seed = None
    return {
        "seed": seed if isinstance(seed, int) else None,
        "source": toml.read_text(encoding="utf-8"),
    }


def _time(flight: Flight, solved: list[Method]) -> Span:
    """Return the limits of the axis of time that all figures share."""
    spans = [m.solution.t_s for m in solved if len(m.solution.t_s)]
    if flight.observations is not None and len(flight.observations.t_s):
        spans.append(flight.observations.t_s)
    low = min((float(t_s[0]) for t_s in spans), default=0.0)
    high = max((float(t_s[-1]) for t_s in spans), default=1.0)
    return low, high if high > low else low + 1.0
