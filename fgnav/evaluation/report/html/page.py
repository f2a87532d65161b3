"""The page: a summary, then diagrams and tables, in one file that loads nothing."""

from collections.abc import Mapping
from html import escape
from importlib.resources import files
from pathlib import Path

from fgnav.evaluation.report.blocks import Report
from fgnav.evaluation.report.drawing.shapes import RULE
from fgnav.evaluation.report.html.markup import section
from fgnav.evaluation.report.palette import DARK, LIGHT, dashes, method_marks
from fgnav.io.atomic_write import write_text


def save_page(report: Report, path: Path) -> None:
    """Write a report as one page, whole or not at all."""
    write_text(path, page(report))


def page(report: Report) -> str:
    """Return the text of a page. Each method has a box that shows or hides it."""
    room = files("fgnav.evaluation.report.html")
    style = _colours() + (room / "page.css").read_text(encoding="utf-8")
    script = (room / "page.js").read_text(encoding="utf-8")
    boxes = "".join(
        f'<label><input type="checkbox" checked data-m="{mark}">'
        f'<span class="key {mark}"></span>{escape(name)}</label>'
        for name, mark in method_marks(report.methods).items()
    )
    boxes += '<span><span class="key dashes"></span>truth, or what is expected</span>'
    links = "".join(f'<a href="#{part.name}">{escape(part.title)}</a>' for part in report.parts)
    body = "".join(map(section, report.parts))
    title = escape(report.title)
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>{style}</style></head>\n"
        f"<body><h1>{title}</h1><nav>{links}</nav>"
        f'<div class="bar" role="group" aria-label="methods shown">{boxes}'
        '<button type="button" id="theme">light or dark</button></div>\n'
        f"<main>{body}</main>\n<script>{script}</script></body></html>\n"
    )


def _colours() -> str:
    """Return the rules that give marks their colours, and let boxes hide those of methods."""
    night = _variables(DARK)
    rules = [
        f":root{{color-scheme:light dark;{_variables(LIGHT)}}}",
        f"@media(prefers-color-scheme:dark){{:root:not([data-theme=light]){{{night}}}}}",
        f":root[data-theme=dark]{{color-scheme:dark;{night}}}",
        ":root[data-theme=light]{color-scheme:light}",
    ]
    for mark in LIGHT:
        rules.append(f".{mark}{{color:var(--{mark})}}")
        if (lengths := dashes(mark)) is not None:
            a, b = lengths
            owner = f".{mark}" if mark == RULE else f".l.{mark}"
            rules.append(f"{owner}{{stroke-dasharray:{a:g} {b:g}}}")
            rules.append(
                f".key.{mark}{{background:repeating-linear-gradient(90deg,currentColor 0 {a:g}px,"
                f"transparent {a:g}px {a + b:g}px)}}"
            )
    hidden = ",".join(f".hide-{m} svg .{m}" for m in LIGHT if m[0] == "m" and m[1:].isdigit())
    return "\n".join([*rules, f"{hidden}{{display:none}}", ""])


def _variables(colours: Mapping[str, str]) -> str:
    return "".join(f"--{mark}:{colour};" for mark, colour in colours.items())
