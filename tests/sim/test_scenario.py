"""A scenario file is read strictly: what is wrong is one line that names file, key, rule, value."""

from pathlib import Path

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav_sim.motion import Arc, Ramp
from fgnav_sim.scenario import PAPER_ANTENNAS_B_M, Scenario, load_scenario
from fgnav_sim.vehicle.tables import load_vehicle

SCENARIOS = Path(__file__).resolve().parents[2] / "sim" / "fgnav_sim" / "scenarios"
VEHICLES = SCENARIOS.with_name("vehicles")


def load(folder, text):
    path = folder / "flight.toml"
    path.write_text(text, encoding="utf-8")
    return load_scenario(path)


@pytest.mark.parametrize("path", sorted(SCENARIOS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_scenario_that_is_shipped_loads_under_its_name_with_its_vehicle(path):
    scenario = load_scenario(path)
    assert scenario.name == path.stem
    assert scenario.gnss is None or not scenario.gnss.navigation
    assert scenario.flown is None or scenario.flown.vehicle.body.mass_kg > 0
    if path.stem in ("demo", "hour", "ramp", "spin", "approach"):
        assert scenario.antennas_b_m == PAPER_ANTENNAS_B_M


@pytest.mark.parametrize("path", sorted(VEHICLES.glob("*.toml")), ids=lambda path: path.stem)
def test_every_vehicle_that_is_shipped_loads_under_its_name(path):
    assert load_vehicle(path).name == path.stem


def test_an_empty_file_is_a_minute_over_madrid_without_sensors(tmp_path):
    scenario = load(tmp_path, "")
    assert scenario.name == "flight"
    assert scenario.duration_s == 60.0
    assert scenario.start_gps_s == 1_277_078_400.0  # 2020-06-25, week 2111, Thursday
    assert scenario.gnss is None


def test_what_is_written_is_what_is_read(tmp_path):
    scenario = load(
        tmp_path,
        """
        name = "left turn"
        start = 2023-03-12T06:00:00.5
        antennas_b_m = [[0, 0, 0], [1, 0, 0]]
        [origin]
        latitude_deg = -33
        [motion]
        path = { kind = "arc", radius_m = 500, left = true }
        pitch = { kind = "ramp", amplitude_deg = 12 }
        [gnss]
        signals = { G = ["1C", "2W"], E = ["1C"] }
        clock = { oscillator = "separate" }
        """,
    )
    assert scenario.name == "left turn"
    assert scenario.start_gps_s % 1.0 == 0.5
    assert scenario.origin.frame.latitude_rad == pytest.approx(np.radians(-33))
    assert isinstance(scenario.motion.path, Arc)
    assert scenario.motion.path.left
    assert scenario.motion.pitch == Ramp(amplitude_deg=12.0)
    assert scenario.antennas_b_m == ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert scenario.gnss is not None
    assert scenario.gnss.signals == {"G": ("1C", "2W"), "E": ("1C",)}
    assert scenario.gnss.clock.oscillator == "separate"


def test_epochs_fill_the_duration_without_its_end():
    assert len(Scenario(duration_s=60.0).epochs_s(10.0)) == 600
    assert len(Scenario(duration_s=0.3).epochs_s(10.0)) == 3  # though 0.3 * 10 rounds above 3
    assert Scenario(duration_s=0.01).epochs_s(1.0).tolist() == [0.0]


def test_a_file_that_is_not_there_or_not_text_is_named(tmp_path):
    with pytest.raises(BadInputError, match=r"nowhere\.toml: no such file"):
        load_scenario(tmp_path / "nowhere.toml")
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadInputError, match=r"binary\.toml: must be TOML"):
        load_scenario(binary)
