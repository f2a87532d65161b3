"""RINEX as it is written, character by character where the format fixes them."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.rinex.reader import read_navigation, read_rinex
from fgnav.io.rinex.writer import write_navigation, write_observations
from tests.io.flights import START_GPS_S, broadcast, observations
from tests.io.rinex_texts import values_3

PLACE = {"start_gps_s": START_GPS_S, "marker": "a1", "position_e_m": np.array([4e6, 1e6, 4.8e6])}


def write(tmp_path, obs, antenna=0, version="3.04"):
    write_observations(tmp_path / "a.rnx", obs, antenna, **PLACE, version=version)
    return tmp_path / "a.rnx"


def single(*values, lock=0, tag_s=0.0):
    """Return one epoch of one channel: code, phase, Doppler and density as far as stated."""
    obs = observations(np.random.default_rng(1), antennas=1, epochs=1)
    names = ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz")
    values = (*values, *[np.nan] * (4 - len(values)))
    arrays = {n: np.full((1, 1, 1), x, np.float64) for n, x in zip(names, values, strict=True)}
    flags, t_s = np.full((1, 1, 1), lock, np.uint8), np.array([tag_s])
    channel = {"satellites": ("G05",), "signals": ("1C",)}
    return replace(obs, t_s=t_s, tag_s=t_s[:, None], lock_flags=flags, **channel, **arrays)


@pytest.mark.parametrize(
    ("obs", "lines"),
    [
        (
            single(23456789.123, -1234567.5, -0.25, 45.5, lock=3, tag_s=3661.1234567),
            [
                "> 2020 06 25 01 01  1.1234567  0  1",
                "G05  23456789.123    -1234567.5003         -0.250          45.500",
            ],
        ),
        (single(1.0, tag_s=59.99999999), ["> 2020 06 25 00 01  0.0000000  0  1", "G05 {:13.3f}"]),
        (single(np.nan, 1.5), [..., "G05" + " " * 16 + "         1.500"]),
        (single(np.nan), ["> 2020 06 25 00 00  0.0000000  0  0"]),
        (single(np.nan, lock=1), [..., "G05" + " " * 30 + "1"]),
        (  # zero means not measured
            single(2e7, 1e-5, -1e-4, 0.0),
            [..., "G05  20000000.000           0.001          -0.001           0.001"],
        ),
    ],
)
def test_epochs_and_fields_stand_in_their_columns(tmp_path, obs, lines):
    body = write(tmp_path, obs).read_text().split("END OF HEADER\n")[1].splitlines()
    assert len(body) == len(lines)
    for got, want in zip(body, lines, strict=True):
        assert want is ... or got == want.format(1.0)


@pytest.mark.parametrize("version", ["3.04", "4.00"])
def test_both_versions_hold_every_value_and_message(tmp_path, shared, version):
    obs = observations(np.random.default_rng(4))
    path = write(tmp_path, obs, antenna=1, version=version)
    held = values_3(path.read_text())
    for m, channel in enumerate(zip(obs.satellites, obs.signals, strict=True)):
        for n in range(len(obs.t_s)):
            row = held.get((n, *channel), (np.nan,) * 4)
            want = [obs.code_m[n, 1, m], obs.phase_cycles[n, 1, m], obs.doppler_hz[n, 1, m]]
            np.testing.assert_array_equal(row[:3], want)
    assert read_rinex([], [path], START_GPS_S)[1][0].code_m.shape == (5, 1, 6)
    orbits = [shared / "orbits" / "ESBC00DNK_R_20201770000_01D_MN.rnx"]
    want = read_navigation(orbits, START_GPS_S)
    write_navigation(tmp_path / "n.rnx", want, start_gps_s=START_GPS_S, version=version)
    got = read_navigation([tmp_path / "n.rnx"], START_GPS_S)
    for name in want.records.dtype.names[1:]:
        np.testing.assert_allclose(got.records[name], want.records[name], rtol=1e-12, atol=1e-6)
    np.testing.assert_allclose(got.klobuchar, want.klobuchar, rtol=1e-4)


def test_long_file_is_written_in_parts(tmp_path):
    obs = observations(np.random.default_rng(4), antennas=1, epochs=4500)
    got = read_rinex([], [write(tmp_path, obs)], START_GPS_S)[1][0]
    np.testing.assert_array_equal(got.phase_cycles, obs.phase_cycles)


@pytest.mark.parametrize(
    ("obs", "version", "rule"),
    [
        (single(2e7, -1e9), "3.04", "values must be within 999999999.999"),
        (single(1.0), "2.11", "RINEX version: must be 3.04 or 4.00, got '2.11'"),
        (
            replace(single(1.0), satellites=("S01",)),
            "3.04",
            "satellite must be of G, R, E, C, J, got S01",
        ),
    ],
)
def test_what_rinex_cannot_hold_is_refused(tmp_path, obs, version, rule):
    with pytest.raises(BadInputError, match=rule):
        write(tmp_path, obs, version=version)


def test_clock_time_between_seconds_is_refused(tmp_path):
    records = broadcast().records.copy()
    records["toc_s"] += 0.5
    orbits = replace(broadcast(), records=records)
    with pytest.raises(BadInputError, match=r"time of clock must be a whole second, got .*.500000"):
        write_navigation(tmp_path / "n.rnx", orbits, start_gps_s=START_GPS_S)
