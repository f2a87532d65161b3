import subprocess
import sys
from importlib.metadata import EntryPoint

import pytest

from fgnav import plugins
from fgnav.checks import BadInputError
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.integers.resolvers.registry import resolver_named, resolver_names
from fgnav.integers.resolvers.rounding import Rounding
from fgnav.integers.resolvers.truth import Truth

OWN = ("rounding", "lambda", "constrained", "lambda-arcs", "constrained-arcs", "truth")


def test_own_resolvers_go_by_their_names():
    assert resolver_names()[: len(OWN)] == OWN
    for name in OWN:
        assert resolver_named(name).name == name
    assert resolver_named("lambda") == Lambda()


def test_installed_resolver_is_found_by_its_entry_point(monkeypatch):
    entry = EntryPoint(
        name="mine", value="fgnav.integers.resolvers.rounding:Rounding", group="fgnav.resolvers"
    )
    monkeypatch.setattr(plugins, "entry_points", lambda group: [entry] if group else [])
    assert resolver_names() == (*OWN, "mine")
    assert resolver_named("mine") == Rounding()


def test_unknown_resolver_lists_the_known_ones():
    with pytest.raises(BadInputError, match=r"integers 'guess': not one of rounding, lambda, con"):
        resolver_named("guess")


def test_resolvers_are_values():
    assert Lambda() == Lambda(joint=True)
    assert len({Lambda(), Lambda(ratio_min=3.0), Rounding(), Truth()}) == 4


def test_names_are_known_without_loading_the_compiled_search():
    code = (
        "import sys, fgnav.integers, fgnav.integers.resolvers.registry as r; r.resolver_names(); "
        "sys.exit('numba' in sys.modules or 'scipy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
