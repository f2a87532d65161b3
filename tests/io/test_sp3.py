"""Precise orbits."""

import gzip

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.sp3 import read_precise, write_precise
from fgnav.types.orbits import PreciseOrbits

START_GPS_S = 1_277_078_400.0  # 2020-06-25
MM = 1e-3
PS = 1e-12


def orbits(epochs=3, first_s=0.0, satellites=("C11", "E07", "G05")) -> PreciseOrbits:
    rng = np.random.default_rng(3)
    p_e_m = rng.normal(0, 2e7, (epochs, len(satellites), 3)).round(3)
    clock_s = rng.normal(0, 1e-4, (epochs, len(satellites))).round(12)
    p_e_m[1, 1] = np.nan
    clock_s[1, 1] = clock_s[0, -1] = np.nan
    t_s = first_s + 300.0 * np.arange(epochs)
    return PreciseOrbits(t_s=t_s, satellites=satellites, p_e_m=p_e_m, clock_s=clock_s)


@pytest.fixture
def text(tmp_path):
    write_precise(tmp_path / "good.sp3", orbits(), start_gps_s=START_GPS_S)
    return (tmp_path / "good.sp3").read_text()


def read(tmp_path, text):
    path = tmp_path / "a.sp3"
    path.write_text(text)
    return read_precise([path], START_GPS_S)


def test_written_orbits_are_read_back_within_the_digits(tmp_path):
    want = orbits(satellites=tuple(f"G{k + 1:02d}" for k in range(30)))
    write_precise(tmp_path / "a.sp3", want, start_gps_s=START_GPS_S)
    got = read_precise([tmp_path / "a.sp3"], START_GPS_S)
    assert got.satellites == want.satellites
    np.testing.assert_allclose(got.t_s, want.t_s, rtol=0, atol=1e-6)
    np.testing.assert_allclose(got.p_e_m, want.p_e_m, rtol=0, atol=0.6 * MM)
    np.testing.assert_allclose(got.clock_s, want.clock_s, rtol=0, atol=0.6 * PS)
    assert not got.unused


@pytest.mark.parametrize(
    ("old", "new", "later_s", "unused"),
    [
        ("cc GPS", "cc BDT", 14, {}),
        ("cc GPS", "cc UTC", 18, {}),
        ("C11", "S11", 0, {"SBAS orbit": 3}),
        ("C11", "L11", 0, {"low satellites' orbit": 3}),
    ],
)
def test_time_scales_versions_velocities_and_other_satellites(
    tmp_path, text, old, new, later_s, unused
):
    lines = []
    for line in text.replace(old, new).replace("#d", "#c").splitlines(keepends=True):
        lines += [line, "V" + line[1:]] if line.startswith("P") else [line]
    (tmp_path / "a.sp3.gz").write_bytes(gzip.compress("".join(lines).encode()))
    got = read_precise([tmp_path / "a.sp3.gz"], START_GPS_S)
    np.testing.assert_allclose(got.t_s, np.array([0, 300, 600]) + later_s, atol=1e-6)
    assert got.satellites == (() if unused else ("C11",)) + ("E07", "G05")
    assert {loss.what: loss.count for loss in got.unused} == unused | {"SP3 velocity": 9}


def test_two_days_are_joined_and_shared_epochs_counted(tmp_path):
    later = orbits(first_s=600.0, satellites=("G05", "J01", "J02"))
    write_precise(tmp_path / "1.sp3", orbits(), start_gps_s=START_GPS_S)
    write_precise(tmp_path / "2.sp3", later, start_gps_s=START_GPS_S)
    got = read_precise([tmp_path / "2.sp3", tmp_path / "1.sp3"], START_GPS_S)
    np.testing.assert_allclose(got.t_s, 300.0 * np.arange(5), atol=1e-6)
    assert got.satellites == ("C11", "E07", "G05", "J01", "J02")
    assert np.isnan(got.p_e_m[3, 0]).all()
    np.testing.assert_allclose(got.p_e_m[2, 2], orbits().p_e_m[2, 2], atol=0.6 * MM)
    assert [(loss.what, loss.count) for loss in got.unused] == [("2.sp3 epoch", 1)]


@pytest.mark.parametrize("letter", "ab")
def test_sp3_a_names_gps_by_numbers(tmp_path, letter):
    write_precise(
        tmp_path / "g.sp3", orbits(satellites=("G05", "G07", "G12")), start_gps_s=START_GPS_S
    )
    text = (tmp_path / "g.sp3").read_text().replace("cc GPS", "cc ccc").replace("#d", f"#{letter}")
    got = read(tmp_path, text.replace("G0", "  ").replace("G12", " 12"))
    assert got.satellites == ("G05", "G07", "G12")
    np.testing.assert_allclose(got.p_e_m[0], orbits().p_e_m[0], atol=0.6 * MM)


RECORD = "a.sp3 record: no four numbers with six decimals, or no satellite of the header, or twice"
EPOCH = "a.sp3 epoch: no date, or not later than all before"
MORE = "a.sp3 epoch: the header announces more: the file may be cut"
FEWER = "a.sp3 record: an epoch has fewer than the header has satellites"
EOF = "a.sp3 EOF: is missing: the file may be cut"


@pytest.mark.parametrize(
    ("damage", "epochs", "lost"),
    [
        (lambda t: t.replace("EOF\n", ""), 3, {EOF: 1}),
        (lambda t: t[: t.index("EOF") - 20], 3, {EOF: 1, RECORD: 1}),
        (lambda t: t[: t.rindex("*")], 2, {EOF: 1, MORE: 1}),
        (lambda t: t.replace("      3 ORBIT", "      4 ORBIT"), 3, {MORE: 1}),
        (lambda t: t.replace("*  2020", "*  20x0", 1), 2, {EPOCH: 1}),
        (lambda t: t.replace("0 10  0.0", "0  0  0.0"), 2, {EPOCH: 1}),
        (lambda t: t.replace("0 10  0.0", "0 70  0.0"), 2, {EPOCH: 1}),
        (lambda t: t.replace("PE07", "PE08", 1), 3, {RECORD: 1}),
        (lambda t: t.replace("PE07", "PC11", 1), 3, {RECORD: 1}),
        (lambda t: t.replace("999999.999999", "999999.99x999", 1), 3, {RECORD: 1}),
        (lambda t: t.replace(" 999999.999999", "999999.9999990", 1), 3, {RECORD: 1}),
        (lambda t: t.replace("999999.999999", "          nan", 1), 3, {RECORD: 1}),
        (lambda t: t.replace(t[t.index("PE07") : t.index("PG05")], "", 1), 3, {FEWER: 1}),
        (lambda t: t + "\x1a", 3, {}),
    ],
)
def test_what_is_not_whole_is_counted(tmp_path, text, damage, epochs, lost):
    got = read(tmp_path, damage(text))
    assert len(got.t_s) == epochs
    assert {f"{one.what}: {one.reason}": one.count for one in got.unused} == lost


@pytest.mark.parametrize(
    ("damage", "rule"),
    [
        (lambda t: "#e" + t[2:], r"line 1: must start with #a to #d, got '#eP2020"),
        (lambda t: t.replace("      3 ORBIT", "      x ORBIT"), "must tell the numbers of epochs"),
        (lambda t: t.replace("C11E07", "C11C11", 1), "list each satellite once, got '3 with repet"),
        (lambda t: t.replace("C11E07", "C11X07", 1), "list each satellite once, got 'X07'"),
        (lambda t: t.replace("cc GPS", "cc XYZ"), "time system must be one of GPS.*, got 'XYZ'"),
        (lambda t: t[: t.index("\n*") + 1], "must hold a position of a satellite, has none"),
    ],
)
def test_faults_of_a_header_are_named(tmp_path, text, damage, rule):
    with pytest.raises(BadInputError, match=rule):
        read(tmp_path, damage(text))


def test_real_file_is_read_as_it_stands(shared):
    path = shared / "orbits" / "COD0MGXFIN_20201770000_01D_05M_ORB.SP3"
    got = read_precise([path], START_GPS_S)
    np.testing.assert_allclose(got.t_s, 300.0 * np.arange(289), atol=1e-6)
    lines = path.read_text().splitlines()
    first = next(line for line in lines if line.startswith("PG05"))
    column = got.satellites.index("G05")
    want = [float(first[4 + 14 * k : 18 + 14 * k]) for k in range(4)]
    np.testing.assert_allclose(got.p_e_m[0, column], np.array(want[:3]) * 1e3, rtol=0, atol=1e-6)
    assert got.clock_s[0, column] == pytest.approx(want[3] * 1e-6, abs=1e-18)
    assert np.count_nonzero(np.isnan(got.clock_s)) == sum(
        "999999.999999" in line for line in lines if line[0] == "P"
    )
