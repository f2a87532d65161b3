"""Steps per second of the flight kernel, against RocketPy and JSBSim where they are installed.

They are peers of the bench only: ``pip install rocketpy jsbsim``.
"""

import warnings
from collections.abc import Callable
from importlib.util import find_spec
from math import isfinite
from typing import TypeAlias

from fgnav.checks import FloatArray
from fgnav.geometry.earth import Origin
from fgnav_sim.vehicle.flown_table import FlownTable, StartTable
from fgnav_sim.vehicle.rigid_body import fly_body
from fgnav_sim.vehicle.tables import Airframe, Axisymmetric, BodyTable, Vehicle
from tests.benchmarks._rows import Row, row, timed

Task: TypeAlias = tuple[float, Callable[[], object]]  # how many steps a piece of work makes
NAMES = ("six_dof_rocketpy", "six_dof_jsbsim")
REPEATS, FLIGHT_S, STEP_S, JSBSIM_STEPS = 5, 20.0, 1e-3, 50_000
MACH = (0.0, 0.5, 0.8, 0.95, 1.05, 1.2, 1.5, 2.0, 3.0)
BALL = Vehicle(
    body=BodyTable(mass_kg=22.7, inertia_kgm2=(13.6, 13.6, 13.6)),
    aerodynamics=Airframe(area_m2=0.0929, span_m=0.3048, chord_m=0.3048, cd0=0.5),
)
ROCKET = Vehicle(
    body=BodyTable(mass_kg=17.2, inertia_kgm2=(0.0255, 16.8, 16.8), centre_m=1.813),
    aerodynamics=Axisymmetric(
        diameter_m=0.1328, mach=MACH, cd0=0.4, cl1=9.0, cm1=-18.0, cmq=-900.0, cspin=-3.0
    ),
)


def run() -> list[Row]:
    """Time one flight of each kind beside its peer."""
    return [
        _row("six_dof_rocketpy", ROCKET, "rocketpy", _rocketpy, "a rocket with nine Mach numbers"),
        _row("six_dof_jsbsim", BALL, "jsbsim", _jsbsim, "a dropped ball with drag"),
    ]


def _row(name: str, vehicle: Vehicle, peer: str, make_peer: Callable[[], Task], what: str) -> Row:
    """Return a row, without a peer where that is not installed."""
    note, task = f"{what}, fixed RK4 steps of 1 ms on one core", _flight(vehicle)
    if find_spec(peer) is None:
        return row(name, *_raced(task), None, "steps/s", f"{note}; {peer} is not installed")
    return row(name, *_raced(task, make_peer()), "steps/s", f"{note}, against {peer}")


def _raced(*tasks: Task) -> FloatArray:
    """Return steps per second of each, the best of turns that alternate.

    On a shared machine all but the best measure the neighbours.
    """
    return [steps for steps, _ in tasks] / timed([work for _, work in tasks], REPEATS).min(axis=0)


def _flight(vehicle: Vehicle) -> Task:
    """Return the steps and the work of a flight."""
    start = StartTable(
        v_n_mps=(150.0, 20.0, -100.0), euler_deg=(0.0, 33.0, 5.0), rate_b_degps=(573.0, 0.0, 0.0)
    )
    table = FlownTable(vehicle=vehicle, start=start, step_s=STEP_S, gravity="j2")
    origin = Origin(latitude_rad=0.7, longitude_rad=0.0, height_m=9144.0)

    def work() -> None:
        fly_body(table, origin, FLIGHT_S, row_interval_s=0.1)

    return FLIGHT_S / STEP_S, work


def _rocketpy() -> Task:
    """Return RocketPy's steps and work on a rocket of the same mass, up to its apogee."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from rocketpy import Environment, Flight, GenericMotor, Rocket

        environment = Environment(latitude=40.0, longitude=-3.0, elevation=700)
        environment.set_atmospheric_model(type="standard_atmosphere")
        motor = GenericMotor(
            thrust_source=[[0, 0], [0.1, 1700], [3, 1400], [3.4, 0]], burn_time=3.4,
            chamber_radius=0.05, chamber_height=0.6, chamber_position=0.4, nozzle_position=0,
            propellant_initial_mass=2.6, nozzle_radius=0.03, dry_mass=1.0,
            center_of_dry_mass_position=0.4, dry_inertia=(0.1, 0.1, 0.002),
        )  # fmt: skip
        rocket = Rocket(
            radius=0.0664, mass=16.2, inertia=(16.8, 16.8, 0.0255), power_off_drag=0.4,
            power_on_drag=0.4, center_of_mass_without_motor=1.813,
            coordinate_system_orientation="tail_to_nose",
        )  # fmt: skip
        rocket.add_motor(motor, position=0.0)
        rocket.add_nose(length=0.6, kind="ogive", position=3.7)
        rocket.add_trapezoidal_fins(4, root_chord=0.25, tip_chord=0.1, span=0.15, position=0.3)

    def flown() -> int:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            flight = Flight(
                rocket=rocket, environment=environment, rail_length=5, inclination=84, heading=0,
                terminate_on_apogee=True,
            )  # fmt: skip
        return len(flight.solution)

    return flown(), flown


def _jsbsim() -> Task:
    """Return JSBSim's steps and work on its own ball, falling."""
    import jsbsim

    ball = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
    ball.set_debug_level(0)
    ball.load_model("ball")
    ball.set_dt(STEP_S)
    ball.load_ic("reset00", useAircraftPath=True)
    ball.run_ic()

    def work() -> None:
        for _ in range(JSBSIM_STEPS):
            ball.run()

    work()
    if not isfinite(ball["position/h-sl-ft"]):
        message = "JSBSim's ball has no height"
        raise RuntimeError(message)
    return JSBSIM_STEPS, work
