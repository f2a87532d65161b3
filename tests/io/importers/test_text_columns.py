import numpy as np
import pytest

from fgnav.io.flight.columns import PLACE
from fgnav.io.importers.formats.text_columns import read_csv
from fgnav.io.importers.settings import CsvTable, Settings
from tests.io.importers.helpers import imported, refused, whole_of

IMU = """\
[[csv]]
table = "imu"
header = false
units = { s = "ms", mps2 = "g", radps = "deg/s" }
[csv.columns]
t_s = 7
fx_mps2 = 1
fy_mps2 = -2
fz_mps2 = 3
wx_radps = 4
wy_radps = 5
wz_radps = 6
"""
FIXES = """\
[[csv]]
table = "fixes"
units = { s = "date", mps = "km/h" }
delimiter = ";"
clock = "gps"
[csv.columns]
t_s = "time"
latitude_deg = "lat"
longitude_deg = "lon"
height_m = "h"
vn_mps = "vn"
ve_mps = "ve"
vd_mps = "-vu"
"""
ROWS = "0.1,-0.2,1.0,90,0,-45,1000\n0.1,-0.2,1.0,90,0,-45,1010\n0.2,,1.0,90,0,-45,1020\n0.1,-0.2\n"
TRACK = """\
time;lat;lon;h;vn;ve;vu;note
2025-07-08 19:34:18.5;40;-4;700;36;0;3.6;start
2025-07-08 19:34:19.5;40.0001;-4;701;36;0;3.6;
"""


def test_columns_by_number_units_and_signs(tmp_path):
    file = tmp_path / "imu.csv"
    file.write_text("0,-45,990\n" + ROWS)  # a logger's first and last lines are cut
    whole, flight = imported(tmp_path, "csv", file, toml=IMU)
    np.testing.assert_allclose(flight.imu.t_s, [0, 0.01], atol=1e-9)
    np.testing.assert_allclose(flight.imu.f_b_mps2[0], [0.980665, 1.96133, 9.80665], rtol=1e-9)
    np.testing.assert_allclose(flight.imu.w_b_radps[0], [np.pi / 2, 0, -np.pi / 4], rtol=1e-9)
    lost = {loss.reason: loss.count for loss in whole.unused}
    assert lost == {
        "has another number of columns: the file is cut, or of mixed formats": 2,
        "a value is missing, or no instrument has it (imu.csv)": 1,
    }
    assert "clock of its own" in whole.missing["imu.clock_offset_s"]


def test_columns_by_name_dates_and_a_velocity_up(tmp_path):
    file = tmp_path / "track.csv"
    file.write_text(TRACK)
    _, flight = imported(tmp_path, "csv", file, toml=FIXES)
    # 2025-07-08 is day 2 of GPS week 2374.
    assert flight.start_gps_s == 2374 * 604800 + 2 * 86400 + 19 * 3600 + 34 * 60 + 18.5
    np.testing.assert_allclose(flight.fixes[0].t_s, [0, 1], atol=1e-6)
    np.testing.assert_allclose(flight.fixes[0].v_n_mps[0], [10, 0, -1], atol=1e-6)
    assert flight.fixes[0].p_n_m[1, 2] == pytest.approx(-1, abs=1e-3)
    assert flight.fixes[0].unstated == ("position", "velocity")


def test_a_start_dates_a_clock_of_its_own(tmp_path):
    file = tmp_path / "imu.csv"
    file.write_text(ROWS)
    toml = IMU.replace("header", 'start = "2025-07-08T00:00:00"\nheader')
    whole, flight = imported(tmp_path, "csv", file, toml=toml)
    assert flight.start_gps_s == 2374 * 604800 + 2 * 86400 + 1
    assert "imu.clock_offset_s" not in whole.missing


BOTH = """\
time,ax,ay,az,lat,lon,alt
1751000000.00,1,2,-9.75,,,
1751000000.01,1,2,-9.75,40,-4,700
1751000000.02,1,2,-9.75,,,
"""


def test_one_file_of_two_tables_with_empty_cells(tmp_path):
    (tmp_path / "log.csv").write_text(BOTH)
    tables = []
    for kind, columns in (
        ("imu", {"fx_mps2": "ax", "fy_mps2": "ay", "fz_mps2": "az"}),
        ("fixes", {"latitude_deg": "lat", "longitude_deg": "lon", "height_m": "alt"}),
    ):
        tables += ["[[csv]]", f'table = "{kind}"', 'clock = "utc"', "[csv.columns]", 't_s = "time"']
        tables += [f'{name} = "{column}"' for name, column in columns.items()]
    whole, flight = imported(tmp_path, "csv", tmp_path / "log.csv", toml="\n".join(tables))
    assert (len(flight.imu.t_s), len(flight.fixes[0].t_s)) == (3, 1)
    assert flight.start_gps_s == pytest.approx(1751000000.01 - 315964800 + 18, abs=1e-6)
    np.testing.assert_allclose(flight.imu.t_s, [-0.01, 0, 0.01], atol=1e-6)
    assert {loss.what: loss.count for loss in whole.unused} == {"fixes row": 2}


def test_cells_that_are_none_and_a_cut_last_line_are_counted(tmp_path):
    rows = [f"2025-07-08T10:00:0{k}Z,40,-4,{'n/a' if k == 3 else 700}" for k in range(6)]
    rows[1] = rows[1].replace("00:01", "00:61")
    (tmp_path / "a.csv").write_bytes(
        "\n".join([",".join(["t [°]", *PLACE]), *rows]).encode("cp1252")
    )
    columns = dict(zip(("t_s", *PLACE), ("t [°]", *PLACE), strict=True))
    table = CsvTable(table="fixes", columns=columns, units={"s": "date"})
    whole = whole_of([read_csv(tmp_path / "a.csv", Settings(csv=(table,)), tmp_path)], Settings())
    assert whole.flight.fixes[0].t_s.tolist() == [0, 2, 4]
    assert {one.what: one.count for one in whole.unused} == {"a.csv last line": 1, "fixes row": 2}


@pytest.mark.parametrize(
    ("rows", "toml", "text"),
    [
        (ROWS.replace("90", "x"), IMU, "row 1 of the numbers: column 4 must be a number, got 'x'"),
        (ROWS, IMU.replace("= 7", "= 9"), "column 9 of t_s: the file has 7 columns without names"),
        ("", IMU, "holds no row of numbers"),
        (",,,,,,1\n", IMU, "imu: no row is usable of 1"),
        (ROWS, IMU.replace("fx_m", "fq_m"), "unknown column 'fq_mps2'; the nearest known one"),
        (ROWS, IMU.replace("t_s = 7\n", ""), "csv[0].columns: column 't_s' is missing; name"),
        (ROWS, IMU.replace('"g"', '"stone"'), "mps2: must be one of m/s2, mg, g, got 'stone'"),
        (ROWS, IMU + IMU, "needs a [[csv]] for each of its tables in --settings, has imu, imu"),
        (
            ROWS,
            '[[csv]]\ntable = "barometer"\nheader = false\ncolumns = {t_s = 7, height_m = 1}',
            "barometer: state its noise in [barometer] of --settings",
        ),
        (ROWS, "", "imu.csv: needs a [[csv]] for each of its tables in --settings, has none"),
    ],
)
def test_what_is_wrong_is_one_line(tmp_path, capsys, rows, toml, text):
    (tmp_path / "imu.csv").write_text(rows)
    (tmp_path / "s.toml").write_text(toml)
    words = ("--settings", str(tmp_path / "s.toml"))
    assert text in refused(capsys, tmp_path, tmp_path / "imu.csv", *words)
