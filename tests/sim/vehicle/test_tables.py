from pathlib import Path

import pytest

from fgnav.checks import BadInputError
from fgnav_sim.vehicle.tables import load_vehicle

VEHICLES = Path(__file__).resolve().parents[3] / "sim" / "fgnav_sim" / "vehicles"
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


@pytest.mark.parametrize(
    ("old", "new", "rule"),
    [
        ("cd0 =", "cd_0 =", r"key aerodynamics.cd_0: unknown; the nearest known key is .*cd0"),
        ("[autopilot]", "[pilot]", "key pilot: unknown; the nearest known key is autopilot"),
        ("1.5, 2.0", "2.5, 2.0", r"aerodynamics\.mach: must increase, row 7 has 2 after 2.5"),
        ("cd0 = [0.38, ", "cd0 = [", "aerodynamics.cd0: must hold 9 .* for each of mach, got 8"),
        ('"d/2v"', '"d/3v"', "key aerodynamics.rate_terms: must be"),
        ('"axisymmetric"', '"round"', "aerodynamics.kind: must be one of axisymmetric, airframe"),
        ("slope = [2.6, ", "slope = [", "canards.slope: must hold 9 values"),
        ("mass_kg = 17.2", "mass_kg = 0", "key body.mass_kg: must be float > 0.0, got 0"),
        ("mass_kg = 17.2", "mass_kg = nan", "key body.mass_kg: must be finite, got nan"),
        ("mass_kg = 17.2\n", "", "key body: 'mass_kg' is missing"),
        ("[0.0255, 16.8, 16.8]", "[0.0255, 16.8, 18.0]", "body.inertia_kgm2: no body has"),
        ("[0.028, 20.3, 20.3]", "[99.0, 20.3, 20.3]", "motor.loaded_inertia_kgm2: no body has"),
        ("0.1, 0.5, 1.5", "0.1, 0.05, 1.5", "motor.time_s: must increase, row 2 has 0.05"),
        ("[0.0, 1700.0, ", "[1700.0, ", "motor.thrust_n: must hold 7 values"),
        ("forebody_inertia_kgm2 = 0.004", "forebody_inertia_kgm2 = 0.1", "must be below .* 0.0255"),
        ("station_m = 3.1", "station_m = 1.813", "canards.station_m: must differ"),
        ("deflection_deg = 15.0", "deflection_deg = 95.0", "canards.deflection_deg: .* < 90"),
    ],
)  # fmt: skip
def test_what_breaks_a_rule_is_one_line_with_file_and_key(
    tmp_path: Path, old: str, new: str, rule: str
) -> None:
    with pytest.raises(BadInputError, match=rule) as raised:
        load_vehicle(changed(tmp_path, old, new))
    assert "rocket.toml" in str(raised.value)
    assert "\n" not in str(raised.value)


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
