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


def same(got, want):
    assert got.links == want.links
    assert_array_equal(got.from_s, want.from_s)
    assert_array_equal(got.cycles, want.cycles)


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
    same(read_integers(tmp_path / "integers.csv"), written)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"line 1: columns must be antenna,satellite,signal,from_s,cycles, got ''"),
        ("antenna,cycles\n", r"line 1: columns must be antenna,.*, got 'antenna,cycles'"),
        (HEAD + "a1,G05,1C,0.0\n", r"line 2: must have 5 columns, got 4"),
        (HEAD + "a1,G05,1C,0.0,1\n\n", r"line 3: must have 5 columns, got 0"),
        (HEAD + "a1,G05,1C,soon,1\n", r"line 2: from_s must be a finite number, got 'soon'"),
        (HEAD + "a1,G05,1C,inf,1\n", r"line 2: from_s must be a finite number, got 'inf'"),
        (HEAD + "a1,G05,1C,0.0,many\n", r"line 2: cycles must be a finite number, got 'many'"),
        (HEAD + "a1,G05,1C,0.0,1.25\n", r"cycles: must be whole or halves, got 1.25 at row 0"),
        (
            HEAD + "a1,G05,1C,5.0,1\na1,G05,1C,5.0,2\n",
            r"from_s: of a1 G05 1C must increase, got 5 after 5",
        ),
    ],
)
def test_bad_tables_are_refused_in_one_line(tmp_path, text, message):
    path = tmp_path / "i.csv"
    path.write_text(text)
    with pytest.raises(BadInputError, match=message) as caught:
        read_integers(path)
    assert str(caught.value).startswith(str(path))
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
