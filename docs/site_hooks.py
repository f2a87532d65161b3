"""Hooks of mkdocs: equations as MathML, pages of the reference from the program itself.

A line ``::: NAME`` becomes signature and docstring of a public object, ``::: commands`` the help of
every command, ``::: messages`` the catalogue of messages. Browsers show MathML by themselves: no
script and no font is fetched.
"""

import contextlib
import html
import inspect
import io
import os
import re
from importlib import import_module
from typing import Any

from latex2mathml.converter import convert

_NAME = re.compile(r"^::: (\S+)$", re.MULTILINE)
_COMMAND = re.compile(r"^  ([a-z][a-z-]*)  ", re.MULTILINE)
_MATH = re.compile(r'<(div|span) class="arithmatex">\\[\[(](.*?)\\[\])]</\1>', re.DOTALL)
_TAG = re.compile(r"\\tag\{(.*?)\}")


def on_page_markdown(markdown: str, **_: Any) -> str:  # noqa: ANN401  # mkdocs' name and arguments
    """Return a page with its names described."""
    generated = {"commands": _commands, "messages": _messages}
    return _NAME.sub(
        lambda match: generated.get(match[1], lambda: _described(match[1]))(), markdown
    )


def on_page_content(content: str, **_: Any) -> str:  # noqa: ANN401
    """Return a page with its equations as MathML."""
    return _MATH.sub(lambda match: _equation(match[2], is_block=match[1] == "div"), content)


def _equation(latex: str, *, is_block: bool) -> str:
    latex = html.unescape(latex)
    number = _TAG.search(latex)
    math = convert(_TAG.sub("", latex).strip(), display="block" if is_block else "inline")
    if not is_block:
        return str(math)
    shown = f'<span class="number">({number[1]})</span>' if number else ""
    return f'<div class="equation">{math}{shown}</div>'


def _described(name: str) -> str:
    """Return how an object is called and its docstring."""
    module, _, last = name.rpartition(".")
    thing = getattr(import_module(module), last)
    is_error = isinstance(thing, type) and issubclass(thing, Exception)
    call = name if is_error else f"{name}({', '.join(_arguments(thing))})"
    return f"### {last}\n\n```text\n{call}\n\n{inspect.getdoc(thing)}\n```"


def _arguments(thing: Any) -> list[str]:  # noqa: ANN401  # a function or a class
    words: list[str] = []
    for parameter in inspect.signature(thing).parameters.values():
        if parameter.kind is parameter.KEYWORD_ONLY and "*" not in words:
            words.append("*")
        default = "" if parameter.default is parameter.empty else "=…"
        words.append(f"{parameter.name}{default}")
    return words


def _commands() -> str:
    """Return the help of every command as the program prints it."""
    names = _COMMAND.findall(_printed("--help").partition("Commands:")[2])
    return "\n\n".join(
        f"## fgnav {name}\n\n```text\n{_printed(name, '--help').strip()}\n```" for name in names
    )


def _messages() -> str:
    """Return the catalogue of messages as a table, an ellipsis for each value."""
    from fgnav.messages import MESSAGES  # noqa: PLC0415

    words = {code: re.sub(r"\{[^}]*\}", "…", text) for code, text in MESSAGES.items()}
    rows = [f"| {code} | {text} |" for code, text in words.items()]
    return "\n".join(["| code | message |", "|---|---|", *rows])


def _printed(*words: str) -> str:
    from fgnav.cli import main  # noqa: PLC0415  # slow to import

    os.environ["COLUMNS"] = "100"
    with contextlib.redirect_stdout(io.StringIO()) as printed, contextlib.suppress(SystemExit):
        main(list(words))
    return printed.getvalue()
