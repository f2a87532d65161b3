"""The head of a RINEX file."""

from pathlib import Path

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.rinex.header import read_header
from fgnav.io.rinex.text import read_text
from tests.io.rinex_texts import head_3, line, navigation_head, observation_2, observation_3

PATH = Path("a.rnx")


def header(text: str, kind="observations"):
    return read_header(PATH, np.frombuffer(text.encode("latin-1"), np.uint8), kind)


def test_head_tells_version_types_and_where_the_body_starts():
    text = observation_3()
    got = header(text)
    assert (got.version, got.system, got.time_system) == (3.04, "M", "GPS")
    assert got.types["E"] == ("C1X", "L1X", "C5X", "L5X")
    assert text[got.size :].startswith("> 2020")
    assert got.lines == text[: got.size].count("\n")


def test_types_go_on_in_the_next_line():
    types = [f"{c}{b}{a}" for b in "125" for a in "CWX" for c in "CL"]
    first = f"G   {len(types)} " + " ".join(types[:13])
    second = "       " + " ".join(types[13:])
    text = head_3().replace(
        line("G    8 " + "C1C L1C D1C S1C C2W L2W C5Q L5Q", "SYS / # / OBS TYPES"),
        line(first, "SYS / # / OBS TYPES") + line(second, "SYS / # / OBS TYPES"),
    )
    assert header(text).types["G"] == tuple(types)


def test_b1i_of_rinex_3_02_is_named_2i():
    text = head_3(version="3.02").replace("C2I L2I", "C1I L1I")
    assert header(text).types["C"] == ("C2I", "L2I")


def test_rinex_2_types_serve_all_constellations():
    got = header(observation_2())
    assert got.types["G"] == got.types["E"] == ("C1", "L1", "P2", "L2", "D1", "S1")


@pytest.mark.parametrize("extra", ["", "    "])
def test_the_time_system_stands_anywhere_and_blank_lines_may_go_before(extra, tmp_path):
    text = observation_3(system=extra + "BDT")
    assert header(text).time_system == "BDT"
    (tmp_path / "a.rnx").write_text("\n  \n" + text)
    assert header(read_text(tmp_path / "a.rnx").tobytes().decode()).time_system == "BDT"
    listed = GOOD.replace("E    4", "E    3")
    assert header(listed).types["E"] == ("C1X", "L1X", "C5X", "L5X")


def test_klobuchar_and_last_epoch_are_read():
    corrections = line("GPSA   1.0000E-08  2.0000E-08  0.0000E+00 -1.0000D-07", "IONOSPHERIC CORR")
    corrections += line("GPSB   1.0000E+05  2.0000E+05  0.0000E+00 -1.0000E+05", "IONOSPHERIC CORR")
    text = navigation_head().replace(
        line("", "END OF HEADER"), corrections + line("", "END OF HEADER")
    )
    got = header(text, "navigation")
    assert got.klobuchar == (1e-8, 2e-8, 0.0, -1e-7, 1e5, 2e5, 0.0, -1e5)
    last = line("  2020     6    25     0     0   30.5000000     GPS", "TIME OF LAST OBS")
    start_s = 1_277_078_400  # 2020-06-25
    assert header(head_3(extra=last)).last_gps_s == start_s + 30.5


GOOD = head_3()
FIRST = "TIME OF FIRST OBS"


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("hello\n", r"a.rnx: line 1: must be RINEX VERSION / TYPE, got 'hello'"),
        (GOOD.replace("END OF HEADER", "COMMENT"), "line 7: header must end with END OF HEADER"),
        (GOOD.replace("     3.04", "     5.00"), "RINEX version must be .*, got '5'"),
        (GOOD.replace("     3.04", "     2.13"), "RINEX version must be .*, got '2.13'"),
        (GOOD.replace("     3.04", "     x.04"), "RINEX version must be a number, got '     x.04'"),
        (GOOD.replace("     3.04", "      nan"), "RINEX version must be .*, got 'nan'"),
        (GOOD.replace("OBSERVATION", "METEOROLOGY"), "line 1: must be a RINEX observations file"),
        (
            GOOD.replace(f"{'':19s}M", f"{'':19s}X", 1).replace("DATA    M", "DATA    X"),
            "constellation must be one of GRECJSIM, got 'X'",
        ),
        (GOOD.replace("SYS / # / OBS TYPES", "COMMENT"), "must have SYS / # / OBS TYPES"),
        (GOOD.replace(FIRST, "COMMENT"), "must have TIME OF FIRST OBS, it is missing"),
        (GOOD.replace("GPS ", "UTC "), "time system must be GPS, .*, got 'UTC'"),
        (GOOD.replace("E    4", "E    5"), "line 3: 5 observation types announced, got '4 listed'"),
        (GOOD.replace("E    4", "E    x"), "line 3: number of observation types must be whole"),
        (GOOD.replace("C1X L1X", "C1X C1X"), "observation type must be known and new, got 'C1X'"),
        (GOOD.replace("C1X L1X", "Q1X L1X"), "observation type must be known and new, got 'Q1X'"),
        (GOOD.replace("E    4", "G    4"), "constellation must be new and one of GRECJSI, got 'G'"),
        (GOOD.replace("G    8", "     8"), "OBS TYPES must start with a const"),
        (
            GOOD.replace("G    8 C1C L1C D1C S1C C2W L2W C5Q L5Q", "G    0" + " " * 32),
            "1 to 99 observation types, got",
        ),
        (
            head_3(extra=line("G   12", "SYS / SCALE FACTOR")),
            "SYS / SCALE FACTOR must be 1, 10, 100 or 1000; repair the line, got '12'",
        ),
        (
            observation_2().replace("# / TYPES OF OBSERV", "COMMENT"),
            "must have # / TYPES OF OBSERV",
        ),
    ],
)
def test_faults_of_a_head_are_named(text, rule):
    with pytest.raises(BadInputError, match=rule):
        header(text)


def test_navigation_head_with_broken_ionosphere_is_named():
    extra = line("GPSA   1.0000E-08  2.0000E-08  0.0000E+00       oops", "IONOSPHERIC CORR")
    text = navigation_head().replace(line("", "END OF HEADER"), extra + line("", "END OF HEADER"))
    with pytest.raises(BadInputError, match="IONOSPHERIC CORR must hold four numbers"):
        header(text, "navigation")
    with pytest.raises(BadInputError, match="must be a RINEX navigation file"):
        header(GOOD, "navigation")
