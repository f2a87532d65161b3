"""Sensors of every kind with random values, by the constants that they share."""

import numpy as np

from fgnav.geometry.rotations import exp
from fgnav.graph.factors.array_phase import ArrayPhase
from fgnav.graph.factors.array_shape import ArrayShape
from fgnav.graph.factors.barometer import BarometricHeight
from fgnav.graph.factors.baseline import BaselineVector
from fgnav.graph.factors.directions import Directions
from fgnav.graph.factors.gravity import Gravity
from fgnav.graph.factors.line_of_sight import LineOfSight
from fgnav.graph.factors.magnetometer import MagneticField
from fgnav.graph.factors.position import Position
from fgnav.graph.factors.vehicle.aerodynamic_angles import AerodynamicAngles
from fgnav.graph.factors.vehicle.resting_rate import RestingRate
from fgnav.graph.factors.vehicle.standstill import Standstill
from fgnav.graph.factors.vehicle.wheels import RollingWheels
from fgnav.graph.factors.velocity import Velocity
from tests.graph.factors import cases

K, ALL = 4, np.arange(4)
SHARED = cases.constants(3, 2, 3, 9, 2)
EARTH_N_RADPS = np.array([5e-2, 0.0, -4e-2])  # a thousand times the Earth's: so that it is seen
FIELD_N_UT = np.array([20.0, 1.0, 45.0])


def column(name, *, wanted=True):
    return SHARED.column(name) if wanted else -1


def whites(rng):
    return np.tril(rng.normal(size=(K, 3, 3))) + 2 * np.eye(3)


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def rates(rng, at):
    """Return a gyroscope's rates where the states have its bias."""
    return rng.normal(size=(K, 3)) if at.aux.shape[1] == 6 else None


def position(rng, _at, *, lever=False) -> Position:
    return Position(
        row=ALL,
        value_n_m=50 * rng.normal(size=(K, 3)),
        white=whites(rng),
        arm_b_m=rng.normal(size=3),
        lever_column=column("a", wanted=lever),
        constants=SHARED,
    )


def velocity(rng, at, *, lever=False, arm=True, constants=SHARED) -> Velocity:
    return Velocity(
        row=ALL,
        value_n_mps=10 * rng.normal(size=(K, 3)),
        white=whites(rng),
        arm_b_m=rng.normal(size=3) if arm else np.zeros(3),
        measured_b_radps=rates(rng, at),
        earth_rate_n_radps=EARTH_N_RADPS,
        lever_column=column("a", wanted=lever),
        constants=constants,
    )


def height(rng, _at, *, offset=True, sigma_m=0.4) -> BarometricHeight:
    return BarometricHeight(
        row=ALL,
        down_n_m=50 * rng.normal(size=K),
        sigma_m=sigma_m,
        arm_b_m=rng.normal(size=3),
        column=column("a", wanted=offset),
        node=np.array([0, 0, 1, 2]),
        share=np.array([0.0, 0.4, 0.9, 0.0]),
        constants=SHARED,
    )


def baseline(rng, _at, *, dimensions=3) -> BaselineVector:
    value, white = rng.normal(size=(K, 3)), whites(rng)
    if dimensions == 1:
        value[:, 2] = 0.0
        value = unit(value)
        white = np.zeros((K, 3, 3))
        white[:, 0] = 20.0 * np.stack([-value[:, 1], value[:, 0], 0 * value[:, 0]], axis=1)
    return BaselineVector(
        row=ALL,
        value_n_m=value,
        white=white,
        baseline_b_m=rng.normal(size=3),
        dimensions=dimensions,
        constants=SHARED,
    )


def array_shape(rng, _at, *, antennas=4, moved=()) -> ArrayShape:
    """Return an array; antennas that are ``moved`` have constants, by their names."""
    columns = [column(name) for name in moved] + [-1] * (antennas - len(moved))
    return ArrayShape(
        row=ALL,
        root=100 * rng.normal(size=(K, 3 * antennas, 3 * antennas)),
        minimum_n_m=rng.normal(size=(K, antennas, 3)),
        baselines_b_m=rng.normal(size=(antennas, 3)),
        column=np.array(columns),
        constants=SHARED,
    )


def array_phase(rng, _at, *, stretch=False, lasting=0) -> ArrayPhase:
    columns = np.full(K, -1)
    if stretch:
        columns[1:3] = column("d")
    return ArrayPhase(
        row=ALL,
        root=100 * rng.normal(size=(K, 9, 9)),
        minimum=exp(rng.normal(size=(K, 3))),
        element_column=columns,
        constants=SHARED,
        share=np.linspace(0.0, 0.9, K),
        basis=np.linalg.qr(rng.normal(size=(9, 9)))[0][:, :lasting],
    )


def directions(rng, at, known_n, size=0.02):
    """Return directions near known ones, and whitening rows of an ellipse across them."""
    e_b = unit(np.einsum("nji,nj->ni", at.R_nb, known_n) + size * rng.normal(size=(K, 3)))
    root = np.radians(rng.uniform(0.2, 1.0, size=(K, 3, 1))) * exp(rng.normal(size=(K, 3)))
    return e_b, Directions.of("some", e_b, root @ root.swapaxes(1, 2)).across_b


def gravity(rng, at, *, tilt=False) -> Gravity:
    known_n = unit(np.array([0.0, 0.0, 1.0]) + 0.01 * rng.normal(size=(K, 3)))
    return Gravity(
        row=ALL,
        known_n=known_n,
        across_b=directions(rng, at, known_n)[1],
        tilt_column=column("b", wanted=tilt),
        constants=SHARED,
    )


def sight(rng, at, *, boresight=False) -> LineOfSight:
    away_n = at.constants[column("a") :][:3] - at.p_n_m
    return LineOfSight(
        row=ALL,
        across_b=directions(rng, at, unit(away_n))[1],
        landmark_column=column("a"),
        boresight_column=column("b", wanted=boresight),
        constants=SHARED,
    )


def field(rng, at, *, iron=False) -> MagneticField:
    known_n = np.tile(unit(FIELD_N_UT), (K, 1))
    return MagneticField(
        row=ALL,
        across_b=directions(rng, at, known_n)[1],
        field_n_ut=FIELD_N_UT,
        iron_column=column("a", wanted=iron),
        constants=SHARED,
    )


def fins(rng, _at) -> AerodynamicAngles:
    return AerodynamicAngles(
        row=ALL,
        sigma_rad=rng.uniform(0.05, 0.2, (K, 2)),
        wind_column=column("b"),
        mean_column=column("e"),
        constants=SHARED,
    )


def wheels(rng, at) -> RollingWheels:
    return RollingWheels(
        row=ALL,
        slip_mps=0.3,
        arm_b_m=rng.normal(size=3),
        measured_b_radps=rates(rng, at),
        earth_rate_n_radps=EARTH_N_RADPS,
        axes_column=column("b"),
        axle_column=column("c"),
        constants=SHARED,
    )


def standstill(rng, _at) -> Standstill:
    return Standstill(row=ALL, sigma_mps=rng.uniform(0.01, 0.1, K))


def resting(rng, at) -> RestingRate:
    return RestingRate(
        row=ALL,
        measured_b_radps=1e-3 * rates(rng, at),
        sigma_radps=rng.uniform(1e-5, 1e-4, (K, 3)),
        earth_rate_n_radps=EARTH_N_RADPS,
        constants=SHARED,
    )
