"""What the documents show is run, in the order of its document: Python, and shell commands.

A block of TOML whose first line is a comment with a file's name is that file.
"""

import re
import shlex
from pathlib import Path

import msgspec
import numpy as np
import pytest

from fgnav.cli import main
from fgnav.io.flight.folder import save_flight
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"^```(python|sh|toml)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
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
        if block[1] == "python":
            above = text[: block.start(2)].count("\n")  # a traceback then names the page's line
            exec(compile("\n" * above + block[2], str(document), "exec"), names)
            printed = capsys.readouterr().out.splitlines()
            expected = re.findall(r"print\(.*\)  # (.*)$", block[2], re.MULTILINE)
            assert set(expected) <= set(printed)
        elif block[1] == "sh":
            for command in block[2].splitlines():
                assert command.startswith("fgnav ")
                assert main(shlex.split(command)[1:]) == 0, capsys.readouterr().err
        elif (name := re.match(r"# (\S+\.toml)\n", block[2])) is not None:
            Path(name[1]).write_text(block[2])


def test_there_are_documents_with_code():
    assert {"factors.md", "own_log.md"} <= {path.name for path in DOCUMENTS}
