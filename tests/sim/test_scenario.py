"""A scenario file is read strictly: what is wrong is one line that names file, key, rule, value."""

from pathlib import Path

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav_sim.motion import Arc, Ramp
from fgnav_sim.scenario import PAPER_ANTENNAS_B_M, Scenario, load_scenario

SCENARIOS = Path(__file__).resolve().parents[2] / "sim" / "fgnav_sim" / "scenarios"


def load(folder, text):
    path = folder / "flight.toml"
    path.write_text(text, encoding="utf-8")
    return load_scenario(path)


@pytest.mark.parametrize("name", ["coast", "glider", "rocket", "tumble"])
def test_flown_scenarios_come_with_their_vehicle(name):
    scenario = load_scenario(SCENARIOS / f"{name}.toml")
    assert scenario.flown is not None
    assert scenario.flown.vehicle.body.mass_kg > 0


@pytest.mark.parametrize("name", ["demo", "hour", "ramp", "spin", "approach"])
def test_the_scenarios_that_come_along_are_valid(name):
    scenario = load_scenario(SCENARIOS / f"{name}.toml")
    assert scenario.name == name
    assert scenario.gnss is not None
    assert not scenario.gnss.navigation
    assert scenario.antennas_b_m == PAPER_ANTENNAS_B_M


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


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("duraton_s = 5", r"duraton_s: unknown; the nearest known key is .*duration_s"),
        ("duration_s = -5", r"duration_s: must be float > 0.0, got -5"),
        ("duration_s = 1e9", r"duration_s: must be float <= 604800.0, got 1000000000.0"),
        ("duration_s = nan", r"duration_s: must be finite, got nan"),
        ('duration_s = "x"', r"duration_s: must be float, got str, got 'x'"),
        ('start = "1970-01-01T00:00:00"', r"start: must not lie before 1980-01-06T00:00:00"),
        ('start = "2020-06-25T00:00:00Z"', r"start: must be datetime with no timezone"),
        ('gravity = "moon"', r"gravity: must be"),
        ("antennas_b_m = []", r"antennas_b_m: must hold one antenna or more"),
        ("antennas_b_m = [[0, 0]]", r"antennas_b_m\[0\]: .*length 3"),
        ("antennas_b_m = [[0, 0, inf]]", r"antennas_b_m\[0\]\[2\]: must be finite, got inf"),
        ("[origin]\nlatitude_deg = 91", r"origin.latitude_deg: must be float <= 90.0, got 91"),
        ("[motion]\nrol = {}", r"motion.rol: unknown; the nearest known key is .*roll"),
        (
            "[motion.roll]\nkind = 'sinus'",
            r"motion.roll.kind: must be one of hold, ramp, sine, rate, got 'sinus'",
        ),
        ("[motion.roll]\namplitude_deg = 3", r"motion.roll.kind: must be one of .*, got nothing"),
        (
            "[motion.roll]\nkind = 'sine'\namplitude = 3",
            r"motion.roll.amplitude: unknown; the nearest known key is .*amplitude_deg",
        ),
        ("[motion.roll]\nkind = 'sine'", r"motion.roll: 'amplitude_deg' is missing"),
        (
            "[motion.path]\nkind = 'arc'\nradius_m = 0",
            r"motion.path.radius_m: must be float > 0.0, got 0",
        ),
        ("[gnss.signals]\nR = ['1C']", r"gnss.signals.R: the constellation must be one of G "),
        ("[gnss]\nsignals = {}", r"gnss.signals: must name one constellation or more"),
        ("[gnss.signals]\nG = []", r"gnss.signals.G: must name one signal or more, each once"),
        ("[gnss.signals]\nG = ['L1']", r"gnss.signals.G: 'L1' is not a RINEX 3 signal"),
        ("[gnss]\nelevation_weights = 'cosine'", r"gnss.elevation_weights: must be"),
        ("[gnss.clock]\noffset_s = 1", r"gnss.clock.offset_s: must be float <= 0.001, got 1"),
        (
            "[gnss]\nantenna_noise = [1, 2]",
            r"gnss.antenna_noise: must hold a factor for each of 8 antennas, got 2",
        ),
        (
            "[imu]\ngyroscope_scale = 1e-3",
            r"imu.gyroscope_noise_radps_per_sqrt_hz: goes with the other gyroscope keys",
        ),
        (
            "[photodetector]\nlandmark = {}\nocclusions = [{ quadrant = 5 }]",
            r"photodetector.occlusions\[0\].quadrant: must be int <= 4, got 5",
        ),
        (
            "[photodetector]\nlandmark = {}\n"
            "occlusions = [{ quadrant = 1, from_s = 2, until_s = 1 }]",
            r"photodetector.occlusions\[0\].until_s: must lie after from_s, got 1",
        ),
        ("[gnss]\nchoose = 3", r"gnss.choose: must be int >= 4, got 3"),
        ("[gnss]\nchoose = 'some'", r"gnss.choose: must be"),
        ("[gnss]\norbits = ['none.sp3']", r"gnss.orbits: no such file, got '.*none.sp3'"),
        ("[gnss]\nnavigation = ['none.rnx']", r"gnss.navigation: no such file, got '.*none.rnx'"),
        (
            "[imu]\ngyroscope_bias_radps = 1e-3",
            r"imu.gyroscope_noise_radps_per_sqrt_hz: goes with the other gyroscope keys",
        ),
        ("[photodetector]", r"photodetector: 'landmark' is missing"),
        (
            "[photodetector]\nlandmark = {}\nfield_of_view_deg = 30",
            r"photodetector.field_of_view_deg: the spot must stay on the detector, within 13.8",
        ),
        ("name = ", r"must be TOML"),
    ],
)
def test_what_is_wrong_is_one_line_with_file_and_key(tmp_path, text, message):
    with pytest.raises(BadInputError, match=rf"^\S*flight\.toml: (key )?{message}") as caught:
        load(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_or_not_text_is_named(tmp_path):
    with pytest.raises(BadInputError, match=r"nowhere\.toml: no such file"):
        load_scenario(tmp_path / "nowhere.toml")
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadInputError, match=r"binary\.toml: must be TOML"):
        load_scenario(binary)
