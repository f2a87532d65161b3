"""Measurements of other times than their keyframes'."""

from dataclasses import replace

import numpy as np

from fgnav.graph.delayed import (
    CLOCK_OFFSET,
    CLOCK_RATE,
    VELOCITY_DELAY,
    TimedMotion,
    on_clock,
    on_gnss_time,
)
from fgnav.graph.factors.position import Position
from fgnav.graph.types.parameters import Parameters, flight_constant
from fgnav.graph.types.solution import Solution
from tests.graph.factors import cases, sensors
from tests.graph.factors.sensors import K

TIMES = Parameters(
    (
        flight_constant("x", ("x",), "m", 1.0),
        flight_constant(CLOCK_OFFSET, ("offset",), "s", 0.3),
        flight_constant(CLOCK_RATE, ("rate",), "ppm", 1e3),
        flight_constant(VELOCITY_DELAY, ("delay",), "s", 0.3),
    )
)
VALUES = np.array([0.0, 0.03, 2000.0, 0.1])


def test_a_position_is_met_where_the_body_is_by_the_clock_of_gnss():
    """Tags 0.1 s too great: the measurement is of 0.1 s later than the state, at 10 m/s."""
    at = cases.random_states(1, np.random.default_rng(3), TIMES, gyroscope=True)
    at = at._replace(
        R_nb=np.eye(3)[None],
        p_n_m=np.zeros((1, 3)),
        v_n_mps=np.array([[10.0, 0.0, 0.0]]),
        aux=np.zeros((1, 6)),
        constants=np.array([0.0, -0.1, 0.0, 0.0]),
    )
    level = TimedMotion(
        since_s=np.zeros(1),
        force_before_b_mps2=np.array([[0.0, 0.0, -9.8]]),
        force_after_b_mps2=np.array([[2.0, 0.0, -9.8]]),
        led=np.ones(1, dtype=bool),
        measured_b_radps=np.zeros((1, 3)),
        slope_b_radps2=np.zeros((1, 3)),
        gravity_n_mps2=np.array([[0.0, 0.0, 9.8]]),
        earth_rate_n_radps=np.zeros(3),
    )
    position = Position(
        row=np.zeros(1, dtype=int),
        value_n_m=np.array([[1.01, 0.0, 0.0]]),
        white=np.eye(3)[None],
        arm_b_m=np.zeros(3),
    )
    late = on_clock(position.bound(TIMES), level)
    assert np.abs(late.linearise(at, np.zeros(1, dtype=int)).value).max() < 1e-14


def test_without_clock_or_delay_a_measurement_stays_as_it_is():
    rng, none = np.random.default_rng(4), sensors.constants("another")
    at = cases.random_states(K, rng, none, gyroscope=True)
    part = sensors.velocity(rng, at).bound(none)
    assert on_clock(part, sensors.timed(rng, at), delay=VELOCITY_DELAY) is part


def test_covariances_of_solutions_on_gnss_time_are_those_of_samples():
    rng = np.random.default_rng(5)
    at = cases.random_states(K, rng, TIMES, gyroscope=True)._replace(constants=VALUES)
    motion = sensors.timed(rng, at)
    D, b = at.width, TIMES.width
    scale = np.concatenate([np.full(D, 1e-3), [1e-3, 1e-3, 1.0, 1e-3]])
    root = scale[:, None] * np.tril(rng.normal(size=(D + b, D + b)))
    P = root @ root.T
    solution = Solution(
        states=at,
        covariance=np.tile(P[:D, :D], (K, 1, 1)),
        cross=None,
        constant_covariance=np.tile(P[D:, D:], (K, 1, 1)),
        constant_cross=np.tile(P[:D, D:], (K, 1, 1)),
        converged=True,
    )
    carried = on_gnss_time(solution, motion, TIMES)
    drawn = root @ rng.normal(size=(D + b, 4000))
    places = np.array(
        [
            on_gnss_time(
                replace(solution, states=at.moved(np.tile(x[:D], (K, 1)), x[D:])), motion, TIMES
            ).states.v_n_mps[0]
            for x in drawn.T
        ]
    )
    np.testing.assert_allclose(
        np.cov(places.T), carried.covariance[0, 6:9, 6:9], rtol=0.2, atol=0.1 * 1e-4
    )
