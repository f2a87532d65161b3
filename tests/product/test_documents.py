"""Pages for newcomers say what the program says, and list what it has."""

import re
from pathlib import Path

import msgspec
import pytest

from fgnav.io.importers import IMPORTERS
from fgnav.io.importers.settings import UNITS, CsvTable

ROOT = Path(__file__).parents[2]
FAQ = (ROOT / "docs" / "faq.md").read_text(encoding="utf-8")
OWN_LOG = (ROOT / "docs" / "own_log.md").read_text(encoding="utf-8")
MESSAGES = re.findall(r"\"(.+?)\"", "\n".join(re.findall(r"^### (.*)$", FAQ, re.MULTILINE)))


@pytest.fixture(scope="module")
def source():
    """All of the library's texts, strings over several lines joined, values as an ellipsis."""
    text = "\n".join(file.read_text(encoding="utf-8") for file in ROOT.glob("fgnav/**/*.py"))
    text = re.sub(r"\"\s*\n\s*f?\"", "", text)
    return re.sub(r"\{[^{}\n]*\}", "…", text)


@pytest.mark.parametrize("message", MESSAGES)
def test_the_program_says_what_the_questions_quote(source, message):
    pieces = [piece.strip() for piece in message.split("…") if piece.strip()]
    assert all(len(piece) > 2 for piece in pieces)
    pattern = r"[^\n]{0,80}?".join(re.escape(piece) for piece in pieces)
    assert re.search(pattern, source)


def test_every_format_is_listed():
    table = OWN_LOG.partition("## Formats")[2].partition("## Settings")[0]
    first = [line.split("|")[1] for line in table.splitlines() if line.startswith("|")]
    assert {name for cell in first for name in re.findall(r"`(\w+)`", cell)} == set(IMPORTERS)


def test_units_and_keys_of_csv_are_listed():
    table = OWN_LOG.partition("| `units` of")[2].partition("\n\n")[0]
    rows = [line.split("|") for line in table.splitlines() if line.startswith("| `")]
    listed = {row[1].strip(" `"): set(re.findall(r"`([^`\s]+)`", row[2])) for row in rows}
    assert {kind: set(units) for kind, units in UNITS.items()} == listed
    keys = {one.name for one in msgspec.structs.fields(CsvTable)}
    settings = OWN_LOG.partition("## Settings")[2]
    assert all(re.search(rf"\b{key}\b", settings) for key in keys)
