"""A flight as a folder."""

import re
import shutil
from dataclasses import fields, is_dataclass

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.geometry.earth import ecef, ned_axes
from fgnav.geometry.rotations import to_euler
from fgnav.io.flight import folder as flight_folder
from fgnav.io.flight.folder import files_of, load_flight, save_flight
from fgnav.io.flight.series import FORWARD_RIGHT_DOWN, mounting_rotation
from fgnav.types.flight import Baseline
from fgnav.types.instruments import USUAL_IMU_NOISE
from tests.io.flights import whole_flight
from tests.io.rinex_texts import message, navigation_head, observation_3

UM = 1e-6
PLAIN = """\
format = "fgnav-flight/1"
name = "plain"
start = "2020-06-25T00:00:00"
[origin]
latitude_deg = 40.0
longitude_deg = -4.0
height_m = 700.0
"""
FIXES = """\
[[antenna]]
name = "a1"
position_b_m = [0, 0, 0]
[fixes]
samples = "f.csv"
antenna = "a1"
"""


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    flight = whole_flight(np.random.default_rng(5))
    folder = tmp_path_factory.mktemp("flights") / "whole"
    save_flight(flight, folder)
    return flight, load_flight(folder), folder


def write(folder, toml, **files):
    (folder / "flight.toml").write_text(toml)
    for name, text in files.items():
        (folder / name.replace("_", ".")).write_text(text)
    return folder


# Digits of RINEX and SP3: relative and absolute, by the end of a field's name.
TOLERANCE = {
    "observations.tag_s": (0, 0.51e-7),
    "cn0_dbhz": (1e-7, 0),
    "code_m": (1e-15, 0),
    "phase_cycles": (1e-15, 0),
    "doppler_hz": (1e-15, 0),
    "klobuchar": (1e-4, 0),
    "precise.p_e_m": (0, 1e-3),
    "precise.clock_s": (0, 1e-12),
    "broadcast.records": (1e-12, 1e-6),
}


def assert_same(got, want, where):
    """Every field comes back, within the digits of its file."""
    if isinstance(want, Baseline) and want.measured == "heading":  # level at the vehicle
        for name in ("t_s", "antennas", "measured", "unstated", "heading_rad", "heading_sigma_rad"):
            assert_same(getattr(got, name), getattr(want, name), f"{where}.{name}")
    elif is_dataclass(want):
        for name in (one.name for one in fields(want) if one.name != "unused"):
            assert_same(getattr(got, name), getattr(want, name), f"{where}.{name}")
    elif isinstance(want, tuple):
        assert len(got) == len(want), where
        for k, (one, other) in enumerate(zip(got, want, strict=True)):
            assert_same(one, other, f"{where}.{k}")
    elif isinstance(want, np.ndarray) and want.dtype.names:
        for name in want.dtype.names:
            assert_same(got[name], want[name], where)
    elif isinstance(want, np.ndarray | float) and np.asarray(want).dtype.kind == "f":
        ends = (pair for end, pair in TOLERANCE.items() if where.endswith(end))
        rtol, atol = next(ends, (1e-10, UM))
        np.testing.assert_allclose(got, want, rtol=rtol, atol=atol, err_msg=where)
    else:
        np.testing.assert_array_equal(got, want, err_msg=where)


def test_every_field_comes_back_within_the_digits(saved):
    assert_same(saved[1], saved[0], "flight")
    assert saved[1].unused == ()


def test_antenna_names_that_are_no_file_names_are_written(saved):
    names = {path.name for path in saved[2].iterdir()}
    assert {"a1.rnx", "antenna-2.rnx", "base.rnx", "antenna-3.rnx"} <= names


def test_truth_in_files_refers_to_the_axes_at_the_vehicle(saved):
    flight, _, folder = saved
    row = np.loadtxt(folder / "truth.csv", delimiter=",", skiprows=1)[3]
    latitude, longitude = np.radians(row[1:3])[:, None]
    R_ne = ned_axes(latitude, longitude)[0]
    p_e_m = ecef(latitude, longitude, row[3:4])[0]
    np.testing.assert_allclose(p_e_m, flight.origin.to_e(flight.truth.p_n_m)[3], rtol=0, atol=UM)
    v_e_mps = flight.truth.v_n_mps[3] @ flight.origin.R_ne
    np.testing.assert_allclose(row[4:7], R_ne @ v_e_mps, rtol=0, atol=UM)
    R_eb = flight.origin.R_ne.T @ flight.truth.R_nb[3]
    np.testing.assert_allclose(np.radians(row[7:10]), to_euler((R_ne @ R_eb)[None])[0], atol=1e-12)


HEAD = "t_s,latitude_deg,longitude_deg,height_m"


def test_fixes_without_sigma_have_the_documented_ones(tmp_path):
    rows = f"{HEAD},vn_mps,ve_mps,vd_mps\n0,40,-4,700,1,2,3\n"
    got = load_flight(write(tmp_path, PLAIN + FIXES, f_csv=rows)).fixes[0]
    np.testing.assert_allclose(got.p_n_m, 0, atol=UM)
    assert got.position_sigma_m.tolist() == [[3, 3, 5]]
    assert got.velocity_sigma_mps.tolist() == [[0.1, 0.1, 0.1]]
    np.testing.assert_allclose(got.v_n_mps, [[1, 2, 3]], atol=1e-9)
    rows = f"{HEAD},sigma_vn_mps,sigma_ve_mps,sigma_vd_mps\n0,40,-4,700,1,1,1\n"
    with pytest.raises(BadInputError, match=r"f.csv: line 1: sigma_vn_mps needs vn_mps, ve_mps, v"):
        load_flight(write(tmp_path, PLAIN + FIXES, f_csv=rows))


ANTENNA = '[[antenna]]\nname = "{0}"\nposition_b_m = [0, 0, 0]\nobservations = "{0}.rnx"\n'
TWO = ANTENNA.format("a") + ANTENNA.format("b")
GNSS = '[gnss]\nnavigation = ["n.rnx"]\n'
FILES = {"a_rnx": observation_3(), "b_rnx": observation_3(), "n_rnx": navigation_head() + message()}


BASE = 'base = { observations = "a.rnx", position_e_m = [0, 0, 0] }\n'
ALONE = TWO.replace('observations = "b.rnx"\n', "")
TWICE = ANTENNA.format("a") * 2


@pytest.mark.parametrize(
    ("toml", "rule"),
    [
        (TWO, "flight.toml: gnss: observations need navigation or orbits files"),
        (ALONE + GNSS, "antenna b: observations must be given for all antennas or for none"),
        (TWICE + GNSS, "flight.toml: antenna a: two antennas have this name"),
        (TWO + GNSS.replace("n.rnx", "m.rnx"), "m.rnx: no such file"),
        (TWO.replace("b.rnx", "c.rnx") + GNSS, "c.rnx: no such file"),
        (TWO + GNSS + "elevation_mask_deg = 95.0\n", "flight.toml: elevation_mask_deg: must be"),
        (TWO + GNSS + "code_noise_m = -1.0\n", "gnss noise code_m: must be positive"),
        (FIXES.replace('antenna = "a1"', 'antenna = "a2"'), "f.csv: no such file"),
        (GNSS + BASE, "key gnss.base: needs antennas with observations"),
    ],
)
def test_faults_of_a_flight_are_named(tmp_path, toml, rule):
    with pytest.raises(BadInputError, match=rule) as caught:
        load_flight(write(tmp_path, PLAIN + toml, **FILES))
    assert "\n" not in str(caught.value)


def test_folder_without_flight_is_named(tmp_path):
    with pytest.raises(
        BadInputError, match=r"flight.toml: no such file; a flight is a folder with"
    ):
        load_flight(tmp_path)


def test_folder_that_holds_something_is_not_overwritten(saved, tmp_path):
    (tmp_path / "precious").write_text("x")
    for place in (tmp_path, tmp_path / "precious"):
        with pytest.raises(BadInputError, match="must be a new or empty folder, it holds"):
            save_flight(saved[0], place)
    assert (tmp_path / "precious").read_text() == "x"


def test_nothing_is_left_of_a_flight_that_cannot_be_written(saved, tmp_path, monkeypatch):
    def fail(*_: object) -> None:
        raise BadInputError("disk full")

    monkeypatch.setattr(flight_folder, "write_toml", fail)
    with pytest.raises(BadInputError, match="disk full"):
        save_flight(saved[0], tmp_path / "deep" / "new")
    assert list((tmp_path / "deep").iterdir()) == []


def test_same_flight_gives_the_same_bytes(saved, tmp_path):
    save_flight(saved[0], tmp_path / "again")
    for path in saved[2].iterdir():
        assert (tmp_path / "again" / path.name).read_bytes() == path.read_bytes()


@pytest.fixture
def copy(saved, tmp_path):
    return shutil.copytree(saved[2], tmp_path / "copy")


def test_a_table_cut_between_rows_is_a_counted_loss(saved, copy):
    path = copy / "imu.csv"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-2]))
    (loss,) = set(load_flight(copy).unused) - set(saved[1].unused)
    assert (loss.what, loss.count) == ("imu.csv row", 2)
    assert "the file may be cut" in loss.reason


def test_a_table_that_nothing_names_any_more_is_a_counted_loss(saved, copy):
    toml = copy / "flight.toml"
    head, _, _ = toml.read_text().partition("[truth]\n")  # the last table
    toml.write_text(head)
    lost = {loss.what: loss for loss in set(load_flight(copy).unused) - set(saved[1].unused)}
    assert sorted(lost) == ["integers.csv row", "truth.csv row"]
    assert lost["truth.csv row"].reason == "rows in flight.toml has it, no table names it"


def test_one_bad_time_stamp_is_refused_before_anything_is_made_of_it(copy):
    path = copy / "imu.csv"
    *lines, last = path.read_text().splitlines()
    t_s, comma, rest = last.partition(",")
    path.write_text("\n".join([*lines, f"{float(t_s) + 604_800}{comma}{rest}"]) + "\n")
    with pytest.raises(BadInputError, match=r"row 7 of the samples has 604801\.5 s after 1\.25"):
        load_flight(copy)


def test_the_files_of_a_flight_are_listed(copy):
    names = {path.name for path in files_of(copy)}
    assert names == {path.name for path in copy.iterdir()}


def test_axes_and_angles_rotate_a_unit_into_the_body():
    down = mounting_rotation(("-x", "y", "-z"), (0, 0, 0)) @ [0, 0, -9.8]
    np.testing.assert_allclose(down, [0, 0, 9.8], atol=1e-12)
    # Yawed right by 90 deg, the unit's own forward axis looks to the right of the body.
    right = mounting_rotation(FORWARD_RIGHT_DOWN, (0, 0, 90)) @ [1, 0, 0]
    np.testing.assert_allclose(right, [0, 1, 0], atol=1e-12)
    # Nose up by 10 deg: what the unit feels along its forward axis is partly up in the body.
    up = mounting_rotation(FORWARD_RIGHT_DOWN, (0, 10, 0)) @ [1, 0, 0]
    assert up[2] == pytest.approx(-np.sin(np.radians(10)))


@pytest.mark.parametrize(
    ("axes", "text"),
    [
        ("xyw", "imu axes: must be x, y, z, -x, -y or -z, got 'w'"),
        ("xyy", "must be a right-handed triad such as -x, y, -z, got x, y, y"),
        (("-x", "y", "z"), "must be a right-handed triad such as -x, y, -z, got -x, y, z"),
    ],
)
def test_axes_that_are_no_triad_are_refused(axes, text):
    with pytest.raises(BadInputError, match=text):
        mounting_rotation(axes, (0, 0, 0))


def changed(copy, *pairs):
    """Return a copy's flight with parts of its flight.toml replaced."""
    toml = copy / "flight.toml"
    for old, new in pairs:
        assert old in toml.read_text()
        toml.write_text(toml.read_text().replace(old, new))
    return load_flight(copy)


def test_keys_of_flight_toml_rotate_samples_and_set_the_clock(saved, copy):
    axes = ('axes = ["x", "y", "z"]', 'axes = ["y", "-x", "z"]')
    got = changed(copy, axes, ("clock_offset_s = 0.0", "clock_offset_s = -0.25")).imu
    np.testing.assert_allclose(got.t_s, saved[0].imu.t_s - 0.25, rtol=0, atol=1e-7)
    for name in ("f_b_mps2", "w_b_radps"):
        x, y, z = getattr(saved[0].imu, name).T
        np.testing.assert_allclose(getattr(got, name), np.column_stack([y, -x, z]), rtol=1e-10)


def test_timestamps_of_which_nothing_is_stated_are_known_to_half_a_sample(copy):
    assert load_flight(copy).imu.clock_offset_sigma_s == 0.0  # a simulator's
    line = "clock_offset_sigma_s = 0.0\n"
    got = changed(copy, (line, "")).imu
    interval_s = float(np.median(np.diff(got.t_s)))
    assert got.clock_offset_sigma_s == pytest.approx(interval_s / np.sqrt(12), rel=1e-6)
    with pytest.raises(BadInputError, match="clock_offset_sigma_s: must be 0 or more"):
        changed(copy, ("clock_offset_s = 0.0", line.replace("0.0", "-1.0")))


def test_noise_left_out_is_the_usual_and_stays_left_out_when_written_again(copy, tmp_path):
    toml = copy / "flight.toml"
    toml.write_text(re.sub(r"\n\w+_(noise|bias)\w* = .*", "", toml.read_text()))
    silent = load_flight(copy)
    assert silent.imu.unstated == tuple(USUAL_IMU_NOISE)
    assert {name: getattr(silent.imu, name) for name in USUAL_IMU_NOISE} == USUAL_IMU_NOISE
    assert silent.gnss_noise.unstated == ("code_m", "phase_m", "doppler_mps")
    save_flight(silent, tmp_path / "again")
    assert "_noise" not in (tmp_path / "again" / "flight.toml").read_text()
