"""What the documents show is run, in the order of its document: Python, and shell commands.

A block of TOML whose first line is a comment with a file's name is that file. Examples in the
docstrings of the library's face are run, too.
"""

import doctest
import inspect
import re
import shlex
import shutil
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import msgspec
import numpy as np
import pytest

import fgnav
from fgnav.attitude import AttitudeSolution, RotationQuadratic, maximum_likelihood
from fgnav.cli import main
from fgnav.graph import (
    check_factors,
    check_sensor,
    flight_constant,
    jacobian_misfit,
    pose,
    random_states,
    residual_factor,
    sensor_factor,
    values_of,
)
from fgnav.integers import integer_least_squares
from fgnav.io.flight.folder import save_flight
from fgnav.methods import method_named
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"^```(python|sh|toml)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PAGES = [ROOT / "README.md", *sorted(ROOT.glob("docs/**/*.md"))]
DOCUMENTS = [path for path in PAGES if BLOCK.search(path.read_text(encoding="utf-8"))]

GROUPS = {f"fgnav.{name}" for name in ("exporters", "factors", "importers", "resolvers")}

FACE = [getattr(fgnav, name) for name in fgnav.__all__]
RECORDS = {one for one in FACE if inspect.isclass(one) and one.__module__.startswith("fgnav.types")}
RECORDS -= {fgnav.Flight, fgnav.Estimate}  # what holds arrays alone: fields of a Flight
PUBLIC = [one for one in FACE if inspect.isclass(one) or inspect.isfunction(one)]
PUBLIC = [one for one in PUBLIC if one not in RECORDS] + [fgnav.Flight.from_arrays]
PUBLIC += [fgnav.Stream.replay, AttitudeSolution, RotationQuadratic, maximum_likelihood]
PUBLIC += [integer_least_squares, method_named, residual_factor]
PUBLIC += [check_factors, check_sensor, flight_constant, jacobian_misfit]
PUBLIC += [pose, random_states, sensor_factor, values_of]  # the other five keys are as ``pose``


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Return the folder of the demo's first seconds."""
    demo = load_scenario(ROOT / "sim" / "fgnav_sim" / "scenarios" / "demo.toml")
    flight = simulate(msgspec.structs.replace(demo, duration_s=6.0), np.random.default_rng(1))
    place = tmp_path_factory.mktemp("flown") / "flight"
    save_flight(flight, place)
    return place


@pytest.fixture
def folder(flown, tmp_path, monkeypatch):
    """Work in a folder with the demo's first seconds in demo/flight."""
    shutil.copytree(flown, tmp_path / "demo" / "flight")
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
    assert {"README.md", "custom_factor.md", "own_log.md"} <= {path.name for path in DOCUMENTS}


def test_snippets_import_public_names_only():
    """``fgnav`` and its rooms; importers and geometry are rooms of rooms."""
    for path in DOCUMENTS:
        code = "\n".join(block[2] for block in BLOCK.finditer(path.read_text(encoding="utf-8")))
        assert not re.findall(r"^\s*from \w+(?:\.\w+){2,} import", code, re.M), path.name


def test_names_of_the_code_are_there():
    for path in PAGES:
        for name in re.findall(r"`(fgnav(?:_\w+)?\.[\w.]+)`", path.read_text(encoding="utf-8")):
            if name not in GROUPS:  # of entry points
                assert importable(name), f"{path.name}: {name}"


def importable(name):
    """Return True if a name is that of a module, or of something in one."""
    if find_spec(name.partition(".")[0]) is None:
        return False
    module, _, last = name.rpartition(".")
    try:
        return find_spec(name) is not None or hasattr(import_module(module), last)
    except ModuleNotFoundError:
        return hasattr(import_module(module), last)


def test_tables_are_those_of_the_results(monkeypatch):
    """``python docs/tables.py`` renews them."""
    monkeypatch.syspath_prepend(ROOT / "docs")
    tables = import_module("tables")
    for page in tables.PAGES:
        text = page.read_text(encoding="utf-8")
        assert tables.rendered(text) == text


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("public", PUBLIC, ids=lambda one: one.__qualname__)
def test_a_public_docstring_has_an_example_and_it_runs(public):
    module = inspect.getmodule(public)
    (example,) = doctest.DocTestFinder(recurse=False).find(public, module=module, globs={})
    assert example.examples
    outcome = []
    doctest.DocTestRunner().run(example, out=outcome.append)
    assert not outcome, "".join(outcome)


@pytest.mark.parametrize(
    "function",
    [one for one in PUBLIC if inspect.isfunction(one)],
    ids=lambda one: one.__qualname__,
)
def test_a_public_function_names_its_parameters_and_what_it_returns(function):
    text = inspect.getdoc(function)
    assert "Parameters\n" in text
    signature = inspect.signature(function)
    returns = signature.return_annotation not in (None, "None")
    assert ("Returns\n" if returns else "Raises\n") in text
