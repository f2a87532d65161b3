import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from fgnav_sim.vehicle.flown_table import FlownTable, WindTable
from fgnav_sim.vehicle.forces import (
    CANARD,
    COEFFICIENTS,
    FINS,
    SIZE,
    airframe,
    axisymmetric,
    canards,
    coefficients_at,
    wind_at,
)  # fmt: skip
from fgnav_sim.vehicle.model import NO_GUST, pack
from fgnav_sim.vehicle.tables import Airframe, Axisymmetric, BodyTable, Vehicle
from tests.sim.vehicle.reference import ROCKET, fly, launch, rate_ib_b_radps

BODY_ONLY = BodyTable(mass_kg=2.0, inertia_kgm2=(1.0, 1.2, 1.3))
DENSITY = 1.1


def packed(
    vehicle: Vehicle, gust_mps: np.ndarray = NO_GUST, **table: object
) -> tuple[np.void, np.ndarray]:
    model = pack(vehicle, FlownTable(vehicle=vehicle, **table), 1.0, gust_mps)
    return model.body, model.tables


def flow(v_b: np.ndarray, w_b: np.ndarray) -> tuple:
    return DENSITY, 0.5 * DENSITY * float(v_b @ v_b), tuple(v_b), tuple(w_b)


@pytest.mark.parametrize("rate_terms", ["d/v", "d/2v"])
def test_a_body_of_revolution_feels_each_force_and_moment_of_the_vector_equations(
    rate_terms: str,
) -> None:
    rng = np.random.default_rng(5)
    d = 0.2
    names = Axisymmetric.coefficients()
    for _ in range(20):
        c = dict(zip(names, rng.uniform(-2, 2, len(names)), strict=True))
        shape = Axisymmetric(diameter_m=d, rate_terms=rate_terms, **c)
        body, tables = packed(Vehicle(body=BODY_ONLY, aerodynamics=shape))
        V, w = np.array([80.0, 0, 0]) + rng.uniform(-30, 30, 3), rng.uniform(-5, 5, 3)
        out = np.empty(COEFFICIENTS)
        coefficients_at(body, tables, 0.3, out)
        force, moment, slowing = axisymmetric(body, out, flow(V, w), w[0])

        u, v, p = np.array([1.0, 0, 0]), np.linalg.norm(V), w[0]
        k = 1.0 if rate_terms == "d/v" else 0.5
        S, du, a2 = np.pi * d**2 / 4, np.cross(w, u), np.arccos(V[0] / v) ** 2
        q = DENSITY * S / 2
        expected = -q * v * (c["cd0"] + c["cd2"] * a2) * V
        expected = expected + q * (c["cl1"] + c["cl3"] * a2) * (v**2 * u - (V @ u) * V)
        expected += q * d * v * k * c["cnq"] * du + q * d * p * k * c["cmf"] * np.cross(V, u)
        assert np.array(force) == pytest.approx(expected, rel=1e-9, abs=1e-9)
        expected = q * d * v * (c["cm1"] + c["cm3"] * a2) * np.cross(V, u)
        expected = expected + q * d**2 * v * k * c["cmq"] * np.cross(u, du)
        expected += q * d**2 * p * k * c["cmm"] * np.cross(u, np.cross(V, u))
        assert np.array(moment) == pytest.approx(expected, rel=1e-9, abs=1e-9)
        assert slowing == pytest.approx(q * d**2 * v * k * c["cspin"] * p, rel=1e-9)


def test_an_airframe_lifts_and_turns_by_its_linear_derivatives() -> None:
    shape = Airframe(
        area_m2=0.7, span_m=3.0, chord_m=0.25, cd0=0.02, cdk=0.04, cl0=0.2, cla=5.0, cyb=-0.3,
        clb=-0.05, clp=-0.5, clr=0.1, cm0=0.02, cma=-0.8, cmq=-12.0, cnb=0.06, cnp=-0.04, cnr=-0.1,
    )  # fmt: skip
    body, tables = packed(Vehicle(body=BODY_ONLY, aerodynamics=shape))
    c = np.empty(COEFFICIENTS)
    coefficients_at(body, tables, 0.1, c)
    a, b, v = 0.05, 0.03, 20.0
    V = v * np.array([np.cos(a) * np.cos(b), np.sin(b), np.sin(a) * np.cos(b)])
    p, q, r = w = np.array([0.3, -0.2, 0.1])
    force, moment = airframe(body, c, flow(V, w))
    qs = 0.5 * DENSITY * v**2 * 0.7
    lift = 0.2 + 5.0 * a
    drag = 0.02 + 0.04 * lift**2
    expected = qs * (-drag * V / v + lift * np.array([np.sin(a), 0, -np.cos(a)]))
    expected[1] += qs * -0.3 * b
    assert np.array(force) == pytest.approx(expected, rel=1e-9)
    h = 1 / (2 * v)
    roll = 3.0 * (-0.05 * b + (-0.5 * p + 0.1 * r) * 3.0 * h)
    pitch = 0.25 * (0.02 - 0.8 * a - 12.0 * q * 0.25 * h)
    yaw = 3.0 * (0.06 * b + (-0.04 * p - 0.1 * r) * 3.0 * h)
    assert np.array(moment) == pytest.approx(qs * np.array([roll, pitch, yaw]), rel=1e-9)


def test_coefficients_are_cubic_splines_of_mach_and_their_ends_hold() -> None:
    assert isinstance(ROCKET.aerodynamics, Axisymmetric)
    body, tables = packed(ROCKET)
    grid, cd0 = ROCKET.aerodynamics.mach, ROCKET.aerodynamics.cd0
    out = np.empty(COEFFICIENTS)
    for mach in (0.0, 0.3, 0.97, 1.05, 2.9):
        coefficients_at(body, tables, mach, out)
        assert out[0] == pytest.approx(CubicSpline(grid, cd0)(mach), rel=1e-12)
    coefficients_at(body, tables, 7.0, out)
    assert out[0] == pytest.approx(0.36)
    assert out[CANARD] == pytest.approx(2.2)


def test_wind_is_linear_between_heights_and_constant_outside() -> None:
    wind = WindTable(
        height_m=(0.0, 100.0, 300.0), north_mps=(1.0, 3.0, 3.0), east_mps=(0.0, -4.0, 8.0)
    )
    body, tables = packed(ROCKET, wind=wind)
    heights = (-50.0, 50.0, 250.0, 900.0)
    assert [wind_at(body, tables, h, 0.0) for h in heights] == [
        (1.0, 0.0, 0.0), (2.0, -2.0, 0.0), (3.0, 5.0, 0.0), (3.0, 8.0, 0.0),
    ]  # fmt: skip


def test_gusts_follow_the_distance_through_the_air_and_the_last_one_stays() -> None:
    gust = np.array([[0.0, 0.0, 0.0], [2.0, 4.0, 6.0], [4.0, 0.0, -6.0]])
    body, tables = packed(ROCKET, gust)
    assert wind_at(body, tables, 0.0, 2.5) == (1.0, 2.0, 3.0)
    assert wind_at(body, tables, 0.0, 7.5) == (3.0, 2.0, 0.0)
    assert wind_at(body, tables, 0.0, 500.0) == (4.0, 0.0, -6.0)


def test_a_single_gust_is_a_wind_too() -> None:
    body, tables = packed(ROCKET, np.array([[1.0, 2.0, 3.0]]))
    assert wind_at(body, tables, 0.0, 5.0) == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("deflections", "axis", "sign"),
    [((1, 1, 1, 1), 0, 1), ((-1, 0, 1, 0), 1, 1), ((0, -1, 0, 1), 2, 1), ((1, 0, -1, 0), 1, -1)],
)
def test_canards_roll_together_and_pitch_and_yaw_in_pairs(
    deflections: tuple[int, ...], axis: int, sign: int
) -> None:
    body, _ = packed(ROCKET)
    y = np.zeros(SIZE)
    y[FINS:] = 0.05 * np.array(deflections)
    along = flow(np.array([200.0, 0, 0]), np.zeros(3))
    _, moment = canards(body, 3.0, 1.8, along, y)
    assert sign * moment[axis] > 0
    others = np.delete(np.array(moment), axis)
    assert np.abs(others).max() < 1e-12
    pressure = 0.5 * DENSITY * 200.0**2
    lever = 4 * 0.1 if axis == 0 else 2 * (3.1 - 1.8)
    push = pressure * 0.0025 * 3.0 * 0.05 * np.cos(0.05) * lever
    # The push of a pitch or yaw pair also has a part along the axis, at the canards' arm.
    side = 0.0 if axis == 0 else 2 * 0.1 * pressure * 0.0025 * 3.0 * 0.05 * np.sin(0.05)
    assert abs(moment[axis]) == pytest.approx(push, abs=side + 1e-9)


def test_a_free_canard_in_the_airflow_pushes_nothing_when_turned_into_it() -> None:
    body, _ = packed(ROCKET)
    y = np.zeros(SIZE)
    y[FINS] = y[FINS + 2] = 0.0
    y[FINS], y[FINS + 2] = 0.1, -0.1  # air from below meets +n of the first, -n of the third
    force, _ = canards(
        body, 3.0, 1.8, flow(np.array([200 * np.cos(0.1), 0, 200 * np.sin(0.1)]), np.zeros(3)), y
    )
    assert np.abs(force).max() < 1e-9


def test_moments_move_with_the_centre_of_mass() -> None:
    shape = Axisymmetric(diameter_m=0.2, cl1=2.0, cd0=0.3, reference_m=1.5)
    start = launch(0.0, 0.0, v_n_mps=np.array([100.0, 0, 5.0]))
    turns = []
    for centre_m in (1.5, 1.0, 2.0):
        body = BodyTable(mass_kg=2.0, inertia_kgm2=(1.0, 1.2, 1.3), centre_m=centre_m)
        flight = fly(Vehicle(body=body, aerodynamics=shape), start, 0.01)
        turns.append(rate_ib_b_radps(flight)[-1, 1])
    assert abs(turns[0]) < 1e-4  # the Earth's rotation
    assert turns[1] > 0.01  # lift ahead of the centre of mass turns the nose up
    assert turns[2] < -0.01
