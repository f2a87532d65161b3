"""What keeps the house in order: rooms of few files, methods used by what they can do."""

import ast
import re
from collections import Counter
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from fgnav.methods import METHODS

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = [ROOT / "fgnav", ROOT / "sim" / "fgnav_sim", ROOT / "models" / "fgnav_models"]
FILES = [file for package in PACKAGES for file in package.rglob("*.py")]
FULL = 12  # files of a room, its __init__ aside
# Words of no textbook in names, and how many of these are still to be renamed.
COUNTS = (
    "row 120, turn 65, unit 63, stated 42, least 41, freedom 37, place 36, aux 33, part 28, known "
    "28, opening 25, found 18, own 18, whole 18, lasting 16, rest 16, turned 15, late 14, refused "
    "14, seen 13, off 13, places 12, judged 12, apart 12, one 11, tag 10, stretch 10, carried 6, "
    "fewest 6, swing 5, turning 5, votes 5, there 5, enough 4, room 4, led 4, asked 4, entering 2, "
    "beside 2, which 1, believed 1, said 1, leaning 1"
)
PRIVATE = {word: int(count) for word, count in map(str.split, COUNTS.split(", "))}
# First lines of docstrings that name nothing.
VAGUE = (
    r"Return (what|which|how|whether|it|them|the same|some|as)\b"
    r"|(What|Who|Where|How|When|Whether)\b"
)


@cache
def parsed(file):
    return ast.parse(file.read_text(encoding="utf-8"))


def names(node):
    """Return all names in an expression: ``smoother`` and ``Smoother`` of ``smoother.Smoother``."""
    ends = {one.attr for one in ast.walk(node) if isinstance(one, ast.Attribute)}
    return ends | {one.id for one in ast.walk(node) if isinstance(one, ast.Name)}


def kinds_asked_for(tree):
    """Yield line and class names of every ``isinstance`` of a file."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and names(node.func) & {"isinstance", "issubclass"}:
            yield node.lineno, names(node.args[1])


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_no_room_holds_more_than_it_can(package):
    rooms = {file.parent for file in package.rglob("*.py")}
    counts = {
        str(room.relative_to(ROOT)): sum(file.name != "__init__.py" for file in room.glob("*.py"))
        for room in rooms
    }
    assert len(counts) > 1
    assert {room: count for room, count in counts.items() if count > FULL} == {}


def imported(file):
    """Return the modules whose names a file takes, for types alone as well; not those it waits for.

    Faces of packages, which hand on lazily what these name, are left out.
    """
    lines = parsed(file).body
    lines = lines + [one for line in lines if isinstance(line, ast.If) for one in line.body]
    taken = [one for one in lines if isinstance(one, ast.ImportFrom)]
    of = {one.module for one in taken}
    return of | {f"{one.module}.{alias.name}" for one in taken for alias in one.names}


def test_no_files_know_each_other_in_a_circle():
    bases = [(package.parent, file) for package in PACKAGES for file in package.rglob("*.py")]
    modules = {
        ".".join(file.relative_to(base).with_suffix("").parts): file
        for base, file in bases
        if file.name != "__init__.py"
    }
    graph = {name: imported(file) & modules.keys() for name, file in modules.items()}
    assert "fgnav.checks" in graph["fgnav.terminal"] | graph["fgnav.graph.build"]
    TopologicalSorter(graph).prepare()  # raises of a circle


def test_every_room_says_in_a_sentence_what_is_its_own():
    rooms = {file.parent for file in FILES}
    silent = [str(room) for room in rooms if not ast.get_docstring(parsed(room / "__init__.py"))]
    assert silent == []


def test_no_method_is_told_by_its_class():
    methods = {place.partition(":")[2] for place in METHODS.values()}
    assert {"Smoother", "Rtk"} <= methods
    asked = [
        f"{file.relative_to(ROOT)}:{line}"
        for file in FILES
        for line, kinds in kinds_asked_for(parsed(file))
        if kinds & methods
    ]
    assert asked == []
    assert list(kinds_asked_for(ast.parse("isinstance(a, (x.Rtk, B))"))) == [(1, {"x", "Rtk", "B"})]


def identifiers(tree):
    """Yield the words of every name that a file gives: ``best_left`` has two."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            name = node.name
        elif isinstance(node, ast.arg):
            name = node.arg
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            name = node.id
        else:
            continue
        yield from re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower().split("_")


def test_no_new_name_has_a_word_of_our_own():
    """Lower the count where names have gone; a new name is of the glossary."""
    counts = Counter(word for file in FILES for word in identifiers(parsed(file)))
    assert {word: counts[word] for word in PRIVATE if counts[word] > PRIVATE[word]} == {}
    tree = ast.parse("class BestLeft:\n    def told(own): one = two")
    assert sorted(identifiers(tree)) == ["best", "left", "one", "own", "told"]


def first_lines(tree):
    """Yield the first line of every docstring of a file."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef):
            yield (ast.get_docstring(node) or "").partition("\n")[0]


def test_no_docstring_is_vague():
    lines = [line for file in FILES for line in first_lines(parsed(file))]
    assert [line for line in lines if re.match(VAGUE, line)] == []
    assert re.match(VAGUE, next(first_lines(ast.parse('"""Return which of them."""'))))
