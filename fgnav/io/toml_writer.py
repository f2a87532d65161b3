"""Writing TOML of typed tables, with comments."""

import json
import re
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from fgnav.io.strict_toml import Table

_NOTHING: tuple[Any, ...] = (None, [], (), {})


def write_toml(path: Path, table: Table, comments: Mapping[str, str] | None = None) -> None:
    """Write a file; keys without a value are left out.

    Parameters
    ----------
    table : Table
        Of values and of tables.
    comments : mapping of str to str
        By key, ``"imu.axes"``, or table, ``"imu"``: they stand above it, or where it would be.
    """
    notes = dict(comments or {})
    lines: list[str] = []
    plain = {k: v for k, v in msgspec.to_builtins(table).items() if v not in _NOTHING}
    tables = {k: v for k, v in plain.items() if isinstance(v, dict) and k != "rows"}
    lists = {k: v for k, v in plain.items() if isinstance(v, list | tuple)}
    scalars = {k: v for k, v in plain.items() if k not in tables and k not in lists}
    lines += _entries(scalars, notes)
    for key, rows in lists.items():
        for entry in rows:
            lines += ["", *_comment(notes.pop(key, "")), f"[[{key}]]"]
            lines += _entries(entry, notes, f"{key}.")
    for key, entry in tables.items():
        lines += ["", *_comment(notes.pop(key, "")), f"[{key}]", *_entries(entry, notes, f"{key}.")]
        absent = [name for name in notes if name.startswith(f"{key}.")]
        lines += [line for name in absent for line in _comment(notes.pop(name))]
    for text in notes.values():
        lines += ["", *_comment(text)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _entries(
    table: Mapping[str, Any], notes: dict[str, str] | None = None, above: str = ""
) -> list[str]:
    lines = []
    for name, value in table.items():
        if value not in _NOTHING:
            lines += _comment((notes or {}).pop(above + name, ""))
            lines.append(f"{_key(name)} = {_toml(value)}")
    return lines


def _comment(text: str) -> list[str]:
    """Return the lines of a comment; its own line ends stay."""
    return [
        f"# {line}"
        for paragraph in text.splitlines()
        for line in textwrap.wrap(paragraph, 96, break_long_words=False, break_on_hyphens=False)
    ]


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name)


def _toml(value: Any) -> str:  # noqa: ANN401  # any TOML value
    """Return the TOML of a value; nested tables inline."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{ " + ", ".join(_entries(value)) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
