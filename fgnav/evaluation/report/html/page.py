"""The page: a summary, then diagrams and tables, in one file that loads nothing."""

from html import escape
from importlib.resources import files
from pathlib import Path

from fgnav.checks import BadInputError
from fgnav.evaluation.comparison import Comparison, Method
from fgnav.evaluation.report.html.drawing.chart import Axis
from fgnav.evaluation.report.html.drawing.markup import folded, paragraph, section
from fgnav.evaluation.report.html.sections.consistency import consistency_parts
from fgnav.evaluation.report.html.sections.errors import error_charts
from fgnav.evaluation.report.html.sections.facts import (
    constants_table,
    gaps_and_exclusions,
    method_table,
    set_up,
    versions,
)
from fgnav.evaluation.report.html.sections.inertial import allan_parts
from fgnav.evaluation.report.html.sections.integers import integer_parts
from fgnav.evaluation.report.html.sections.motion import motion_charts, rate_and_bias_charts
from fgnav.evaluation.report.html.sections.quality import quality_strips
from fgnav.evaluation.report.html.sections.residuals import residual_parts
from fgnav.evaluation.report.html.sections.separation import separation_parts
from fgnav.evaluation.report.html.sections.sky import sky_charts
from fgnav.evaluation.report.lines import COLOURS
from fgnav.io.atomic_write import check_place, write_text
from fgnav.types.flight import Flight

SUFFIX = ".html"
_TITLES = {
    "summary": "Summary",
    "errors": "Errors",
    "motion": "Motion",
    "sky": "Sky and signals",
    "residuals": "Residuals by satellite",
    "quality": "Quality of answers",
    "integers": "Integers",
    "exclusions": "Gaps and exclusions",
    "consistency": "Consistency",
    "separation": "Forward against smoother",
    "constants": "Rates, biases and calibration parameters",
    "allan": "Allan deviation of the inertial unit",
    "set-up": "Set-up as read",
    "versions": "Versions and seeds",
}


def check_page(path: Path) -> None:
    """Raise unless a page can be written into a file of that name.

    Raises
    ------
    BadInputError
        If the name does not end in ``.html`` or its folder is absent.
    """
    if path.suffix.lower() != SUFFIX:
        raise BadInputError(f"{path}: a page ends its name in {SUFFIX}")
    check_place(path)


def save_page(
    comparison: Comparison, flight: Flight, path: Path, *, seed: int | None = None, source: str = ""
) -> None:
    """Write the report of a comparison as one page, whole or not at all.

    Parameters
    ----------
    comparison : Comparison
    flight : Flight
        The one compared.
    path : Path
        Ends in ``.html``; its folder exists.
    seed : int, optional
        Of a simulated flight, where it is known.
    source : str
        Text of its ``flight.toml``.

    Raises
    ------
    BadInputError
        As ``check_page``, or if no method has an estimate.
    """
    check_page(path)
    solved = comparison.solved
    if not solved:
        raise BadInputError(f"{path}: no method has an estimate to report")
    names = [method.name for method in comparison.methods]
    marks = method_marks(names)
    time = _time(flight, solved)
    contents = {
        "summary": method_table(comparison),
        "errors": error_charts(solved, marks, time),
        "motion": motion_charts(flight, solved, marks, time),
        "sky": sky_charts(flight, time),
        "residuals": residual_parts(flight, comparison, marks, time),
        "quality": quality_strips(flight, solved, time),
        "integers": integer_parts(flight, comparison, marks, time),
        "exclusions": gaps_and_exclusions(flight, comparison.methods),
        "consistency": consistency_parts(solved, marks, time),
        "separation": separation_parts(solved, marks, time),
        "constants": rate_and_bias_charts(flight, solved, marks, time) + constants_table(solved),
        "allan": allan_parts(flight),
        "set-up": set_up(flight) + _source(source),
        "versions": _seeds(seed) + versions(),
    }
    sections = {name: (_TITLES[name], content) for name, content in contents.items() if content}
    write_text(path, page(f"{comparison.flight}: {', '.join(names)}", names, sections))


def method_marks(names: list[str]) -> dict[str, str]:
    """Return the class that gives each method its colour, everywhere on a page.

    Methods beyond the number of colours have them again, dashed.
    """
    return {name: f"m{k % (2 * len(COLOURS))}" for k, name in enumerate(names)}


def page(title: str, methods: list[str], sections: dict[str, tuple[str, str]]) -> str:
    """Return the text of a page.

    Parameters
    ----------
    title : str
    methods : list of str
        Each has a box that shows or hides it.
    sections : dict of str to tuple of str
        Heading and content by name.
    """
    room = files("fgnav.evaluation.report.html")
    style = (room / "page.css").read_text(encoding="utf-8")
    script = (room / "page.js").read_text(encoding="utf-8")
    boxes = "".join(
        f'<label><input type="checkbox" checked data-m="{mark}">'
        f'<span class="key {mark}"></span>{escape(name)}</label>'
        for name, mark in method_marks(methods).items()
    )
    boxes += '<span><span class="key dashes"></span>truth, or what is expected</span>'
    links = "".join(
        f'<a href="#{name}">{escape(heading)}</a>' for name, (heading, _) in sections.items()
    )
    body = "".join(section(name, *content) for name, content in sections.items())
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{style}</style></head>\n"
        f"<body><h1>{escape(title)}</h1><nav>{links}</nav>"
        f'<div class="bar" role="group" aria-label="methods shown">{boxes}'
        '<button type="button" id="theme">light or dark</button></div>\n'
        f"<main>{body}</main>\n<script>{script}</script></body></html>\n"
    )


def _time(flight: Flight, solved: list[Method]) -> Axis:
    """Return the axis of time that all diagrams share."""
    spans = [m.estimate.t_s for m in solved if m.estimate is not None and len(m.estimate.t_s)]
    if flight.observations is not None and len(flight.observations.t_s):
        spans.append(flight.observations.t_s)
    low = min((float(t_s[0]) for t_s in spans), default=0.0)
    high = max((float(t_s[-1]) for t_s in spans), default=1.0)
    return Axis(name="time, s", low=low, high=high if high > low else low + 1.0)


def _source(text: str) -> str:
    return folded("flight.toml", f"<pre>{escape(text)}</pre>") if text else ""


def _seeds(seed: int | None) -> str:
    """Return where chance came in: nowhere but in a simulated flight."""
    own = "" if seed is None else f" The flight was simulated with seed {seed}."
    return paragraph(f"No method here draws random numbers.{own}")
