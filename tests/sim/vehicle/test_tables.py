from pathlib import Path

import pytest

from fgnav.checks import BadInputError
from fgnav_sim.vehicle.tables import load_vehicle
from tests.sim.vehicle.reference import VEHICLES

ROCKET = (VEHICLES / "rocket.toml").read_text()


def changed(tmp_path: Path, old: str, new: str) -> Path:
    assert old in ROCKET
    path = tmp_path / "rocket.toml"
    path.write_text(ROCKET.replace(old, new, 1))
    return path


@pytest.mark.parametrize("name", ["rocket", "rigid_body", "glider"])
def test_the_vehicles_of_the_project_load_under_their_names(name: str) -> None:
    assert load_vehicle(VEHICLES / f"{name}.toml").name == name


def test_the_default_rocket_has_the_published_masses() -> None:
    rocket = load_vehicle(VEHICLES / "rocket.toml")
    assert rocket.body.mass_kg == 17.2
    assert rocket.body.inertia_kgm2 == (0.0255, 16.8, 16.8)
    assert rocket.body.centre_m == 1.813


def test_thrust_must_rise_above_zero(tmp_path: Path) -> None:
    line = next(line for line in ROCKET.splitlines() if line.startswith("thrust_n"))
    with pytest.raises(BadInputError, match=r"motor\.thrust_n: must rise above zero"):
        load_vehicle(changed(tmp_path, line, "thrust_n = [0, 0, 0, 0, 0, 0, 0]"))


def test_a_grid_needs_enough_rows(tmp_path: Path) -> None:
    path = tmp_path / "body.toml"
    body = '[body]\nmass_kg = 1\ninertia_kgm2 = [1, 1, 1]\n[aerodynamics]\nkind = "axisymmetric"\n'
    path.write_text(body + "diameter_m = 0.1\nmach = []\n")
    with pytest.raises(BadInputError, match=r"aerodynamics\.mach: must hold 1 values or more"):
        load_vehicle(path)


def test_canards_need_coefficients_and_an_autopilot_needs_canards(tmp_path: Path) -> None:
    body = "[body]\nmass_kg = 1\ninertia_kgm2 = [1, 1, 1]\n"
    path = tmp_path / "body.toml"
    path.write_text(body + "[autopilot]\n")
    with pytest.raises(BadInputError, match=r"autopilot: needs a table \[canards\]"):
        load_vehicle(path)
    path.write_text(body + "[canards]\narea_m2 = 1\nstation_m = 1\narm_m = 1\n")
    with pytest.raises(BadInputError, match=r"canards: need a table \[aerodynamics\]"):
        load_vehicle(path)
