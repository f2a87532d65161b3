"""RINEX as it is written, character by character where the format fixes them."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.rinex.reader import read_navigation, read_rinex
from fgnav.io.rinex.writer import write_navigation, write_observations
from tests.io.flights import START_GPS_S, broadcast, observations
from tests.io.rinex_texts import values_3

P_E_M = np.array([4e6, 1e6, 4.8e6])


def write(tmp_path, obs, antenna=0, version="3.04", start_gps_s=START_GPS_S):
    path = tmp_path / "a.rnx"
    write_observations(
        path,
        obs,
        antenna,
        start_gps_s=start_gps_s,
        marker="a1",
        position_e_m=P_E_M,
        version=version,
    )
    return path


def single(code_m, phase_cycles=np.nan, doppler_hz=np.nan, cn0_dbhz=np.nan, lock=0, tag_s=0.0):
    """Return one epoch of one channel."""
    obs = observations(np.random.default_rng(1), antennas=1, epochs=1)
    pick = {"code_m": code_m, "phase_cycles": phase_cycles, "doppler_hz": doppler_hz}
    arrays = {name: np.full((1, 1, 1), value) for name, value in pick.items()}
    return replace(
        obs,
        t_s=np.array([tag_s]),
        tag_s=np.array([[tag_s]]),
        satellites=("G05",),
        signals=("1C",),
        cn0_dbhz=np.full((1, 1, 1), cn0_dbhz, np.float32),
        lock_flags=np.full((1, 1, 1), lock, np.uint8),
        **arrays,
    )


def body(path):
    return path.read_text().split("END OF HEADER\n")[1].splitlines()


def test_epoch_and_fields_stand_in_their_columns(tmp_path):
    obs = single(23456789.123, -1234567.5, -0.25, 45.5, lock=3, tag_s=3661.1234567)
    assert body(write(tmp_path, obs)) == [
        "> 2020 06 25 01 01  1.1234567  0  1",
        "G05  23456789.123    -1234567.5003         -0.250          45.500",
    ]


def test_seconds_that_round_up_carry_into_the_minute(tmp_path):
    assert (
        body(write(tmp_path, single(1.0, tag_s=59.99999999)))[0]
        == "> 2020 06 25 00 01  0.0000000  0  1"
    )


def test_value_that_rounds_to_zero_is_not_lost(tmp_path):
    path = write(tmp_path, single(2e7, 1e-5, -1e-4, 0.0))
    assert body(path)[1] == "G05  20000000.000           0.001          -0.001           0.001"
    got = read_rinex([], [path], START_GPS_S)[1][0]
    assert got.doppler_hz[0, 0, 0] == -0.001


@pytest.mark.parametrize("version", ["3.04", "4.00"])
def test_both_versions_hold_every_value(tmp_path, version):
    obs = observations(np.random.default_rng(4))
    path = write(tmp_path, obs, antenna=1, version=version)
    held = values_3(path.read_text())
    for m, channel in enumerate(zip(obs.satellites, obs.signals, strict=True)):
        for n in range(len(obs.t_s)):
            row = held.get((n, *channel), (np.nan,) * 4)
            want = [obs.code_m[n, 1, m], obs.phase_cycles[n, 1, m], obs.doppler_hz[n, 1, m]]
            np.testing.assert_array_equal(row[:3], want)
    assert read_rinex([], [path], START_GPS_S)[1][0].code_m.shape == (5, 1, 6)


def test_long_file_is_written_in_parts(tmp_path):
    obs = observations(np.random.default_rng(4), antennas=1, epochs=4500)
    got = read_rinex([], [write(tmp_path, obs)], START_GPS_S)[1][0]
    np.testing.assert_array_equal(got.phase_cycles, obs.phase_cycles)


def test_values_too_wide_are_refused(tmp_path):
    with pytest.raises(BadInputError, match=r"values must be within 999999999.999"):
        write(tmp_path, single(2e7, -1e9))


def test_unknown_version_and_constellation_are_refused(tmp_path):
    with pytest.raises(BadInputError, match=r"RINEX version: must be 3.04 or 4.00, got '2.11'"):
        write(tmp_path, single(1.0), version="2.11")
    with pytest.raises(BadInputError, match="satellite must be of G, R, E, C, J, got S01"):
        write(tmp_path, replace(single(1.0), satellites=("S01",)))


def test_real_messages_survive_being_written(tmp_path, shared):
    want = read_navigation([shared / "orbits" / "ESBC00DNK_R_20201770000_01D_MN.rnx"], START_GPS_S)
    write_navigation(tmp_path / "n.rnx", want, start_gps_s=START_GPS_S)
    got = read_navigation([tmp_path / "n.rnx"], START_GPS_S)
    for name in want.records.dtype.names[1:]:
        np.testing.assert_allclose(got.records[name], want.records[name], rtol=1e-12, atol=1e-6)


def test_clock_time_between_seconds_is_refused(tmp_path):
    records = broadcast().records.copy()
    records["toc_s"] += 0.5
    with pytest.raises(BadInputError, match=r"time of clock must be a whole second, got .*.500000"):
        write_navigation(
            tmp_path / "n.rnx", replace(broadcast(), records=records), start_gps_s=START_GPS_S
        )
