"""Arcs of one antenna's phase: errors of satellites are stated."""

from dataclasses import replace
from itertools import chain

import gtsam
import numpy as np

from fgnav.evaluation.scores import errors_against
from fgnav.graph.build import flight_values
from fgnav.integers.resolvers.truth import Truth
from fgnav.methods.smoother import Batch, Smoother
from fgnav.process.hyperparameters import RatePrior
from fgnav.solve.linear import linearise
from tests.gnss.based import flown
from tests.solve.flights import flight_graph

PRIOR = RatePrior(length_s=1.0, variance_rad2ps2=np.full(3, 0.12), evidence=0.0)
SET_UP = {"resolver": Truth(), "rate_prior": PRIOR}


def test_errors_that_move_are_stated():
    """Positions and velocities of four flights; each has one draw of its satellites' errors."""
    position, velocity = [], []
    for seed in range(20_001, 20_005):
        flight = flown(base=None, span_s=12.0, seed=seed, message_errors=True)
        errors = errors_against(flight.truth, Smoother(lag_s=2.0, **SET_UP)(flight))
        position.append(np.mean(errors.position_nees))
        velocity.append(np.mean(errors.velocity_nees))
    assert 0.5 < np.mean(position) < 7.5  # 12 degrees of freedom: 99.8 %
    assert 1.5 < np.mean(velocity) < 4.5


def test_linear_factors_are_those_of_gtsams_graph():
    """Of all sensors and epochs at once, and one by one."""
    problem = Batch(**SET_UP).prepare(flown(base=None, span_s=4.0)).problem
    problem, states = replace(problem, phase=None), problem.start
    ours = gtsam.GaussianFactorGraph()
    for factor in chain.from_iterable(linearise(problem, states).factors):
        ours.push_back(factor)
    theirs = flight_graph(problem, states).linearize(flight_values(problem, states))
    (H, g), (expected, slope) = ours.hessian(), theirs.hessian()
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(H / scale, expected / scale, rtol=0, atol=1e-9 * scale.max())
    np.testing.assert_allclose(g, slope, rtol=0, atol=1e-9 * np.abs(slope).max())
