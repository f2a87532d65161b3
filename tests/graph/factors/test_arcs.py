"""Arcs of one antenna's phase: errors of satellites are stated."""

import numpy as np

from fgnav.evaluation.scores import errors_against
from fgnav.integers.resolvers.truth import Truth
from fgnav.methods.smoother import Smoother
from fgnav.process.hyperparameters import RatePrior
from tests.gnss.based import flown

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
