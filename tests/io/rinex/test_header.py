"""The head of a RINEX file."""

from pathlib import Path

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.rinex.header import read_header
from fgnav.io.rinex.text import read_text
from tests.io.rinex_texts import head_3, line, navigation_head, observation_2, observation_3

GOOD, TWO, MESSAGES = head_3(), observation_2(), navigation_head()
END, FIRST = line("", "END OF HEADER"), "TIME OF FIRST OBS"


def header(text, kind="observations"):
    return read_header(Path("a.rnx"), np.frombuffer(text.encode("latin-1"), np.uint8), kind)


def test_version_types_and_where_the_body_starts():
    text = observation_3()
    got = header(text)
    assert (got.version, got.system, got.time_system) == (3.04, "M", "GPS")
    assert got.types["E"] == ("C1X", "L1X", "C5X", "L5X")
    assert text[got.size :].startswith("> 2020")
    assert got.lines == text[: got.size].count("\n")
    assert header(TWO).types["G"] == header(TWO).types["E"] == ("C1", "L1", "P2", "L2", "D1", "S1")
    assert header(head_3("3.02").replace("C2I L2I", "C1I L1I")).types["C"] == ("C2I", "L2I")
    more = header(GOOD.replace("E    4", "E    3"))  # than were announced
    assert more.types["E"] == ("C1X", "L1X", "C5X", "L5X")


def test_types_go_on_in_the_next_line():
    types = [f"{c}{b}{a}" for b in "125" for a in "CWX" for c in "CL"]
    first = line(f"G   {len(types)} " + " ".join(types[:13]), "SYS / # / OBS TYPES")
    second = line("       " + " ".join(types[13:]), "SYS / # / OBS TYPES")
    old = line("G    8 C1C L1C D1C S1C C2W L2W C5Q L5Q", "SYS / # / OBS TYPES")
    assert header(GOOD.replace(old, first + second)).types["G"] == tuple(types)


@pytest.mark.parametrize("extra", ["", "    "])
def test_the_time_system_stands_anywhere_and_blank_lines_may_go_before(extra, tmp_path):
    (tmp_path / "a.rnx").write_text("\n  \n" + observation_3(system=extra + "BDT"))
    assert header(read_text(tmp_path / "a.rnx").tobytes().decode()).time_system == "BDT"


def test_klobuchar_and_last_epoch_are_read():
    corrections = line("GPSA   1.0000E-08  2.0000E-08  0.0000E+00 -1.0000D-07", "IONOSPHERIC CORR")
    corrections += line("GPSB   1.0000E+05  2.0000E+05  0.0000E+00 -1.0000E+05", "IONOSPHERIC CORR")
    got = header(MESSAGES.replace(END, corrections + END), "navigation")
    assert got.klobuchar == (1e-8, 2e-8, 0.0, -1e-7, 1e5, 2e5, 0.0, -1e5)
    last = line("  2020     6    25     0     0   30.5000000     GPS", "TIME OF LAST OBS")
    assert header(head_3(extra=last)).last_gps_s == 1_277_078_400 + 30.5  # 2020-06-25


OOPS = line("GPSA   1.0000E-08  2.0000E-08  0.0000E+00       oops", "IONOSPHERIC CORR")
NO_TYPES = GOOD.replace("G    8 C1C L1C D1C S1C C2W L2W C5Q L5Q", "G    0" + " " * 32)


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
        (GOOD.replace("DATA    M", "DATA    X"), "constellation must be one of GRECJSIM, got 'X'"),
        (GOOD.replace("SYS / # / OBS TYPES", "COMMENT"), "must have SYS / # / OBS TYPES"),
        (GOOD.replace(FIRST, "COMMENT"), "must have TIME OF FIRST OBS, it is missing"),
        (GOOD.replace("GPS ", "UTC "), "time system must be GPS, .*, got 'UTC'"),
        (GOOD.replace("E    4", "E    5"), "line 3: 5 observation types announced, got '4 listed'"),
        (GOOD.replace("E    4", "E    x"), "line 3: number of observation types must be whole"),
        (GOOD.replace("C1X L1X", "C1X C1X"), "observation type must be known and new, got 'C1X'"),
        (GOOD.replace("C1X L1X", "Q1X L1X"), "observation type must be known and new, got 'Q1X'"),
        (GOOD.replace("E    4", "G    4"), "constellation must be new and one of GRECJSI, got 'G'"),
        (GOOD.replace("G    8", "     8"), "OBS TYPES must start with a constellation"),
        (NO_TYPES, "1 to 99 observation types, got"),
        (head_3(extra=line("G   12", "SYS / SCALE FACTOR")), "repair the line, got '12'"),
        (TWO.replace("# / TYPES OF OBSERV", "COMMENT"), "must have # / TYPES OF OBSERV"),
    ],
)
def test_faults_of_a_head_are_named(text, rule):
    with pytest.raises(BadInputError, match=rule):
        header(text)


def test_faults_of_a_head_of_messages_are_named():
    with pytest.raises(BadInputError, match="IONOSPHERIC CORR must hold four numbers"):
        header(MESSAGES.replace(END, OOPS + END), "navigation")
    with pytest.raises(BadInputError, match="must be a RINEX navigation file"):
        header(GOOD, "navigation")
