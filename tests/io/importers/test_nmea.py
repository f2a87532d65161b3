"""Sentences of receivers: dates, fixes that are none, what is not read."""

from functools import reduce
from operator import xor

import numpy as np
import pytest

from tests.io.importers.helpers import imported, refused

# 2024-01-01 is day 1 of GPS week 2295.
DAY_S = 2295 * 604_800 + 86_400 + 18


def sentence(body):
    return f"${body}*{reduce(xor, body.encode()):02X}\r\n"


def gga(time, quality=4, undulation="51.2"):
    return sentence(
        f"GNGGA,{time},4019.8,N,00352.8,W,{quality},12,0.7,648.8,M,{undulation},M,1.0,0001"
    )


def rmc(time, date="010124", status="A"):
    return sentence(f"GNRMC,{time},{status},4019.8,N,00352.8,W,7.8,0.0,{date},,,R")


def read(tmp_path, *sentences, toml=None):
    (tmp_path / "a.nmea").write_bytes("".join(sentences).encode())
    whole, flight = imported(tmp_path, "nmea", tmp_path / "a.nmea", toml=toml)
    return flight, {f"{one.what}: {one.reason}": one.count for one in whole.losses}, whole


def test_a_date_dates_what_stands_before_it_across_midnight(tmp_path):
    flight, _, _ = read(tmp_path, gga("235959.50"), gga("000000.50"), rmc("000000.50", "020124"))
    assert flight.start_gps_s == pytest.approx(DAY_S + 86_399.5)
    np.testing.assert_allclose(flight.fixes[0].t_s, [0, 1], atol=1e-6)


def test_zda_dates_and_gst_has_sigmas(tmp_path):
    zda = sentence("GPZDA,120000.00,01,01,2024,00,00")
    gst = sentence("GPGST,120000.00,1,2,3,45,0.01,0.02,0.03")
    flight, _, _ = read(tmp_path, zda, gst, gga("120000.00"))
    assert flight.start_gps_s == DAY_S + 43_200
    np.testing.assert_allclose(flight.fixes[0].position_sigma_m, [[0.01, 0.02, 0.03]])


def test_what_is_no_fix_damaged_or_not_read_is_counted(tmp_path):
    _, losses, _ = read(
        tmp_path,
        "0,0001*4E\r\n",
        gga("115959.00", 0),
        gga("115959.50", 6),
        rmc("120000.00"),
        gga("120000.00"),
        sentence("GPGSV,1,1,00"),
        gga("120001.00").replace("648", "649"),
    )
    assert losses == {
        "byte: in no whole message: damaged, or of another format": 84,
        "GGA message: the receiver had no fix": 1,
        "GGA message: dead reckoning": 1,
        "RMC message: speed and course without a vertical velocity": 1,
        "GSV message: not read": 1,
    }


def test_a_sentence_that_cannot_be_decoded_is_counted(tmp_path):
    wrong = sentence("GNRMC,120001.00,A,4019.8,N,00352.8,W,fast,0.0,010124,,,R")
    flight, losses, _ = read(tmp_path, rmc("120000.00"), gga("120000.00"), wrong)
    assert len(flight.fixes[0].t_s) == 1
    assert losses["RMC message: cannot be decoded"] == 1


def test_a_start_within_half_a_day_dates_a_file_without_dates(tmp_path):
    flight, _, _ = read(tmp_path, gga("235959.00"), toml='start = "2024-01-02T03:00:00"')
    np.testing.assert_allclose(flight.fixes[0].t_s, -3 * 3600 - 1 + 18, atol=1e-6)


def test_heights_without_undulation_are_said_to_be_above_the_sea(tmp_path):
    _, _, whole = read(tmp_path, rmc("120000.00"), gga("120000.00", undulation=""))
    assert "above the sea" in whole.notes["fixes"]


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        (rmc("120000.00"), "has no fix of a receiver, as of NAV-PVT"),
        (gga("120000.00"), "no RMC or ZDA sentence has a date; state start in --settings"),
        (rmc("120000.00", "990124") + gga("120000.00"), "no RMC or ZDA sentence has a date"),
    ],
)
def test_what_is_wrong_is_one_line(tmp_path, capsys, text, rule):
    (tmp_path / "a.nmea").write_text(text)
    assert rule in refused(capsys, tmp_path, tmp_path / "a.nmea")
