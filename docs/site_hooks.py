"""Hooks of mkdocs: equations as MathML, pages of the reference from the program itself.

A line ``::: NAME`` becomes signature and docstring of a public object, and ``::: fgnav COMMAND``
the help of a command. Browsers show MathML by themselves, so that no script or font is fetched.
"""

import contextlib
import inspect
import io
import os
import re
from importlib import import_module
from typing import Any

from latex2mathml.converter import convert

_NAME = re.compile(r"^::: (?:fgnav (\S+)|(\S+))$", re.MULTILINE)
_MATH = re.compile(r'<(div|span) class="arithmatex">\\[\[(](.*?)\\[\])]</\1>', re.DOTALL)
_TAG = re.compile(r"\\tag\{(.*?)\}")
_ENTITIES = {"&lt;": "<", "&gt;": ">", "&amp;": "&"}


def on_page_markdown(markdown: str, **_: Any) -> str:  # noqa: ANN401  # mkdocs' name and arguments
    """Return a page with its names described."""
    return _NAME.sub(
        lambda match: _help(match[1]) if match[1] else _described(match[2]), markdown
    )


def on_page_content(html: str, **_: Any) -> str:  # noqa: ANN401
    """Return a page with its equations as MathML."""
    return _MATH.sub(lambda match: _equation(match[2], is_block=match[1] == "div"), html)


def _equation(latex: str, *, is_block: bool) -> str:
    for entity, character in _ENTITIES.items():
        latex = latex.replace(entity, character)
    number = _TAG.search(latex)
    math = convert(_TAG.sub("", latex).strip(), display="block" if is_block else "inline")
    if not is_block:
        return str(math)
    shown = f'<span class="number">({number[1]})</span>' if number else ""
    anchor = f' id="{number[1]}"' if number else ""
    return f'<div class="equation"{anchor}>{math}{shown}</div>'


def _described(name: str) -> str:
    """Return how an object is called and its docstring."""
    module, _, last = name.rpartition(".")
    thing = getattr(import_module(module), last)
    call = name if _is_error(thing) else f"{name}({', '.join(_arguments(thing))})"
    return f"### {last}\n\n```text\n{call}\n\n{inspect.getdoc(thing)}\n```"


def _is_error(thing: object) -> bool:
    return isinstance(thing, type) and issubclass(thing, Exception)


def _arguments(thing: Any) -> list[str]:  # noqa: ANN401  # a function or a class
    words: list[str] = []
    for parameter in inspect.signature(thing).parameters.values():
        if parameter.kind is parameter.KEYWORD_ONLY and "*" not in words:
            words.append("*")
        default = "" if parameter.default is parameter.empty else "=…"
        words.append(f"{parameter.name}{default}")
    return words


def _help(command: str) -> str:
    """Return the help of a command as the program prints it."""
    from fgnav.cli import main  # noqa: PLC0415  # slow to import

    os.environ["COLUMNS"] = "100"
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        main([command, "--help"])
    return f"## fgnav {command}\n\n```text\n{printed.getvalue().strip()}\n```"
