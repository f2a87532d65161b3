"""Monte Carlo: what is drawn, by how much, and what may be drawn at all."""

import msgspec
import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav_sim.dispersions import check_spreads, disperse
from fgnav_sim.scenario import ImuTable, Scenario
from fgnav_sim.vehicle.flown_table import FlownTable, StartTable, WindTable
from fgnav_sim.vehicle.tables import Axisymmetric, BodyTable, MotorTable, Vehicle

MOTOR = MotorTable(
    propellant_kg=2.0, loaded_inertia_kgm2=(0.03, 20.0, 20.0), loaded_centre_m=1.6,
    time_s=(0.0, 1.0, 2.0), thrust_n=(0.0, 1000.0, 500.0),
)  # fmt: skip
VEHICLE = Vehicle(
    body=BodyTable(mass_kg=17.0, inertia_kgm2=(0.0255, 16.8, 16.8)),
    motor=MOTOR,
    aerodynamics=Axisymmetric(diameter_m=0.13, mach=(0.0, 1.0), cd0=(0.4, 0.6), cl1=9.0),
)
SCENARIO = Scenario(
    flown=FlownTable(
        vehicle=VEHICLE, start=StartTable(euler_deg=(0.0, 80.0, 20.0)), wind=WindTable(east_mps=3.0)
    ),
    imu=ImuTable(),
)


def drawn(spreads: dict, seed: int = 1) -> tuple[Scenario, dict[str, object]]:
    one, draws = disperse(SCENARIO, spreads, np.random.default_rng(seed))
    return one, {draw.key: draw.value for draw in draws}


def test_nothing_to_draw_leaves_the_scenario_as_it_is() -> None:
    assert disperse(SCENARIO, {}, np.random.default_rng(1)) == (SCENARIO, ())


def test_every_kind_of_key_becomes_what_was_drawn_for_it() -> None:
    spreads = {
        "origin.height_m": 10.0,
        "flown": {
            "start.euler_deg": [2.0, 1.0, 0.0],
            "wind": {"east_mps": {"sigma": 2.0}},
            "vehicle": {
                "body.mass_kg": {"relative": 0.02},
                "motor": {"thrust_n": {"relative": 0.03}},
                "aerodynamics.cd0": {"relative": 0.1, "law": "uniform"},
            },
        },
        "imu.accelerometer_bias_mps2": {"relative": 0.2},
    }
    one, values = drawn(spreads)
    flown = one.flown
    assert flown is not None
    assert isinstance(flown.vehicle, Vehicle)
    motor, shape = flown.vehicle.motor, flown.vehicle.aerodynamics
    assert motor is not None
    assert isinstance(shape, Axisymmetric)
    assert one.imu is not None
    assert values == {
        "origin.height_m": one.origin.height_m,
        "flown.start.euler_deg": flown.start.euler_deg,
        "flown.wind.east_mps": flown.wind.east_mps,
        "flown.vehicle.body.mass_kg": flown.vehicle.body.mass_kg,
        "flown.vehicle.motor.thrust_n": motor.thrust_n,
        "flown.vehicle.aerodynamics.cd0": shape.cd0,
        "imu.accelerometer_bias_mps2": one.imu.accelerometer_bias_mps2,
    }
    assert flown.start.euler_deg[2] == 20.0
    assert (flown.start.euler_deg[0], flown.start.euler_deg[1]) != (0.0, 80.0)
    assert isinstance(shape.cd0, tuple)
    assert shape.cd0[1] / shape.cd0[0] == pytest.approx(1.5, rel=1e-12)  # one draw moves the list
    assert motor.thrust_n[1] / motor.thrust_n[2] == pytest.approx(2.0, rel=1e-12)
    assert shape.cl1 == 9.0


def test_draws_have_the_spread_that_was_asked() -> None:
    spreads = {
        "flown.vehicle.body.mass_kg": {"relative": 0.02, "law": "uniform"},
        "flown.wind.east_mps": 2.0,
    }
    values = [drawn(spreads, seed)[1] for seed in range(400)]
    mass_kg = np.array([value["flown.vehicle.body.mass_kg"] for value in values])
    wind_mps = np.array([value["flown.wind.east_mps"] for value in values])
    assert np.abs(mass_kg / 17.0 - 1).max() < 0.02
    assert np.std(mass_kg) == pytest.approx(17.0 * 0.02 / np.sqrt(3), rel=0.1)
    assert wind_mps.mean() == pytest.approx(3.0, abs=0.3)
    assert np.std(wind_mps) == pytest.approx(2.0, rel=0.1)


def test_a_spread_that_is_added_leaves_the_other_draws_as_they_were() -> None:
    mass = {"flown.vehicle.body.mass_kg": {"relative": 0.02}}
    alone, both = drawn(mass)[1], drawn({"flown.wind.east_mps": 1.0, **mass})[1]
    assert both["flown.vehicle.body.mass_kg"] == alone["flown.vehicle.body.mass_kg"]
    assert drawn(mass, seed=2)[1] != alone


@pytest.mark.parametrize(
    ("spreads", "message"),
    [
        (
            {"flown.vehicle.body.mas_kg": 1.0},
            "mas_kg: unknown; the nearest known key is flown.vehicle.body.mass_kg",
        ),
        ({"flown": {"wnd": {"east_mps": 1.0}}}, "flown.wnd.east_mps: unknown; .* flown.wind.east"),
        ({"name": 1.0}, "name: unknown"),
        ({"duration_s": 1.0}, "duration_s: unknown"),
        ({"imu.gyroscope_bias_radps": 1.0}, "imu.gyroscope_bias_radps: has no value"),
        ({"gnss": 1.0}, "gnss: has no value"),
        ({"flown.start.euler_deg": [1.0, 2.0]}, "must hold a figure, or one for each of 3"),
        ({"flown.wind.north_mps": {"relative": 0.1}}, "is zero, of which no share moves"),
        ({"origin.height_m": {"relative": 0.1, "sigma": 1.0}}, "must have one of sigma and rel"),
        ({"origin.height_m": -1.0}, "origin.height_m: must be finite, not negative"),
        ({"origin.height_m": 0.0}, "origin.height_m: must be finite, not negative, and not all"),
        ({"origin.height_m": "2 %"}, "origin.height_m: Expected .*, got '2 %'"),
        ({"origin.height_m": {"sigma": 1.0, "lw": "normal"}}, "origin.height_m: .*unknown field"),
    ],
)  # fmt: skip
def test_what_cannot_be_drawn_is_named(spreads: dict, message: str) -> None:
    with pytest.raises(BadInputError, match=rf"^dispersions\..*{message}"):
        check_spreads(SCENARIO, spreads)


def test_a_draw_that_breaks_a_rule_is_named() -> None:
    light = {"imu.accelerometer_bias_mps2": {"relative": 50.0, "law": "uniform"}}
    with pytest.raises(BadInputError, match=r"dispersions: a draw breaks a rule, .*bias_mps2"):
        drawn(light, seed=2)


def test_a_scenario_keeps_its_date_and_its_commands() -> None:
    one = msgspec.structs.replace(SCENARIO, flown=None)
    other, _ = disperse(one, {"origin.height_m": 1.0}, np.random.default_rng(1))
    assert msgspec.structs.replace(other, origin=one.origin) == one
