import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from fgnav.checks import BadInputError
from fgnav.geometry import earth
from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import exp, log
from fgnav_sim.vehicle.flown_table import AttitudeTable, StartTable
from fgnav_sim.vehicle.forces import P, Q, V, W
from fgnav_sim.vehicle.rigid_body import Flown, rotations_of
from fgnav_sim.vehicle.tables import Axisymmetric, BodyTable, MotorTable, Vehicle
from tests.sim.vehicle import reference
from tests.sim.vehicle.reference import (
    euler_rad,
    fly_reference,
    places,
    position_e_m,
    rate_ib_b_radps,
    rotation_eb,
    velocity_e_mps,
)

MADRID = Origin(latitude_rad=np.radians(40.33), longitude_rad=np.radians(-3.88), height_m=700.0)
FAR = Origin(latitude_rad=0.4, longitude_rad=1.0, height_m=9e7)  # where gravity hardly differs
HIGH = Origin(latitude_rad=0.7, longitude_rad=0.0, height_m=9e5)  # a minute's fall above the ground
TUMBLER = BodyTable(
    mass_kg=10.0, inertia_kgm2=(0.5, 1.1, 1.4), products_kgm2=(0.05, -0.08, 0.02)
)  # fmt: skip
MICRODEG = 1e-6


def launch(origin: Origin = MADRID, **changes: object) -> tuple[Origin, StartTable]:
    return reference.launch(origin=origin, **changes)


def flown(vehicle: Vehicle, start: tuple[Origin, StartTable], **table: object) -> Flown:
    return reference.fly(vehicle, start, **{"air": False, **table})


def spinning_rocket() -> Vehicle:
    return Vehicle(
        body=BodyTable(mass_kg=17.2, inertia_kgm2=(0.0255, 16.8, 16.8), centre_m=1.813),
        motor=MotorTable(
            propellant_kg=2.6, loaded_inertia_kgm2=(0.028, 20.0, 20.0), loaded_centre_m=1.6,
            time_s=(0.0, 0.1, 2.0, 3.0), thrust_n=(0.0, 1500.0, 1500.0, 0.0),
        ),
        aerodynamics=Axisymmetric(
            diameter_m=0.1328, mach=(0.0, 0.8, 1.2, 3.0), cd0=(0.3, 0.35, 0.5, 0.3), cl1=9.0,
            cm1=-18.0, cmq=-900.0, cmm=0.5, cmf=-0.5, cnq=60.0, cspin=-3.0,
        ),
    )  # fmt: skip


@pytest.mark.parametrize(("wobble", "limit_deg"), [(0.0, 1e-9), (1.0, 5 * MICRODEG)])
def test_a_body_of_revolution_at_five_turns_a_second_keeps_its_attitude_for_a_minute(
    wobble: float, limit_deg: float
) -> None:
    inertia, w = np.array([0.4, 1.1, 1.1]), np.array([10 * np.pi, wobble, 0.0])
    body = BodyTable(mass_kg=10.0, inertia_kgm2=tuple(inertia))
    flight = flown(Vehicle(body=body), launch(HIGH, w_ib_b_radps=w), duration_s=60.0, gravity="j2")
    # Closed form: a turn about the angular momentum, after one about the axis of symmetry.
    R_ib = rotations_of(flight.y[:, Q : Q + 4])
    momentum_i = R_ib[0] @ (inertia * w)
    spin = np.array([w[0] * (1 - inertia[0] / inertia[1]), 0.0, 0.0])
    t_s = flight.t_s[:, None]
    expected = exp(t_s * momentum_i / inertia[1]) @ R_ib[0] @ exp(t_s * spin)
    error = log(expected.swapaxes(1, 2) @ R_ib)
    assert np.degrees(np.linalg.norm(error, axis=1)).max() < limit_deg


def test_a_fast_top_precesses_and_nutates_at_its_closed_form_frequencies() -> None:
    # A spinning body in a fast stream: the overturning moment takes the place of a top's weight.
    axial, transverse, spin, speed, slope, d = 0.01, 0.1, 1000.0, 1000.0, 0.2, 0.1
    body = BodyTable(mass_kg=1e6, inertia_kgm2=(axial, transverse, transverse))
    shape = Axisymmetric(diameter_m=d, cm1=slope)
    down = np.array([0.0, -np.pi / 2 + 0.01, 0.0])
    flight = flown(
        Vehicle(body=body, aerodynamics=shape),
        launch(
            euler_rad=down, v_n_mps=np.array([0.0, 0.0, speed]),
            w_ib_b_radps=np.array([spin, 0.0, 0.0]),
        ),
        air=True, duration_s=0.2, step_s=5e-5, row_interval_s=2e-3,
    )  # fmt: skip
    u_n = MADRID.R_ne @ rotation_eb(flight)[:, :, 0].T
    v_n = MADRID.R_ne @ velocity_e_mps(flight).T
    off = u_n / u_n[2] - v_n / v_n[2]
    tip = off[0] + 1j * off[1]
    past = np.column_stack([tip[1:-1], tip[:-2]])
    steps = np.roots([1.0, *-np.linalg.lstsq(past, tip[2:], rcond=None)[0]])
    found = np.sort(np.abs(np.angle(steps)) / 2e-3)

    import ambiance

    density = ambiance.Atmosphere(MADRID.height_m - 0.1 * speed).density[0]
    moment = 0.5 * density * np.pi / 4 * d**2 * d * slope * (speed + 0.98) ** 2
    half = axial * spin / (2 * transverse)
    root = np.sqrt(half**2 - moment / transverse)
    assert found == pytest.approx([half - root, half + root], rel=3e-3)


def test_burning_in_empty_space_gains_the_rocket_equation() -> None:
    rocket = spinning_rocket()
    motor = rocket.motor
    assert motor is not None
    burnt = flown(rocket, launch(FAR), duration_s=4.0, gravity="j2")
    coasting = flown(Vehicle(body=rocket.body), launch(FAR), duration_s=4.0, gravity="j2")
    gained = burnt.y[-1, V : V + 3] - coasting.y[-1, V : V + 3]
    impulse = PchipInterpolator(motor.time_s, motor.thrust_n).integrate(0.0, 3.0)
    dry, wet = rocket.body.mass_kg, rocket.body.mass_kg + motor.propellant_kg
    speed = impulse / motor.propellant_kg * np.log(wet / dry)
    assert np.linalg.norm(gained) == pytest.approx(speed, rel=1e-6)


def test_what_leaves_through_the_nozzle_damps_a_constant_inertia_exponentially() -> None:
    length, inertia, propellant = 2.0, (0.1, 20.0, 20.0), 3.0
    vehicle = Vehicle(
        body=BodyTable(mass_kg=20.0, inertia_kgm2=inertia, centre_m=length),
        motor=MotorTable(
            propellant_kg=propellant, loaded_inertia_kgm2=inertia, loaded_centre_m=length,
            time_s=(0.0, 1.0, 2.0), thrust_n=(0.0, 100.0, 0.0),
        ),
    )  # fmt: skip
    w = rate_ib_b_radps(flown(vehicle, launch(w_ib_b_radps=np.array([0.0, 0.3, 0.0]))))
    assert w[-1, 1] == pytest.approx(0.3 * np.exp(-propellant * length**2 / inertia[1]), rel=1e-9)


def test_a_tumbling_body_keeps_energy_and_angular_momentum() -> None:
    flight = flown(
        Vehicle(body=TUMBLER),
        launch(v_n_mps=np.array([300.0, 200.0, -900.0]), w_ib_b_radps=np.array([2.0, 3.0, -1.0])),
        duration_s=30.0, gravity="j2",
    )  # fmt: skip
    y = flight.y
    p, v, w = y[:, P : P + 3], y[:, V : V + 3], y[:, W : W + 3]
    r, sine = np.linalg.norm(p, axis=1), p[:, 2] / np.linalg.norm(p, axis=1)
    legendre = 1.5 * sine**2 - 0.5
    potential = -earth.GM_M3PS2 / r * (1 - earth.J2 * (earth.SEMI_MAJOR_AXIS_M / r) ** 2 * legendre)
    energy = 0.5 * np.sum(v**2, axis=1) + potential
    assert np.ptp(energy) / abs(energy[0]) < 1e-12
    about_axis = np.cross(p, v)[:, 2]
    assert np.ptp(about_axis) / about_axis[0] < 1e-12
    (xx, yy, zz), (xy, xz, yz) = TUMBLER.inertia_kgm2, TUMBLER.products_kgm2
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    turned = rotation_eb(flight) @ inertia
    H_e = np.einsum("mij,mj->mi", turned, w)
    angle = earth.EARTH_RATE_RADPS * flight.t_s
    H_i = np.column_stack(
        [
            H_e[:, 0] * np.cos(angle) - H_e[:, 1] * np.sin(angle),
            H_e[:, 0] * np.sin(angle) + H_e[:, 1] * np.cos(angle),
            H_e[:, 2],
        ]
    )
    assert np.ptp(H_i, axis=0).max() / np.linalg.norm(H_i[0]) < 1e-9
    spin_energy = 0.5 * np.einsum("mi,ij,mj->m", w, inertia, w)
    assert np.ptp(spin_energy) / spin_energy[0] < 1e-9


def test_halving_the_step_divides_the_error_by_sixteen() -> None:
    start = launch(w_ib_b_radps=np.array([2.0, 3.0, -1.0]))
    errors = []
    for step_s in (0.01, 0.005):
        flight = flown(Vehicle(body=TUMBLER), start, step_s=step_s, row_interval_s=0.02)
        exact = fly_reference(Vehicle(body=TUMBLER), start, flight, air=False)
        turn = rotation_eb(exact)[-1:].swapaxes(1, 2) @ rotation_eb(flight)[-1:]
        errors.append(float(np.linalg.norm(log(turn))))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.2)


@pytest.mark.parametrize("gravity", ["j2", "wgs84-normal", "constant"])
def test_the_compiled_steps_agree_with_dop853_over_thirty_seconds(gravity: str) -> None:
    start = launch(
        euler_rad=np.radians([0.0, 80.0, 30.0]), v_n_mps=np.array([10.0, 6.0, -60.0]),
        w_ib_b_radps=np.array([6.0, 0.0, 0.0]),
    )  # fmt: skip
    steps = flown(
        spinning_rocket(), start, air=True, duration_s=30.0, row_interval_s=0.1, gravity=gravity
    )
    exact = fly_reference(spinning_rocket(), start, steps, gravity=gravity)
    assert np.abs(position_e_m(steps) - position_e_m(exact)).max() < 1e-6  # m
    turn = rotation_eb(exact).swapaxes(1, 2) @ rotation_eb(steps)
    assert np.degrees(np.linalg.norm(log(turn), axis=1)).max() < MICRODEG


@pytest.mark.parametrize("gravity", ["j2", "wgs84-normal", "constant"])
@pytest.mark.parametrize("latitude_deg", [-78.0, 0.0, 40.0, 90.0])
def test_a_body_at_rest_feels_the_gravity_of_the_library(gravity: str, latitude_deg: float) -> None:
    origin = Origin(latitude_rad=np.radians(latitude_deg), longitude_rad=1.0, height_m=5000.0)
    flight = flown(Vehicle(body=TUMBLER), launch(origin), duration_s=0.01, gravity=gravity)
    rate = np.array([0.0, 0.0, earth.EARTH_RATE_RADPS])
    g_n = origin.R_ne @ (flight.dy[0, V : V + 3] - np.cross(rate, np.cross(rate, origin.p_e_m)))
    assert np.abs(g_n - origin.gravity_n_mps2(np.zeros((1, 3)), gravity)[0]).max() < 1e-9


def test_a_body_at_rest_on_the_earth_starts_at_rest_and_where_it_is() -> None:
    flight = flown(Vehicle(body=TUMBLER), launch(euler_rad=np.array([0.3, -0.2, 2.0])))
    assert np.abs(velocity_e_mps(flight)[0]).max() < 1e-9
    place = [MADRID.latitude_rad, MADRID.longitude_rad, MADRID.height_m]
    assert places(flight)[0] == pytest.approx(place, abs=1e-6)
    assert euler_rad(flight)[0] == pytest.approx([0.3, -0.2, 2.0], abs=1e-9)
    assert np.linalg.norm(flight.y[:, Q : Q + 4], axis=1) == pytest.approx(1.0, abs=1e-12)


def test_a_flight_ends_at_the_ground() -> None:
    flight = flown(Vehicle(body=TUMBLER), launch(), ground_m=600.0, row_interval_s=0.1)
    fall_s = np.sqrt(2 * 100.0 / 9.8)
    assert flight.t_s[-1] == pytest.approx(fall_s, abs=0.11)
    assert len(flight.y) == len(flight.dy) == len(flight.t_s)


def test_a_step_that_diverges_is_named() -> None:
    start = launch(w_ib_b_radps=np.array([60.0, 80.0, 50.0]))
    with pytest.raises(BadInputError, match=r"step_s: the integration diverges with 0"):
        flown(Vehicle(body=TUMBLER), start, step_s=0.1, row_interval_s=0.1)


def test_a_step_too_long_for_the_canards_is_named() -> None:
    with pytest.raises(BadInputError, match=r"step_s: must be at most twice the canards' lag_s"):
        flown(reference.ROCKET, launch(), step_s=0.05, attitude=AttitudeTable())
