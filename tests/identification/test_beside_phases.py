"""Faults of the unit beside phases of arcs: told by the whole problem, not by its thinned chain."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.frontend.causal.truncation import truncated
from fgnav.frontend.problem import build_problem
from fgnav.geometry.rotations import exp
from fgnav.identification.likelihood.beside_phases import (
    is_misfit,
    noise_gain,
    white_noise,
)
from fgnav.identification.likelihood.linear_chain import LinearChain
from fgnav.identification.noise.stated import with_factors
from fgnav.identification.spans.beside_phases import offsets_by_phases
from fgnav.integers.resolvers.truth import Truth
from fgnav.solve.chain import solve_batch
from tests.benchmarks.consistency import flown
from tests.identification.identified import SETTINGS, found_in
from tests.robustness.drawn.flights import right_flight

FROM_S, UNTIL_S = 4.1, 7.3
KEYFRAMES_S = 0.2
TURNED = exp(np.radians([[0.0, 0.0, 3.0]]))[0]


def changed(flight, field, by, from_s=FROM_S, until_s=UNTIL_S):
    imu = flight.imu
    x = getattr(imu, field)
    inside = (imu.t_s > from_s) & (imu.t_s <= until_s)
    return replace(flight, imu=replace(imu, **{field: np.where(inside[:, None], by(x), x)}))


def test_a_scale_that_doppler_does_not_show_is_found():
    """As stated its attitude NEES was 42, and nothing was said; now 2.5."""
    flight = changed(right_flight("raw", 743), "w_b_radps", lambda w: w * [1.0, 1.0, 0.7])
    fault = found_in(flight).faults[0]
    assert (fault.sensor, fault.shape, fault.is_likely) == ("gyroscope", "scale", True)
    for at_s, (first_s, last_s) in ((FROM_S, fault.begins_s), (UNTIL_S, fault.ends_s)):
        assert first_s - KEYFRAMES_S <= at_s <= last_s + KEYFRAMES_S
    off = fault.value - [0.0, 0.0, 1 - 1 / 0.7]
    assert np.all(np.abs(off) < 4 * fault.sigma)


def test_a_right_unit_is_not_accused():
    found = found_in(right_flight("raw", 743))
    assert not any(one.is_likely for one in found.faults)
    assert found.cause is None


def test_a_gain_is_half_of_what_the_cost_falls_by_without_it():
    flight = changed(right_flight("raw", 744), "f_b_mps2", lambda f: f @ TURNED)
    problem = build_problem(flight, SETTINGS).problem
    offset = offsets_by_phases(problem)[0]
    from_s, until_s = problem.t_s[[offset.begin, offset.end]]
    assert (offset.sensor, offset.shape) == ("accelerometer", "turn")

    def back(f):
        return f - np.cross(f, offset.value)

    less = changed(replace(flight, imu=problem.motion.imu), "f_b_mps2", back, from_s, until_s)
    motion = replace(problem.motion, imu=less.imu)
    costs = [solve_batch(one).cost for one in (problem, replace(problem, motion=motion))]
    assert (costs[0] - costs[1]) / 2 == pytest.approx(offset.gain, rel=0.05)


def test_ten_epochs_whose_phases_misfit_accuse_no_gyroscope():
    """Of an array whose messages state no ionosphere: 23 times as loud gains one nat."""
    flight = truncated(flown("gyro", 852_001), 0.91)
    flight = replace(flight, broadcast=replace(flight.broadcast, klobuchar=np.zeros(8)))
    settings = replace(SETTINGS, resolver=Truth())
    problem = build_problem(flight, settings).problem

    def louder(factors):
        return build_problem(with_factors(flight, factors), settings).problem

    assert is_misfit(problem, solve_batch(problem).cost)
    assert 0.0 < noise_gain({"gyroscope": 23.0}, louder) < 4.0
    assert white_noise(problem, louder).factors == {}


def test_noise_gains_what_its_likelihood_does():
    """Of a problem without phases the chain has its likelihood, whose score is integrated."""
    flight, factor = right_flight("fixes", 741), 5.0
    problem = build_problem(flight, SETTINGS).problem
    parts = problem.motion.noise_parts()
    chain = LinearChain.of(problem, solve_batch(problem).states, parts, ())
    theta = np.where(np.array(chain.names) == "gyroscope", np.log(factor), 0.0)
    gained = chain.score(theta).log_likelihood - chain.score(0 * theta).log_likelihood

    def louder(factors):
        return build_problem(with_factors(flight, factors), SETTINGS).problem

    assert noise_gain({"gyroscope": factor}, louder) == pytest.approx(gained, rel=0.02)
    assert noise_gain({}, louder) == 0.0
