"""``fgnav new``: from a stranger's files to a flight, in two edits."""

import gzip
import json
import re
import tomllib

import numpy as np
import pytest

from fgnav.cli import main
from fgnav.io.flight.folder import load_flight
from fgnav.io.importers.guess import guess_table
from tests.io.importers import logs, streams, test_pos
from tests.io.importers.helpers import imported
from tests.io.rinex_texts import message, navigation_head, observation_3


def new(tmp_path, *files):
    """Return flight.toml as text."""
    folder = tmp_path / "flight"
    assert main(["new", *map(str, files), "--out", str(folder)]) == 0
    return (folder / "flight.toml").read_text()


def edited(tmp_path, *pairs):
    toml = tmp_path / "flight" / "flight.toml"
    text = toml.read_text()
    for old, fresh in pairs:
        assert text.count(old) == 1
        text = text.replace(old, fresh)
    toml.write_text(text)


def findings(tmp_path, capsys):
    capsys.readouterr()
    assert main(["check", str(tmp_path / "flight"), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)["findings"]
    return {one["name"]: f"{one['text']}; {one['mend']}" for one in found}


def test_what_lies_beside_recordings_is_passed_over_and_named(shared, tmp_path, capsys):
    folder = shared / "flights" / "drive_0708"
    new(tmp_path, *sorted(folder.iterdir()))
    said = capsys.readouterr().out
    for name in ("LICENSE", "README.md", "imu_1934.csv.tag"):
        assert f"passed over: {folder / name}: of no known format" in " ".join(said.split())
    assert main(["new", str(folder / "LICENSE"), "--out", str(tmp_path / "none")]) == 2
    assert "of no known format" in capsys.readouterr().err


def test_two_edits_that_check_names_make_the_car_a_flight(shared, tmp_path, capsys):
    folder = shared / "flights" / "drive_0708"
    text = new(tmp_path, folder / "imu_1934.csv", folder / "gnss_1934_sf.pos")
    assert text.count("# EDIT: ") == 3  # axes, clock, antenna
    before = findings(tmp_path, capsys)
    assert "should read -x, y, -z" in before["imu mounting"]
    assert re.search(r"add \+3\.22\d s to \[imu\] clock_offset_s", before["imu clock"])
    edited(
        tmp_path,
        ('axes = ["x", "y", "z"]', 'axes = ["-x", "y", "-z"]'),
        ("clock_offset_s = 0.0", "clock_offset_s = 3.225"),
    )
    # What is left is the recording's own: its README states the age, and methods estimate it.
    assert set(findings(tmp_path, capsys)) == {"velocity delay"}


def test_edits_that_check_names_make_a_quadrotor_a_flight(shared, tmp_path, capsys):
    folder = shared / "flights" / "quadrotor" / "path_10"
    new(tmp_path, folder / "IMU_1.csv", folder / "GT.csv")
    said = " ".join(capsys.readouterr().out.split())
    assert "not used: 5605 × IMU_1.csv columns Euler_X, Euler_Y, Euler_Z: no [[csv]]" in said
    before = findings(tmp_path, capsys)
    assert "should read x, -y, -z" in before["imu mounting"]
    # Its README has -0.42 s, by correlation of roll rates.
    offset = re.search(r"add (-0\.4\d\d) s to \[imu\] clock_offset_s", before["imu clock"])
    edited(
        tmp_path,
        ('axes = ["x", "y", "z"]', 'axes = ["x", "-y", "-z"]'),
        ("clock_offset_s = 0.0", f"clock_offset_s = {offset[1]}"),
    )
    assert findings(tmp_path, capsys) == {}
    flight = load_flight(tmp_path / "flight")
    track = np.genfromtxt(folder / "GT.csv", delimiter=",", skip_header=1)[:, 7:]
    np.testing.assert_allclose(flight.fixes[0].p_n_m, track - track[0], atol=1e-6)


def test_packed_files_and_a_stated_format(tmp_path, capsys):
    rows = "".join(f"{0.01 * k:.2f} 0.1 0.2 -9.8\n" for k in range(5)).encode()
    (tmp_path / "log.txt.gz").write_bytes(gzip.compress(b"t ax ay az\n" + rows))
    new(tmp_path, tmp_path / "log.txt.gz", "--format", "csv")
    assert "log.txt: columns guessed" in " ".join(capsys.readouterr().out.split())
    assert len(load_flight(tmp_path / "flight").imu.t_s) == 5


def test_what_was_guessed_imports_the_same_again(shared, tmp_path):
    folder = shared / "flights" / "quadrotor" / "path_10"
    new(tmp_path, folder / "IMU_1.csv")
    again = (tmp_path / "flight" / "import.toml").read_text()
    first = load_flight(tmp_path / "flight")
    (tmp_path / "again").mkdir()
    _, second = imported(tmp_path / "again", "csv", folder / "IMU_1.csv", toml=again)
    np.testing.assert_array_equal(first.imu.f_b_mps2, second.imu.f_b_mps2)
    raw = np.genfromtxt(folder / "IMU_1.csv", delimiter=",", skip_header=1)
    np.testing.assert_allclose(first.imu.f_b_mps2, raw[:, 4:7], rtol=1e-10)
    np.testing.assert_allclose(first.imu.w_b_radps, np.radians(raw[:, 7:10]), rtol=1e-10)


def test_observations_without_messages_say_what_to_fetch(tmp_path, capsys):
    (tmp_path / "rover.obs").write_text(observation_3())
    text = new(tmp_path, tmp_path / "rover.obs")
    assert "# EDIT: no broadcast messages were found" in text
    assert 'navigation = ["brdc.rnx"]' in text
    assert 'observations = "rover.obs"' in text
    out = capsys.readouterr().out
    assert f"{tmp_path / 'rover.obs'}: rinex" in out
    assert "edit gnss.navigation" in out
    assert main(["check", str(tmp_path / "flight")]) == 2
    (tmp_path / "flight" / "brdc.rnx").write_text(navigation_head() + message())
    edited(tmp_path, ('# navigation = ["brdc.rnx"]', 'navigation = ["brdc.rnx"]'))
    assert load_flight(tmp_path / "flight").observations is not None


@pytest.mark.parametrize(
    ("format_", "make", "table"),
    [
        ("ulog", logs.ulog, "imu"),
        ("ardupilot", logs.ardupilot, "imu"),
        ("ubx", streams.raw_ubx, "antenna"),
        ("sbf", streams.raw_sbf, "antenna"),
        ("novatel", streams.raw_novatel, "antenna"),
        ("pos", (test_pos.HEAD + test_pos.ROW).encode, "fixes"),
    ],
)
def test_each_format_is_told_by_its_content_and_commented(tmp_path, capsys, format_, make, table):
    if format_ == "ulog":
        pytest.importorskip("pyulog")
    (tmp_path / "log").write_bytes(make())
    text = new(tmp_path, tmp_path / "log")
    assert f"{tmp_path / 'log'}: {format_}" in capsys.readouterr().out
    assert table in tomllib.loads(text)
    assert "# EDIT: no file states where the antenna sits" in text


def test_a_dual_receiver_is_two_antennas_and_their_baseline(tmp_path, capsys):
    pytest.importorskip("pyubx2")
    (tmp_path / "rover.ubx").write_bytes(streams.ubx())
    text = new(tmp_path, tmp_path / "rover.ubx")
    assert "# A receiver's vector or heading, from the first antenna" in text
    table = tomllib.loads(text)
    assert [one["name"] for one in table["antenna"]] == ["gps1", "gps2"]
    assert table["baseline"] == [{"samples": "baseline.csv", "antennas": ["gps2", "gps1"]}]
    assert "edit antenna.position_b_m" in capsys.readouterr().out
    assert len(load_flight(tmp_path / "flight").baselines[0].t_s) == streams.EPOCHS


def test_two_antennas_of_one_name_are_told_apart(tmp_path):
    for name in ("left", "right"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "rover.obs").write_text(observation_3())
    (tmp_path / "n.nav").write_text(navigation_head() + message())
    files = [tmp_path / "left" / "rover.obs", tmp_path / "right" / "rover.obs", tmp_path / "n.nav"]
    table = tomllib.loads(new(tmp_path, *files))
    assert [a["name"] for a in table["antenna"]] == ["a1", "a2"]
    assert len({a["observations"] for a in table["antenna"]}) == 2
    assert table["gnss"]["navigation"] == ["n.nav"]


@pytest.mark.parametrize(
    ("text", "want"),
    [
        (
            "timestamp [us],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2],gyro_x,gyro_y,gyro_z\n"
            "0,0,0,-9.8,0.1,0,0\n5000,0,0,-9.8,0.1,0,0\n",
            {"s": "us", "mps2": "m/s2", "radps": "rad/s"},
        ),
        (
            "time,ax,ay,az,gx,gy,gz\n0,0,0,1000,100,0,0\n10,0,0,1000,100,0,0\n",
            {"s": "ms", "mps2": "mg", "radps": "deg/s"},
        ),
        (
            "UTC_time;lat;lon;alt;vn;ve;vd\n2025-07-08T19:00:00Z;1;2;3;4;5;6\n"
            "2025-07-08T19:00:01Z;1;2;3;4;5;6\n",
            {"s": "date"},
        ),
        ("1,0.01,0.0,1.0,7\n1.01,0,0.01,1.02,7\n1.02,0.01,0,1,6\n", {"s": "s", "mps2": "g"}),
        ("p,q,r,s\n1,0.01,0,9.8\n2,0,0.01,9.7\n3,0.01,0,9.8\n", {"s": "ms", "mps2": "m/s2"}),
    ],
)
def test_columns_are_guessed_by_names_and_numbers(tmp_path, text, want):
    (tmp_path / "a.csv").write_text(text)
    assert guess_table(tmp_path / "a.csv").units == want


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("", "must hold two rows of numbers or more"),
        ("a,b,c\n1,2,3\n2,3,4\n", "neither specific force nor places are found in its columns"),
        ("1,2,3,500\n2,2,3,500\n", "neither specific force nor places"),
    ],
)
def test_what_cannot_be_guessed_is_one_line(tmp_path, capsys, text, rule):
    (tmp_path / "a.csv").write_text(text)
    assert main(["new", str(tmp_path / "a.csv"), "--out", str(tmp_path / "flight")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert rule in line
    assert not (tmp_path / "flight").exists()


def test_without_a_file_it_says_so(tmp_path, capsys):
    assert main(["new", "--out", str(tmp_path / "flight")]) == 2
    assert "name a file to look at" in capsys.readouterr().err
