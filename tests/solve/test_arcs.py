"""Arcs in every solver: GTSAM's window, filter and batch against the chain's."""

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.evaluation.scores import errors_against
from fgnav.integers.resolvers.truth import Truth
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav.process.hyperparameters import RatePrior
from fgnav.solve.chain.linear import Links, linearise
from fgnav_sim.gnss.tables import BodyMaskTable, OutageTable, SlipsTable
from tests.gnss.based import flown

PRIOR = RatePrior(length_s=1.0, variance_rad2ps2=np.full(3, 0.12), evidence=0.0)
SET_UP = {"resolver": Truth(), "rate_prior": PRIOR}


@cache
def disturbed(*, gyroscope=False):
    """Slips, and an outage; or satellites that the body hides when it leans, a few each second."""
    if gyroscope:
        hidden = BodyMaskTable(axes_b=((0.0, 0.0, -1.0),), half_angle_deg=65.0)
        return flown(base=None, span_s=12.0, seed=20_001, gyroscope=True, body_mask=hidden)
    outage = OutageTable(from_s=5.0, until_s=6.5)
    slips = SlipsTable(rate_per_hour=100.0, flagged_share=0.5)
    return flown(base=None, span_s=12.0, seed=20_001, outages=(outage,), slips=slips)


@pytest.mark.parametrize("gyroscope", [False, True])
@pytest.mark.parametrize("method", [Smoother, Forward, Batch])
def test_the_chain_agrees_with_gtsam(method, gyroscope):
    set_up = {"rate_prior": PRIOR} if method is Forward else {"lag_s": 2.0, **SET_UP}
    flight = disturbed(gyroscope=gyroscope)
    one, two = (method(solver=solver, **set_up)(flight) for solver in ("gtsam", "chain"))
    sigma_m = np.sqrt(np.einsum("nii->ni", one.position_covariance_m2))
    assert (np.abs(one.p_n_m - two.p_n_m) < 0.03 * sigma_m).all()
    sigma = np.sqrt(np.einsum("nii->ni", one.velocity_covariance_m2ps2))
    assert (np.abs(one.v_n_mps - two.v_n_mps) < 0.05 * sigma).all()
    assert_allclose(
        np.einsum("nii->ni", one.position_covariance_m2),
        np.einsum("nii->ni", two.position_covariance_m2),
        rtol=0.03,
    )


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


def test_a_chain_without_room_for_arcs_is_refused_and_not_written_beyond():
    problem = Batch(**SET_UP).prepare(disturbed()).problem
    rows, before = np.arange(len(problem.t_s)), problem.start.at(slice(0, -1))
    links = Links.empty(len(rows), problem.width, problem.constants.width)
    with pytest.raises(ValueError, match="columns, of states, constants, arcs and 1 too few"):
        linearise(problem, rows, problem.start, before, links, rows)
