"""Fills the page of the library's face: a line ``::: NAME`` becomes signature and docstring."""

import inspect
import re
from importlib import import_module
from typing import Any

_NAME = re.compile(r"^::: (\S+)$", re.MULTILINE)


def on_page_markdown(markdown: str, **_: Any) -> str:  # noqa: ANN401  # mkdocs' name and arguments
    """Return a page with its names described."""
    return _NAME.sub(lambda match: described(match[1]), markdown)


def described(name: str) -> str:
    """Return how an object is called and what its docstring says."""
    module, _, last = name.rpartition(".")
    thing = getattr(import_module(module), last)
    call = name if _is_error(thing) else f"{name}({', '.join(_arguments(thing))})"
    return f"### {last}\n\n```text\n{call}\n\n{inspect.getdoc(thing)}\n```"


def _is_error(thing: object) -> bool:
    return isinstance(thing, type) and issubclass(thing, Exception)


def _arguments(thing: Any) -> list[str]:  # noqa: ANN401  # a function or a class
    words: list[str] = []
    for one in inspect.signature(thing).parameters.values():
        if one.kind is one.KEYWORD_ONLY and "*" not in words:
            words.append("*")
        words.append(one.name if one.default is one.empty else f"{one.name}=…")
    return words
