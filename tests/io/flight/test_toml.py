"""flight.toml, strictly."""

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.flight.toml import gps_date, gps_seconds, read_flight_toml
from fgnav.io.toml_writer import write_toml
from fgnav.types.flight import InitialAttitude

GOOD = """\
format = "fgnav-flight/1"
name = "n"
start = "2020-06-25T00:00:00"
[origin]
latitude_deg = 40.33
longitude_deg = -3
height_m = 700.0
[[antenna]]
name = "a1"
position_b_m = [0.0, 0, 1e-3]
[gnss]
elevation_weights = "uniform"
base = { observations = "b.rnx", position_e_m = [1.0, 2.0, 3.0] }
"""


def read(tmp_path, text):
    path = tmp_path / "flight.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_flight_toml(path)


def test_tables_are_read_and_written_back(tmp_path):
    table = read(tmp_path, GOOD)
    assert table.origin.longitude_deg == -3.0
    assert table.antenna[0].position_b_m == (0.0, 0.0, 1e-3)
    assert (table.gnss.code_noise_m, table.gnss.elevation_weights) == (None, "uniform")
    write_toml(tmp_path / "again.toml", table)
    assert read_flight_toml(tmp_path / "again.toml") == table


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("", "flight.toml: must describe a flight, the file is empty"),
        ("a = = 1", "flight.toml: must be TOML, Invalid value .at line 1"),
        (b"name = '\xff'", "flight.toml: must be TOML, 'utf-8' codec"),
        (GOOD.replace("/1", "/2"), "key format: must be 'fgnav-flight/1', got 'fgnav-flight/2'"),
        (GOOD.replace('format = "fgnav-flight/1"', ""), "key format: must be .*, got None"),
        (
            GOOD.replace("height_m", "heigth_m"),
            "heigth_m: unknown; .* key is origin.height_m",
        ),
        (GOOD.replace('name = "a1"', 'nam = "a1"'), r"antenna\[0\].nam: unknown; .*\[0\].name"),
        (GOOD.replace("[gnss]", "[gns]"), "key gns: unknown; the nearest known key is gnss"),
        (GOOD.replace("position_e_m", "position_n_m"), "key gnss.base.position_n_m: unknown"),
        (GOOD.replace('name = "a1"\n', ""), r"key antenna\[0\]: 'name' is missing; add it"),
        (GOOD.replace('name = "n"\n', ""), "key top level: 'name' is missing; add it"),
        (GOOD.replace("40.33", '"40.33"'), "key origin.latitude_deg: must be float, got str"),
        (GOOD.replace("40.33", "nan"), "key origin.latitude_deg: must be finite, got nan"),
        (GOOD.replace("1e-3", "-inf"), r"\[0\].position_b_m\[2\]: must be finite, got -inf"),
        (GOOD.replace(", 1e-3", ""), r"\[0\].position_b_m: must be array of length 3, got 2"),
        (GOOD.replace('"uniform"', '"cosine"'), "must be sine or uniform, got 'cosine'"),
        (GOOD.replace('"2020-06-25T00:00:00"', "2020-06-25"), "key start: must be str, got"),
    ],
)
def test_faults_are_named_with_key_rule_and_value(tmp_path, text, rule):
    with pytest.raises(BadInputError, match=rule) as caught:
        read(tmp_path, text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("start", ["2020-06-25", "2020-06-25 00:00:00", "2020-13-25T00:00:00", ""])
def test_start_that_is_no_date_is_named(tmp_path, start):
    with pytest.raises(BadInputError, match="key start: must be a GPS date and time"):
        gps_seconds(tmp_path / "flight.toml", start)


def test_start_before_gps_time_is_named(tmp_path):
    with pytest.raises(BadInputError, match="key start: must not be before 1980-01-06"):
        gps_seconds(tmp_path / "flight.toml", "1979-12-31T00:00:00")


def test_start_may_carry_fractions_and_comes_back(tmp_path):
    assert gps_seconds(tmp_path, "2020-06-25T00:00:00") == 1_277_078_400.0
    for text in ("2020-06-25T00:00:00", "2020-06-25T12:34:50.25", "1980-01-06T00:00:10"):
        assert gps_date(gps_seconds(tmp_path, text)) == text
    assert np.isclose(gps_seconds(tmp_path, "1980-01-06T00:00:01.5"), 1.5)


def test_an_initial_attitude_is_read_strictly_and_written_back(tmp_path):
    table = read(tmp_path, GOOD + "[initial]\nheading_deg = 90\nheading_sigma_deg = 2.0\n")
    assert table.initial.heading_deg == 90.0
    write_toml(tmp_path / "again.toml", table)
    assert read_flight_toml(tmp_path / "again.toml") == table
    with pytest.raises(BadInputError, match=r"initial.heading: unknown; .* initial.heading_deg"):
        read(tmp_path, GOOD + "[initial]\nheading = 90\n")
    with pytest.raises(BadInputError, match="initial heading_sigma_deg: angle and sigma go tog"):
        InitialAttitude(heading_rad=1.0)


def test_more_antennas_than_any_vehicle_carries_are_refused(tmp_path):
    antenna = '[[antenna]]\nname = "b{}"\nposition_b_m = [0, 0, {}]\n'
    with pytest.raises(BadInputError, match=r"key antenna: .*256"):
        read(tmp_path, GOOD + "".join(antenna.format(k, k) for k in range(256)))
