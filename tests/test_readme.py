"""What the documents tell users to type is there."""

import re
from pathlib import Path

import pytest

from fgnav import plugins
from fgnav.gravity import ESTIMATORS
from fgnav.integers.resolvers.registry import resolver_names
from fgnav.methods import METHODS

ROOT = Path(__file__).parents[1]
DOCUMENTS = sorted(
    [
        *ROOT.glob("*.md"),
        *ROOT.glob("models/**/*.md"),
        *ROOT.glob("sim/*.md"),
        *ROOT.glob("docs/**/*.md"),
    ]
)


def typed(option: str) -> set[str]:
    """Return the values that the documents give an option, lists taken apart."""
    text = "\n".join(path.read_text(encoding="utf-8") for path in DOCUMENTS)
    given = re.findall(rf"--{option} ([a-z][a-z,-]*)(?![\w:])", text)
    return {name for values in given for name in values.split(",") if name}


@pytest.mark.parametrize(
    ("option", "known"),
    [
        ("integers", resolver_names()),
        ("gravity", plugins.names("fgnav.gravity", ESTIMATORS)),
        ("method", plugins.names("fgnav.methods", METHODS)),
    ],
)
def test_names_in_the_documents_are_registered(option, known):
    assert typed(option) <= set(known)


def test_documents_name_methods():
    assert typed("method")
