"""True integers as a table: exact both ways, strict when read."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fgnav.checks import BadInputError
from fgnav.io.flight.folder import load_flight, save_flight
from fgnav.io.flight.integers import read_integers, write_integers
from fgnav.types.flight import LinkIntegers
from tests.io.flights import whole_flight

HEAD = "antenna,satellite,signal,from_s,cycles\n"


@pytest.mark.parametrize("name", ["a1", "näs/1", 'left, "upper"'])
def test_integers_come_back_to_the_last_bit(tmp_path, name):
    written = LinkIntegers(
        antennas=(name,) * 3,
        satellites=("G05", "G05", "E07"),
        signals=("1C", "1C", "5X"),
        from_s=np.array([-0.1, 1 / 3, 1e5 + 1e-9]),
        cycles=np.array([0, -(2.0**53) + 1, 1234567.5]),
    )
    write_integers(tmp_path / "integers.csv", written)
    got = read_integers(tmp_path / "integers.csv")
    assert got.links == written.links
    assert_array_equal(got.from_s, written.from_s)
    assert_array_equal(got.cycles, written.cycles)


ROW = "a1,G05,1C,0.0,1\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"line 1: columns must be antenna,satellite,signal,from_s,cycles, got ''"),
        (HEAD + ROW[:-3] + "\n", r"line 2: must have 5 columns, got 4"),
        (HEAD + ROW + "\n", r"line 3: must have 5 columns, got 0"),
        (HEAD + ROW.replace("0.0", "soon"), r"line 2: from_s must be a finite number, got 'soon'"),
        (HEAD + ROW.replace("0.0", "inf"), r"line 2: from_s must be a finite number, got 'inf'"),
        (HEAD + ROW.replace(",1\n", ",x\n"), r"line 2: cycles must be a finite number, got 'x'"),
        (HEAD + ROW.replace(",1\n", ",1.25\n"), r"cycles: must be whole or halves, got 1.25 at"),
        (HEAD + ROW * 2, r"from_s: of a1 G05 1C must increase, got 0 after 0"),
        (HEAD + ROW.replace("a1", "\x1b[31m"), r"line 2: must be plain text"),
        (HEAD + ROW[:-1], "must end with a line end, the last line is cut"),
    ],
)
def test_bad_tables_are_refused_in_one_line(tmp_path, text, message):
    (tmp_path / "i.csv").write_text(text)
    with pytest.raises(BadInputError, match=message) as caught:
        read_integers(tmp_path / "i.csv")
    assert str(caught.value).startswith(str(tmp_path / "i.csv"))
    assert "\n" not in str(caught.value)


def test_missing_file_and_unknown_antenna_are_named(tmp_path):
    save_flight(whole_flight(np.random.default_rng(1)), tmp_path / "flight")
    path = tmp_path / "flight" / "integers.csv"
    path.write_text(path.read_text().replace("näs/1", "a9"))
    with pytest.raises(BadInputError, match=r"true integers antenna: 'a9' is not one of \['a1'"):
        load_flight(tmp_path / "flight")
    path.unlink()
    with pytest.raises(BadInputError, match=r"integers.csv"):
        load_flight(tmp_path / "flight")
