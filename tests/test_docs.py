"""What the documents show is run: every block of Python, in the order of its document."""

import re
from pathlib import Path

import msgspec
import numpy as np
import pytest

from fgnav.io.flight.folder import save_flight
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
DOCUMENTS = [path for path in sorted(ROOT.glob("docs/*.md")) if BLOCK.search(path.read_text())]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Work in a folder with the demo's first seconds in demo/flight."""
    demo = load_scenario(ROOT / "sim" / "fgnav_sim" / "scenarios" / "demo.toml")
    flight = simulate(msgspec.structs.replace(demo, duration_s=6.0), np.random.default_rng(1))
    (tmp_path / "demo").mkdir()
    save_flight(flight, tmp_path / "demo" / "flight")
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_code_of_a_document_runs(document, capsys):
    text = document.read_text(encoding="utf-8")
    names = {"__name__": "document"}
    for block in BLOCK.finditer(text):
        above = text[: block.start(1)].count("\n")  # so that a traceback names the document's line
        exec(compile("\n" * above + block[1], str(document), "exec"), names)
        printed = capsys.readouterr().out.splitlines()
        expected = re.findall(r"print\(.*\)  # (.*)$", block[1], re.MULTILINE)
        assert set(expected) <= set(printed)


def test_there_are_documents_with_code():
    assert "factors.md" in [path.name for path in DOCUMENTS]
