"""Broadcast messages: checked, sorted, decoded."""

import gzip
import re
from collections import Counter

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.rinex.reader import read_navigation
from tests.io.rinex_texts import message, navigation_head

START_GPS_S = 1_277_078_400.0  # 2020-06-25, a Thursday: second 345600 of GPS week 2111
GOOD = navigation_head() + message("G05") + message("G07")


def read(tmp_path, text, start_gps_s=START_GPS_S):
    path = tmp_path / "n.rnx"
    path.write_text(text)
    return read_navigation([path], start_gps_s)


def test_messages_are_read_in_gps_time_since_the_start(tmp_path):
    record = read(tmp_path, GOOD, START_GPS_S - 100).records[0]
    want = {"satellite": "G05", "toe_s": 100, "toc_s": 100, "transmission_s": 100, "issue": 63}
    want |= {"toe_sow_s": 345_600, "af0_s": -1.3629e-4}
    assert {name: record[name] for name in want} == want
    assert record["semi_major_axis_m"] == pytest.approx(5154.80**2, abs=1e-6)
    assert record["accuracy_m"] == 2.4  # 2 m in the file: the bound of its index
    assert record["group_delay_s"][0] == -1.909e-8
    text = navigation_head() + message("C11").replace("2.111000000000E+03", "7.550000000000E+02")
    record = read(tmp_path, text).records[0]  # of BeiDou
    assert (record["toe_s"], record["toc_s"], record["toe_sow_s"]) == (14, 14, 345_600)
    unknown = f"    {345600:19.12E}{4:19.12E}"  # time of transmission
    text = navigation_head() + message().replace(unknown, f"    {0.9999e9:19.12E}{4:19.12E}")
    assert read(tmp_path, text).records["transmission_s"].tolist() == [0]


def test_messages_that_are_not_used_are_counted(tmp_path):
    five = "".join(message("R05").splitlines(keepends=True)[:5])  # four lines until 3.05
    text = GOOD + five + five.replace("R05", "S27") + message("I03") + message("C59")
    impossible = message("G09").replace("5.154800000000E+03", "0.000000000000E+00")
    got = read(tmp_path, text + message("G05") + impossible)
    assert got.records["satellite"].tolist() == ["G05", "G07"]
    unused, wrong = "constellation not used", "of a number that is not used"
    assert {(loss.what, loss.reason): loss.count for loss in got.unused} == {
        ("GLONASS message", unused): 1,
        ("SBAS message", unused): 1,
        ("NavIC message", unused): 1,
        ("C59 message", wrong): 1,
        ("broadcast message", "impossible orbit or time"): 1,
        ("broadcast message", "repeated"): 1,
    }


def test_records_of_rinex_4_that_are_not_used_are_counted(tmp_path):
    def words(*numbers):
        return "".join(f"{number:19.12E}" for number in numbers)

    text = navigation_head("4.00")
    text += "> EPH G05 LNAV\n" + message("G05") + "> EPH G07 CNAV\n" + message("G07")
    text += "> STO G05 LNAV\n 2020 06 25 00 00 00 GPUT\n    1.0\n> ION G05 LNAV\n"
    text += f"    2020 06 25 00 00 00{words(1e-8, 2e-8, 3e-8)}\n    {words(0, 5e4, 6e4, 7e4)}\n"
    got = read(tmp_path, f"{text}    {words(8e4)}\n")
    assert got.records["satellite"].tolist() == ["G05"]
    unused = {loss.what: loss.count for loss in got.unused}
    assert unused == {"G CNAV message": 1, "STO record": 1, "ION record": 1}
    np.testing.assert_allclose(got.klobuchar, [1e-8, 2e-8, 3e-8, 0, 5e4, 6e4, 7e4, 8e4], rtol=1e-12)


LINES = GOOD.splitlines(keepends=True)
NUMBER = "must hold numbers such as -1.234567890123E-04, line 3 first"
BEGINS = "begins with no satellite and date, line 3 first"
SHORT = "must have 8 lines, the first with its date, line {} first"


@pytest.mark.parametrize(
    ("text", "rule", "left"),
    [
        (GOOD.replace("G05 2020", "??5 2020"), BEGINS, "G07"),
        (GOOD.replace("G05 2020 06", "G05 2020 16"), "must have a date, line 3 first", "G07"),
        ("".join(LINES[:-1]), SHORT.format(11), "G05"),
        ("".join(LINES[:4] + LINES[5:]), SHORT.format(3), "G07"),
        ("".join(LINES[:4] + LINES[3:]), SHORT.format(3), "G07"),
        (GOOD[: GOOD.rindex("3.456") + 5], NUMBER.replace("3 first", "11 first"), "G05"),
        (GOOD[: GOOD.rindex("G07") + 2], BEGINS.replace("3 first", "11 first"), "G05"),
        (GOOD.replace("-8.139900000000E-09", "-8.1399000000000000E-09", 1), NUMBER, "G07"),
        (GOOD.replace("5.154800000000E+03", "5.15480000x000E+03", 1), NUMBER, "G07"),
        (GOOD.replace("5.154800000000E+03", " " * 18, 1), NUMBER, "G07"),
        (navigation_head("4.00") + "> EPH G06 LNAV\n> EPH G07 LNAV\n" + message("G07"),
         SHORT.format(3), "G07"),
    ],
)  # fmt: skip
def test_messages_that_are_not_whole_are_counted(tmp_path, text, rule, left):
    got = read(tmp_path, text)
    assert got.records["satellite"].tolist() == [left]
    assert [(loss.reason, loss.count) for loss in got.unused] == [(rule, 1)]


def test_a_file_without_a_message_is_named(tmp_path):
    for text in (navigation_head(), navigation_head("4.00") + message()):
        with pytest.raises(BadInputError, match=r"n.rnx: must hold a GPS, Galileo, BeiDou or QZSS"):
            read(tmp_path, text)


def test_a_date_may_stand_a_column_late(tmp_path):
    late = GOOD.replace("G05 2020 06", "G05  2020 06")
    np.testing.assert_array_equal(read(tmp_path, late).records, read(tmp_path, GOOD).records)


def test_a_week_number_that_began_anew_is_that_of_the_date(tmp_path):
    rolled = GOOD.replace("2.111000000000E+03", f"{2111 - 2048:.12E}")
    np.testing.assert_array_equal(read(tmp_path, rolled).records, read(tmp_path, GOOD).records)
    wrong = GOOD.replace("2.111000000000E+03", f"{2050:.12E}")
    with pytest.raises(
        BadInputError, match="has none; broadcast message: impossible orbit or time"
    ):
        read(tmp_path, wrong)


def test_broken_ionosphere_record_is_named(tmp_path):
    text = navigation_head("4.00") + "> EPH G05 LNAV\n" + message()
    with pytest.raises(BadInputError, match=r"ION record must hold eight numbers"):
        read(tmp_path, text + "> ION G05 LNAV\n    2020 06 25 00 00 00 oops\n\n\n")


def test_empty_list_of_files_is_named():
    with pytest.raises(BadInputError, match="navigation: must name a file"):
        read_navigation([], START_GPS_S)


def test_real_files_hold_as_many_messages_as_their_text(shared):
    paths = [shared / "orbits" / "ESBC00DNK_R_20201770000_01D_MN.rnx"]
    got = read_navigation(paths, START_GPS_S)
    text = paths[0].read_text()
    count = Counter(re.findall(r"^([GECJ])\d\d \d{4}", text, re.MULTILINE))
    assert Counter(name[0] for name in got.records["satellite"].tolist()) == count
    assert not got.unused
    assert set(got.records["data_source"][np.char.startswith(got.records["satellite"], "E")]) == {
        258,
        517,
    }
    assert got.klobuchar[0] == 4.6566e-9


def test_real_rinex_2_file_is_read(shared):
    got = read_navigation([shared / "orbits" / "brdc1820.10n"], 961_977_600.0)  # 2010-07-01
    assert len(got.records) == 421
    assert np.abs(got.records["toe_s"]).max() < 2 * 86_400
    assert got.klobuchar[4] == 8.192e4


def test_real_rinex_4_file_is_sorted_by_type(shared):
    path = shared / "orbits" / "BRD400DLR_S_20230710000_01D_MN.rnx.gz"
    got = read_navigation([path], 1_362_614_400.0)  # 2023-03-12
    text = gzip.decompress(path.read_bytes()).decode()
    heads = re.findall(r"^> (\w+) ([A-Z])(\d\d) (\w+)", text, re.MULTILINE)
    wanted = [h for h in heads if h[0] == "EPH" and h[3] in ("LNAV", "INAV", "FNAV", "D1", "D2")]
    wanted = [h for h in wanted if h[1] in "GECJ" and int(h[2]) <= 46]
    assert len(got.records) + sum(x.count for x in got.unused if x.reason == "repeated") == len(
        wanted
    )
    unused = {loss.what: loss.count for loss in got.unused}
    assert unused["G CNAV message"] == 334
    assert sum(unused.values()) + len(got.records) == text.count("\n> ")
    assert np.abs(got.records["toe_s"] - 43_200).max() < 2 * 86_400
