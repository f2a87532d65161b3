"""Time series as CSV."""

import bz2
import gzip
import lzma

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.tables import increasing, read_table, write_table

GOOD = "t_s,x,y\n0,1,2\n0.5,3,4\n1,5,6\n"


def read(tmp_path, text, optional=(("u", "v"),)):
    path = tmp_path / "a.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_table(path, ("t_s", "x", "y"), optional)


@pytest.mark.parametrize("spelling", ["{}", "\ufeff{}"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_columns_come_back_by_name_in_any_order(tmp_path, spelling, line_end):
    got = read(tmp_path, spelling.format("y,t_s,x\n2,0,1\n4,0.5,3\n".replace("\n", line_end)))
    assert {name: column.tolist() for name, column in got.items()} == {
        "t_s": [0, 0.5],
        "x": [1, 3],
        "y": [2, 4],
    }


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("", "a.csv: must be a table, the file is empty"),
        ("t_s,x,y\n", "must hold a row below the column names, has none"),
        ("t_s,x,z\n0,1,2\n", "line 1: unknown column 'z'; the nearest known one is"),
        ("t_s,x,yy\n0,1,2\n", "line 1: unknown column 'yy'; the nearest known one is 'y'"),
        ("t_s,x,x\n0,1,2\n", "line 1: column 'x' must appear once"),
        ("t_s,x\n0,1\n", "line 1: column 'y' is missing"),
        ("t_s,x,y,u\n0,1,2,3\n", "line 1: column 'v' is missing"),
        (GOOD.replace("3,4", "3"), "line 3: must have 3 columns, got 2"),
        (GOOD.replace("3,4", "3,4,5"), "line 3: must have 3 columns, got 4"),
        (GOOD.replace("0.5,3,4\n", "\n"), "line 3: must have 3 columns, got 0"),
        (GOOD + "\n", "line 5: must have 3 columns, got 0"),
        (GOOD.replace("3,4", "three,4"), "line 3: x must be a number, got 'three'"),
        (GOOD.replace("3,4", ",4"), "line 3: x must be a number, got ''"),
        (GOOD.replace("3,4", "3,nan"), "line 3: y must be finite, got nan"),
        (GOOD.replace("3,4", "3,inf"), "line 3: y must be finite, got inf"),
        (GOOD.replace("0.5", "1.5"), "line 4: t_s must increase, got 1 after 1.5"),
        (GOOD.replace("0.5", "0"), "line 3: t_s must increase, got 0 after 0"),
        (b"t_s,x,y\n0,1,\xff\n", "line 2: must hold numbers and commas, got byte 0xff"),
        ("t_s,x,y\n0,1,2\n1,2\r,3\n", "line 3: must hold numbers and commas, got byte 0x0d"),
        ("t_s,x,y\n0,1,2\n1,2,3\x0b\n", "line 3: must hold numbers and commas, got byte 0x0b"),
        ("t_s,x,y\n0,1,2\n1,2,3", "must end with a line end, the last line is cut"),
        ("t_s,x,y\n0,1,2\n1e300,2,3\n", "line 3: t_s must be within 1e.10 of 0, got 1e.300"),
        ("t_s,x,y\n0,1_0,2\n", "line 2: x must be a number, got '1_0'"),
        ("t_s,x,y\r0,1,2\r1,2,3\r\n", "line 1: unknown column 'y.*'"),
        ("t_s," + "x" * 200 + "\n0,1\n", "unknown column 'x{76}"),
        ("x" * 5000 + "\n", "line 1: must hold the names of columns"),
    ],
)
def test_faults_are_named_with_line_rule_and_value(tmp_path, text, rule):
    with pytest.raises(BadInputError, match=rule) as caught:
        read(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_written_table_is_read_back(tmp_path):
    rng = np.random.default_rng(1)
    rows = 45_000  # more than are written at once
    columns = {"t_s": np.arange(rows) / 100, "x": rng.normal(size=rows), "y": rng.normal(size=rows)}
    write_table(tmp_path / "a.csv", columns, {"t_s": "%.8f", "x": "%.6f"})
    got = read_table(tmp_path / "a.csv", tuple(columns))
    np.testing.assert_allclose(got["x"], columns["x"], rtol=0, atol=0.5e-6)
    np.testing.assert_allclose(got["y"], columns["y"], rtol=1e-11)


@pytest.mark.parametrize("module", [gzip, bz2, lzma])
def test_a_packed_table_is_read(tmp_path, module):
    assert read(tmp_path, module.compress(GOOD.encode()))["y"].tolist() == [2, 4, 6]


def test_the_longest_increasing_row_is_that_of_all_subsets():
    rng = np.random.default_rng(5)
    for t in rng.integers(0, 9, (60, 8)):
        rows = (np.array(list(np.binary_repr(k, 8))) == "1" for k in range(256))
        most = max(int(row.sum()) for row in rows if (np.diff(t[row]) > 0).all())
        kept = increasing(t)
        assert (np.diff(t[kept]) > 0).all()
        assert kept.sum() == most


@pytest.mark.parametrize(
    ("t", "kept"),
    [
        ([0, 1, 900, 3, 4], [0, 1, 3, 4]),  # one damaged time
        ([0, 1, 2, 0.5, 1.5, 2.5, 3.5], [0, 0.5, 1.5, 2.5, 3.5]),
        ([0, 1, 2, 1.5], [0, 1, 2]),
    ],
)
def test_a_wrong_time_costs_itself_alone(t, kept):
    assert np.array(t)[increasing(np.array(t))].tolist() == kept
