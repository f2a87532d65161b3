"""Observation files, against a slow reader that takes every field as it stands."""

import gzip

import numpy as np
import pytest
from hatanaka import crx2rnx

from fgnav.checks import BadInputError
from fgnav.io.rinex.reader import read_rinex
from fgnav.types.observations import HALF_CYCLE, LOST_LOCK
from tests.io.rinex_texts import epoch_3, head_3, observation_3, values_3

START_GPS_S = 1_277_078_400.0  # 2020-06-25
FIELDS = ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")


def read(tmp_path, text, start_gps_s=START_GPS_S, name="a.rnx"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_rinex([], [path], start_gps_s)[1][0]


def assert_as_it_stands(observations, text, constellations="GECJR"):
    """Every kept value equals the field of the file; nothing else was invented."""
    channels = list(zip(observations.satellites, observations.signals, strict=True))
    column = {channel: m for m, channel in enumerate(channels)}
    expected = np.full((*observations.code_m.shape, 5), np.nan)
    expected[..., 4] = 0
    for (epoch, satellite, signal), row in values_3(text).items():
        if (satellite, signal) in column:
            expected[epoch, 0, column[satellite, signal]] = row
    for k, name in enumerate(FIELDS):
        got = getattr(observations, name)
        np.testing.assert_array_equal(got, expected[..., k].astype(got.dtype))
    assert {satellite[0] for satellite in observations.satellites} <= set(constellations)


def test_small_file_is_read_as_it_stands(tmp_path):
    text = observation_3()
    got = read(tmp_path, text)
    assert got.t_s.tolist() == [0, 1, 2, 3]
    assert got.satellites == ("C11", "E07", "E07", "G05", "G05", "G05", "G12", "G12", "G12", "R03")
    assert got.signals == ("2I", "1X", "5X", "1C", "2W", "5Q", "1C", "2W", "5Q", "1C")
    assert_as_it_stands(got, text)
    assert got.lock_flags[1, 0, 3] == LOST_LOCK
    assert got.losses == ()


@pytest.mark.parametrize("version", ["3.00", "3.02", "3.03", "3.05", "4.00", "4.02"])
def test_every_version_of_rinex_3_and_4_reads_the_same(tmp_path, version):
    got, want = read(tmp_path, observation_3(version=version)), read(tmp_path, observation_3())
    assert (got.satellites, got.signals) == (want.satellites, want.signals)
    np.testing.assert_array_equal(got.phase_cycles, want.phase_cycles)


@pytest.mark.parametrize(("system", "later_s"), [("GAL", 0), ("QZS", 0), ("BDT", 14), ("GLO", 18)])
def test_other_time_systems_become_gps_time(tmp_path, system, later_s):
    got = read(tmp_path, observation_3(system=system))
    np.testing.assert_allclose(got.t_s, np.arange(4) + later_s, rtol=0, atol=1e-9)


def test_start_with_fraction_and_clock_error_give_nominal_epochs_and_tags(tmp_path):
    text = observation_3().replace(".0000000  0", ".0004321  0")
    got = read(tmp_path, text, start_gps_s=START_GPS_S - 0.25)
    np.testing.assert_allclose(got.t_s, np.arange(4) + 0.25, rtol=0, atol=1e-9)
    np.testing.assert_allclose(got.tag_s[:, 0], got.t_s + 432.1e-6, rtol=0, atol=1e-9)


def test_power_failure_marks_every_phase_as_lost(tmp_path):
    got = read(tmp_path, head_3() + epoch_3(0) + epoch_3(2, flag=1) + epoch_3(3))
    assert (got.lock_flags[1] & LOST_LOCK == LOST_LOCK).all()
    assert not got.lock_flags[0].any()


def test_half_cycle_flag_and_flag_without_phase_survive(tmp_path):
    text = observation_3()
    first = text.index("\nG05") + 1
    fields = text[first : text.index("\n", first)]
    flagged = fields[:33] + "2" + fields[34:]
    assert read(tmp_path, text.replace(fields, flagged, 1)).lock_flags[0, 0, 3] == HALF_CYCLE
    blank = fields[:19] + " " * 14 + "1" + fields[34:]
    got = read(tmp_path, text.replace(fields, blank, 1))
    assert np.isnan(got.phase_cycles[0, 0, 3])
    assert got.lock_flags[0, 0, 3] == LOST_LOCK


def test_epoch_without_satellites_is_an_epoch_of_gaps(tmp_path):
    got = read(tmp_path, head_3() + epoch_3(0) + epoch_3(1, satellites=()) + epoch_3(2))
    assert got.t_s.tolist() == [0, 1, 2]
    assert np.isnan(got.code_m[1]).all()


def test_signals_that_are_wanted_are_kept_and_no_others(tmp_path):
    (tmp_path / "a.rnx").write_text(observation_3())
    (got,) = read_rinex([], [tmp_path / "a.rnx"], START_GPS_S, {"G": ["2W"], "E": ["5X"]})[1]
    assert set(zip(got.satellites, got.signals, strict=True)) == {
        *(("G05", "2W"), ("G12", "2W"), ("E07", "5X"))
    }
    assert_as_it_stands(got, observation_3())
    lost = {one.what: one.count for one in got.losses}
    assert (lost["G 1C observation"], lost["C 2I observation"]) == (8, 4)
    text = "key gnss.signals: no E signal 8X was observed; there are C 2I, E 1X, E 5X, G 1C, G 2W, "
    with pytest.raises(BadInputError, match=text):
        read_rinex([], [tmp_path / "a.rnx"], START_GPS_S, {"E": ["8X"]})


def test_satellite_of_another_number_is_a_counted_loss(tmp_path):
    got = read(tmp_path, observation_3().replace("C11", "C59"))
    assert "C59" not in got.satellites
    assert ("C59 observation", 4) in [(loss.what, loss.count) for loss in got.losses]


def test_real_1_hz_file_is_read_as_it_stands(shared):
    path = shared / "rinex" / "GRAS00FRA_R_20223151700_15M_01S_MO.crx.gz"
    text = crx2rnx(gzip.decompress(path.read_bytes())).decode()
    got = read_rinex([], [path], 1_352_221_200.0)[1][0]  # 2022-11-11 17:00
    assert got.t_s.tolist() == list(range(900))
    assert_as_it_stands(got, text)
    names = {s[0] + signal for s, signal in zip(got.satellites, got.signals, strict=True)}
    names -= {"R1C", "R2C", "R1P", "R2P"}
    assert names == {"G1C", "G2W", "G2X", "G5X", "E1X", "E5X", "E7X", "C2I", "C7I"}
    losses = {loss.what: loss.count for loss in got.losses}
    glonass = [satellite[0] == "R" for satellite in got.satellites]
    satellites = {s for s, is_glonass in zip(got.satellites, glonass, strict=True) if is_glonass}
    of = np.array(got.satellites)
    tracked = np.isfinite(got.code_m[:, 0]) | np.isfinite(got.phase_cycles[:, 0])
    records = sum(tracked[:, of == name].any(axis=1).sum() for name in satellites)
    assert records == 7714  # grep -c ^R of the plain file, less the header
    assert losses["SBAS observation"] == 900
