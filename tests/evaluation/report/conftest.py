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
def flown_report():
    """Return the report of two methods on two seconds of a simulated array."""
    demo = load_scenario("demo")
    flight = simulate(msgspec.structs.replace(demo, duration_s=2.0), np.random.default_rng(1))
    resolver = resolver_named("lambda")
    comparison = compare(flight, [MaximumLikelihood(resolver=resolver), Rtk()])
    return comparison_report(comparison, flight, seed=17, source='name = "<demo>"')
