"""One of every sensor, of random measurements."""

import numpy as np

from fgnav.geometry.rotations import exp
from fgnav.graph.delayed import (
    CLOCK_OFFSET,
    CLOCK_RATE,
    VELOCITY_DELAY,
    TimedMotion,
    on_clock,
)
from fgnav.graph.factors import array_phase, barometer, gravity, line_of_sight, magnetometer
from fgnav.graph.factors.array_shape import ArrayShape
from fgnav.graph.factors.baseline import BaselineVector
from fgnav.graph.factors.directions import Directions
from fgnav.graph.factors.position import LEVER_ARM, Position
from fgnav.graph.factors.vehicle import aerodynamic_angles, wheels
from fgnav.graph.factors.vehicle.resting_rate import RestingRate
from fgnav.graph.factors.vehicle.standstill import Standstill
from fgnav.graph.factors.velocity import Velocity
from fgnav.graph.types.parameters import Parameters, flight_constant

K = 4
ROWS = np.arange(K)
EARTH_N_RADPS = np.array([5e-2, 0.0, -4e-2])  # a thousand times the Earth's: so that it is seen
FIELD_N_UT = np.array([20.0, 1.0, 45.0])
SIZES = {
    "another": 2,  # of no sensor
    LEVER_ARM: 3,
    array_phase.FLOAT_AMBIGUITIES: 18,
    "antenna a2": 3,
    barometer.OFFSET: 3,
    gravity.TILT: 2,
    line_of_sight.LANDMARK: 3,
    line_of_sight.BORESIGHT: 2,
    magnetometer.HARD_IRON: 3,
    aerodynamic_angles.WIND: 2,
    aerodynamic_angles.MEAN: 2,
    wheels.AXES: 2,
    wheels.AXLE: 3,
    CLOCK_OFFSET: 1,
    CLOCK_RATE: 1,
    VELOCITY_DELAY: 1,
}


def constants(*names):
    """Return constants of these names."""
    parts = (flight_constant(n, tuple(map(str, range(SIZES[n]))), "m", 1.0) for n in names)
    return Parameters(tuple(parts))


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def across(rng, e_b):
    """Return whitening rows of an ellipse of 0.2 to 1 degree across directions."""
    sigma_rad = np.radians(rng.uniform(0.2, 1.0, size=(len(e_b), 3, 1)))
    root = sigma_rad * exp(rng.normal(size=(len(e_b), 3)))
    return Directions.of("some", e_b, root @ root.swapaxes(1, 2)).across_b


def lower(rng):
    return np.tril(rng.normal(size=(K, 3, 3))) + 2 * np.eye(3)


def position(rng, _at):
    value_n_m, arm_b_m = 50 * rng.normal(size=(K, 3)), rng.normal(size=3)
    return Position(row=ROWS, value_n_m=value_n_m, white=lower(rng), arm_b_m=arm_b_m)


def velocity(rng, at, *, arm=True):
    gyroscope = at.aux.shape[1] == 6
    return Velocity(
        row=ROWS,
        value_n_mps=10 * rng.normal(size=(K, 3)),
        white=lower(rng),
        arm_b_m=rng.normal(size=3) if arm else np.zeros(3),
        measured_b_radps=rng.normal(size=(K, 3)) if gyroscope else None,
        earth_rate_n_radps=EARTH_N_RADPS,
    )


def accelerometer_velocity(rng, at):
    return velocity(rng, at, arm=False)


def timed(rng, at):
    gyroscope, force = at.aux.shape[1] == 6, rng.normal(size=(K, 3))
    return TimedMotion(
        since_s=np.array([-20.0, 5.0, 10.0, 30.0]),
        force_before_b_mps2=force,  # the same before and after: differences cross zero
        force_after_b_mps2=force,
        led=np.ones(K, dtype=bool),
        measured_b_radps=rng.normal(size=(K, 3)) if gyroscope else None,
        slope_b_radps2=rng.normal(size=(K, 3)) if gyroscope else None,
        gravity_n_mps2=np.tile([0.0, 0.0, 9.8], (K, 1)),
        earth_rate_n_radps=EARTH_N_RADPS,
    )


def late_velocity(rng, at):
    times = constants(CLOCK_OFFSET, CLOCK_RATE, VELOCITY_DELAY)
    return on_clock(velocity(rng, at).bound(times), timed(rng, at), delay=VELOCITY_DELAY)


def phases(rng, _at, *, correlated=0):
    return array_phase.ArrayPhase(
        row=ROWS,
        root=100 * rng.normal(size=(K, 9, 9)),
        minimum=exp(rng.normal(size=(K, 3))),
        stretch=np.array([-1, 0, 1, -1]),
        share=np.linspace(0.0, 0.9, K),
        basis=np.linalg.qr(rng.normal(size=(9, 9)))[0][:, :correlated],
    )


def shape(rng, _at):
    return ArrayShape(
        row=ROWS,
        root=100 * rng.normal(size=(K, 12, 12)),
        minimum_n_m=rng.normal(size=(K, 4, 3)),
        baselines_b_m=rng.normal(size=(4, 3)),
        antennas=("a1", "a2", "a3", "a4"),
    )


def baseline(rng, dimensions):
    value, white = rng.normal(size=(K, 3)), lower(rng)
    if dimensions == 1:
        value = unit(value * [1.0, 1.0, 0.0])
        white = np.zeros((K, 3, 3))
        white[:, 0] = 20.0 * np.stack([-value[:, 1], value[:, 0], 0 * value[:, 0]], axis=1)
    return BaselineVector(
        row=ROWS,
        value_n_m=value,
        white=white,
        baseline_b_m=rng.normal(size=3),
        dimensions=dimensions,
    )


def vector(rng, _at):
    return baseline(rng, 3)


def heading(rng, _at):
    return baseline(rng, 1)


def down(rng, at):
    known_n = unit(np.array([0.0, 0.0, 1.0]) + 0.01 * rng.normal(size=(K, 3)))
    e_b = unit(np.einsum("nji,nj->ni", at.R_nb, known_n) + 0.02 * rng.normal(size=(K, 3)))
    return gravity.Gravity(row=ROWS, known_n=known_n, across_b=across(rng, e_b))


def sight(rng, at, landmark_n_m=None):
    away_n = (at.constants[:3] if landmark_n_m is None else landmark_n_m) - at.p_n_m
    e_b = unit(np.einsum("nji,nj->ni", at.R_nb, unit(away_n)) + 0.02 * rng.normal(size=(K, 3)))
    return line_of_sight.LineOfSight(row=ROWS, across_b=across(rng, e_b))


def field(rng, at):
    e_b = unit(np.einsum("nji,j->ni", at.R_nb, FIELD_N_UT) + rng.normal(size=(K, 3)))
    of = across(rng, e_b)
    return magnetometer.MagneticField(row=ROWS, across_b=of, field_n_ut=FIELD_N_UT)


def height(rng, _at, *, sigma_m=0.4):
    return barometer.BarometricHeight(
        row=ROWS,
        down_n_m=50 * rng.normal(size=K),
        sigma_m=sigma_m,
        arm_b_m=rng.normal(size=3),
        node=np.array([0, 0, 1, 2]),
        share=np.array([0.0, 0.4, 0.9, 0.0]),
    )


def rolling(rng, at):
    gyroscope = at.aux.shape[1] == 6
    return wheels.RollingWheels(
        row=ROWS,
        slip_mps=0.3,
        arm_b_m=rng.normal(size=3),
        measured_b_radps=rng.normal(size=(K, 3)) if gyroscope else None,
        earth_rate_n_radps=EARTH_N_RADPS,
    )


def airflow(rng, _at):
    sigma_rad = rng.uniform(0.05, 0.2, (K, 2))
    return aerodynamic_angles.AerodynamicAngles(row=ROWS, sigma_rad=sigma_rad)


def standing(rng, _at):
    return Standstill(row=ROWS, sigma_mps=rng.uniform(0.01, 0.1, K))


def resting(rng, _at):
    return RestingRate(
        row=ROWS,
        measured_b_radps=rng.normal(scale=1e-3, size=(K, 3)),
        sigma_radps=rng.uniform(1e-5, 1e-4, (K, 3)),
        earth_rate_n_radps=EARTH_N_RADPS,
    )
