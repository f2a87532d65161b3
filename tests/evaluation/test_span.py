"""A part of a recording: what lies outside is gone, and times keep their zero."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.evaluation.comparison import compare
from fgnav.evaluation.span import within
from fgnav.integers.resolvers.registry import resolver_named
from fgnav.methods.maximum_likelihood import MaximumLikelihood
from fgnav.types.flight import InitialAttitude
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate


@pytest.fixture(scope="module")
def flight():
    import msgspec

    approach = load_scenario("approach")
    return simulate(msgspec.structs.replace(approach, duration_s=4.0), np.random.default_rng(1))


def test_what_lies_outside_is_gone(flight):
    part = within(flight, 1.0, 2.0)
    for name in ("observations", "imu"):
        t_s, whole_s = getattr(part, name).t_s, getattr(flight, name).t_s
        np.testing.assert_array_equal(t_s, whole_s[(whole_s >= 1.0) & (whole_s <= 2.0)])
    inside = np.isin(flight.observations.t_s, part.observations.t_s)
    np.testing.assert_array_equal(part.observations.code_m, flight.observations.code_m[inside])
    assert len(part.imu.f_b_mps2) == len(part.imu.t_s)
    assert part.truth.t_s[0] <= 1.0 < 2.0 <= part.truth.t_s[-1]
    assert len(part.truth.t_s) < len(flight.truth.t_s)


def test_a_method_says_of_a_part_what_it_says_of_the_whole(flight):
    method = MaximumLikelihood(resolver=resolver_named("truth"))
    whole, part = method(flight), method(within(flight, 1.0, 3.0))
    rows = np.isin(whole.t_s, part.t_s)
    assert rows.sum() == len(part.t_s) > 15
    np.testing.assert_allclose(part.R_nb, whole.R_nb[rows], atol=1e-6)


def test_epochs_at_both_ends_are_judged(flight):
    method = MaximumLikelihood(resolver=resolver_named("truth"))
    of = compare(within(flight, 1.05, 2.95), [method]).methods[0]
    assert len(of.errors.t_s) == len(of.estimate.t_s)


def test_no_times_are_the_flight_itself(flight):
    assert within(flight, None, None) is flight


def test_what_is_known_of_the_start_goes_with_the_start(flight):
    known = replace(flight, initial=InitialAttitude(roll_rad=0.0, roll_sigma_rad=0.1))
    assert within(known, None, 2.0).initial is not None
    assert within(known, 1.0, None).initial is None


def test_times_in_the_wrong_order_and_an_empty_part_are_errors(flight):
    with pytest.raises(BadInputError, match="--from 3 --until 2: the first must be the earlier"):
        within(flight, 3.0, 2.0)
    with pytest.raises(BadInputError, match="measured nothing then"):
        within(flight, 100.0, 200.0)
