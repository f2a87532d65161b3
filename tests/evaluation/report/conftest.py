"""A short flight through an array, and what a report makes of it."""

import msgspec
import numpy as np
import pytest

from fgnav.evaluation.comparison import compare
from fgnav.evaluation.report.contents import comparison_report
from fgnav.integers.resolvers.registry import resolver_named
from fgnav.methods.maximum_likelihood import MaximumLikelihood
from fgnav.methods.rtk import Rtk
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate


@pytest.fixture(scope="package")
def flown():
    """Return a flight of two seconds through an array, and two methods' comparison on it."""
    demo = load_scenario("demo")
    flight = simulate(msgspec.structs.replace(demo, duration_s=2.0), np.random.default_rng(1))
    resolver = resolver_named("lambda")
    return flight, compare(flight, [MaximumLikelihood(resolver=resolver), Rtk()])


@pytest.fixture(scope="package")
def flown_report(flown):
    """Return the report of that flight."""
    flight, comparison = flown
    return comparison_report(comparison, flight, seed=17, source='name = "<demo>"')
