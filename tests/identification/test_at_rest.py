"""Noises at rest and in motion, each by its own seconds."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.frontend.problem import build_problem
from fgnav.frontend.sensors.rest import AT_REST, Rest
from fgnav.frontend.settings import ProblemSettings
from fgnav.identification.likelihood.beside_phases import Scored, noise_in_motion
from fgnav.identification.likelihood.linear_chain import LinearChain
from fgnav.identification.likelihood.search import Found
from fgnav.identification.noise.identify import identify
from fgnav.identification.noise.noise_search import _completed
from fgnav.identification.noise.stated import with_factors, with_rest
from fgnav.identification.noise.thinned_flight import ThinnedFlight
from fgnav.identification.track.windows import EXCLUDED
from fgnav.integers.resolvers.truth import Truth
from fgnav.solve.chain import solve_batch
from tests.frontend.stops import AT_REST as SHAKES_AT_REST
from tests.frontend.stops import ON_ROAD, STOPS_S, stops

SETTINGS = ProblemSettings(resolver=Truth(), noise="identified")


FILTERED = 0.25  # of the error of velocities, at rest
LOUDER = (ON_ROAD / SHAKES_AT_REST)[[0, 3]]


@pytest.fixture(scope="module")
def flight():
    """A car whose unit has the stated noise at rest, where its receiver filters velocities."""
    flight = stops(3)
    imu, fixes = flight.imu, flight.fixes
    noises = ("accelerometer_noise_mps2_per_sqrt_hz", "gyroscope_noise_radps_per_sqrt_hz")
    quiet = {name: getattr(imu, name) / by for name, by in zip(noises, LOUDER, strict=True)}
    stands = np.any([(a <= fixes.t_s) & (fixes.t_s <= b) for a, b in STOPS_S], axis=0)
    v_n_mps = fixes.v_n_mps * np.where(stands, FILTERED, 1.0)[:, None]
    return replace(flight, imu=replace(imu, **quiet), fixes=replace(fixes, v_n_mps=v_n_mps))


@pytest.fixture(scope="module")
def small(flight):
    return ThinnedFlight.of(flight, build_problem(flight, SETTINGS), ())


@pytest.fixture(scope="module")
def identified(small):
    return identify(small)


def test_noises_at_rest_are_components_of_their_own(small):
    names = ("accelerometer", "gyroscope", "position", "velocity")
    assert {n for n in small.names if n.endswith(AT_REST)} == {n + AT_REST for n in names}


def test_noise_at_rest_is_not_taken_for_that_in_motion(identified):
    truth = {
        "velocity": 1.0,
        "velocity at rest": FILTERED,
        **dict(zip(("accelerometer", "gyroscope"), LOUDER, strict=True)),
    }
    for name, factor in truth.items():
        i = identified.names.index(name)
        assert abs(np.log(identified.factor[i] / factor)) < max(3 * identified.sigma[i], 0.1)
    assert "velocity at rest" in identified.factors
    assert "velocity" not in identified.factors


def test_noise_in_motion_is_the_likeliest_where_rest_is_as_stated(flight, small, identified):
    def changed(factors):
        build = build_problem(with_factors(flight, factors), with_rest(SETTINGS, factors))
        return ThinnedFlight.of(flight, build, ()).problem

    stated = Scored.of(small.problem, solve_batch(small.problem))
    noise = noise_in_motion(stated, changed)
    for name, factor in zip(("accelerometer", "gyroscope"), LOUDER, strict=True):
        sigma = identified.sigma[identified.names.index(name)]
        assert abs(np.log(noise.factors[name] / factor)) < 3 * sigma
    assert noise.nats > EXCLUDED


def test_the_score_is_the_slope_of_the_likelihood_at_rest_as_well(small):
    states = solve_batch(small.problem).states
    chain = LinearChain.of(small.problem, states, small.parts, small.scalable, small.at_rest)
    assert chain.names == small.names
    theta, h = np.linspace(-0.4, 0.4, len(small.names)), 1e-4
    score = chain.score(theta)
    for i, step in enumerate(h * np.eye(len(theta))):
        both = [chain.score(theta + sign * step).log_likelihood for sign in (1, -1)]
        np.testing.assert_allclose(
            score.gradient[i], (both[0] - both[1]) / (2 * h), rtol=2e-3, atol=1e-3
        )
    assert np.linalg.eigvalsh(score.information).min() > 0


def test_a_problem_has_the_noise_of_rest_where_it_rests(flight):
    at_rest = {"accelerometer": 0.125, "gyroscope": 0.2, "velocity": 0.5}
    plain, other = (build_problem(flight, replace(SETTINGS, at_rest=f)) for f in ({}, at_rest))
    share = plain.rest.share(plain.problem.t_s)
    assert share.max() == pytest.approx(1.0)
    assert share.min() == 0.0
    for name, factor in (("accelerometer", 0.125), ("gyroscope", 0.2)):
        before, after = (getattr(p.problem.motion, f"{name}_noise") for p in (plain, other))
        np.testing.assert_allclose(after / before, 1.0 + share * (factor**2 - 1.0))
    velocity, rested = (
        next(one for one in p.problem.measurements if one.name == "velocity")
        for p in (plain, other)
    )
    states = plain.problem.start.at(velocity.row)
    white = [one.linearise(states, np.arange(len(one.row))).value for one in (velocity, rested)]
    slower = np.where(plain.rest.contains(plain.problem.t_s[velocity.row]), 2.0, 1.0)
    np.testing.assert_allclose(white[1], white[0] * slower[:, None])


def test_a_filter_has_rest_only_once_it_is_over():
    until_s, t_s = np.array([2.0, 3.0, 7.0]), np.arange(0.0, 8.01, 0.25)
    whole, so_far = Rest(until_s), Rest(until_s, causal=True)
    inside = ((t_s > 1.0) & (t_s <= 3.0)) | ((t_s > 6.0) & (t_s <= 7.0))
    np.testing.assert_array_equal(whole.contains(t_s), inside)
    np.testing.assert_array_equal(so_far.contains(t_s), np.isin(t_s, until_s))
    np.testing.assert_allclose(whole.share(t_s), inside[1:])
    np.testing.assert_allclose(so_far.share(t_s), np.isin(t_s[1:], until_s))
    np.testing.assert_allclose(whole.share(np.array([0.5, 1.5, 6.5])), [0.5, 2.0 / 5.0])


@pytest.mark.parametrize(
    ("theta", "used", "after"),
    [
        ((2.0, 0.2), (True, False), (2.0, 0.2)),  # rest as stated, which that in motion is not
        ((2.0, 1.9), (True, False), (2.0, 2.0)),
        ((0.2, 2.0), (False, True), (0.2, 2.0)),
        ((1.9, 2.0), (False, True), (2.0, 2.0)),
        ((-0.2, -2.0), (False, True), (-0.2, -2.0)),  # quiet at rest: in motion as stated
        ((-1.9, -2.0), (False, True), (-1.9, -2.0)),
    ],
)
def test_what_is_not_identified_is_as_loud_as_the_other_or_as_stated(theta, used, after):
    theta, used = np.array(theta), np.array(used)
    free = Found(theta, np.full(2, 0.1), None, True)
    names = ("velocity", "velocity at rest")
    is_used = used | (np.array(after) != theta)
    result = _completed(names, free, theta, used, np.ones(2, dtype=bool))
    np.testing.assert_array_equal(result[0], after)
    np.testing.assert_array_equal(result[1], is_used)


def test_positions_that_repeat_at_rest_are_no_surer_than_stated():
    names, theta, used = ("position", "position at rest"), np.array([0.5, -2.0]), np.ones(2, bool)
    free = Found(theta, np.full(2, 0.1), None, True)
    after, is_used = _completed(names, free, theta, used, used)
    assert after[1] == 0.0
    assert not is_used[1]
    assert _completed(names, free, theta, used, ~used)[0][1] == 0.5
