"""Names and units of columns in the wild."""

import pytest

from fgnav.checks import BadInputError
from fgnav.io.importers.formats.text_columns import read_csv
from fgnav.io.importers.guess import guessed
from fgnav.io.importers.recording import cleaned
from fgnav.io.importers.settings import Settings

FORCE = "0.1,0.2,-9.8"
RATE = "0.1,0.2,0.3"


def table(tmp_path, head, rows):
    (tmp_path / "a.csv").write_text("\n".join([head, *rows]) + "\n")
    return guessed(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("head", "row", "units"),
    [
        (
            "time_s,acc_x_g,acc_y_g,acc_z_g,gyro_x_deg_s,gyro_y_deg_s,gyro_z_deg_s",
            f"0,0,1,{RATE}",
            {"s": "s", "mps2": "g", "radps": "deg/s"},
        ),
        (
            "time_ms,acc_x_mg,acc_y_mg,acc_z_mg,gyr_x_mdps,gyr_y_mdps,gyr_z_mdps",
            f"0,0,1000,{RATE}",
            {"s": "ms", "mps2": "mg", "radps": "mdeg/s"},
        ),
        (
            "TimeUS,ax_mps2,ay_mps2,az_mps2,wx_radps,wy_radps,wz_radps",
            f"{FORCE},{RATE}",
            {"s": "us", "mps2": "m/s2", "radps": "rad/s"},
        ),
        (
            "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
            "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]",
            f"{RATE},{FORCE}",
            {"s": "ns", "mps2": "m/s2", "radps": "rad/s"},
        ),
        (
            "timestamp_us,gyro_rad[0],gyro_rad[1],gyro_rad[2],"
            "accelerometer_m_s2[0],accelerometer_m_s2[1],accelerometer_m_s2[2]",
            f"{RATE},{FORCE}",
            {"s": "us", "mps2": "m/s2", "radps": "rad/s"},
        ),
        (
            "t_s,xacc [g],yacc [g],zacc [g],xgyro [°/s],ygyro [°/s],zgyro [°/s]",
            f"0,0,1,{RATE}",
            {"s": "s", "mps2": "g", "radps": "deg/s"},
        ),
    ],
)
def test_units_are_in_names(tmp_path, head, row, units):
    found = table(tmp_path, head, [f"{k},{row}" for k in range(5)])
    assert found.units == units
    assert "radps" not in found.unconfirmed
    assert set(found.columns) > {"fx_mps2", "wz_radps"}


@pytest.mark.parametrize(
    ("head", "row", "units", "down"),
    [
        ("t,lat,lon,alt,vn,ve,vu", "40,-4,700,1,2,3", {"s": "s"}, "-vu"),
        ("t,lat,lon,alt,vel_east,vel_north,vel_up", "40,-4,700,1,2,3", {"s": "s"}, "-vel_up"),
        ("t,lat,lon,alt,vN,vE,vD", "40,-4,700,1,2,3", {"s": "s"}, "vD"),
        (
            "t,lat_rad,lon_rad,h_m,vn_kmh,ve_kmh,vd_kmh",
            "0.7,-0.1,700,1,2,3",
            {"s": "s", "deg": "rad", "m": "m", "mps": "km/h"},
            "vd_kmh",
        ),
    ],
)
def test_velocities_point_down_in_their_unit(tmp_path, head, row, units, down):
    found = table(tmp_path, head, [f"{k},{row}" for k in range(5)])
    assert found.units == units
    assert found.columns["vd_mps"] == down
    assert found.columns["vn_mps"] != found.columns["ve_mps"]


@pytest.mark.parametrize(
    ("head", "row", "kinds"),
    [
        ("t,ax,ay,az,gx,gy,gz", f"{FORCE},{RATE}", ("radps",)),
        ("t,ax,ay,az", "0.1,0.1,0.2", ("mps2",)),
        ("t,lat,lon,alt", "0.7,0.1,700", ("deg",)),
        ("t,lat,lon,alt,vn,ve,vd", "400000000,-40000000,700000,1,2,3", ("mps",)),
        ("p,q,r,s", FORCE, ("columns",)),
    ],
)
def test_what_neither_name_nor_size_determines_is_marked(tmp_path, head, row, kinds):
    found = table(tmp_path, head, [f"{0.01 * k},{row}" for k in range(5)])
    assert found.unconfirmed == kinds


@pytest.mark.parametrize(
    ("head", "first", "clock"),
    [
        ("gps_time", "1430000000", "gps"),
        ("tow", "208800", "week"),
        ("unix_time", "1751968782", "utc"),
        ("time", "2025-07-08T10:00:0{k}+02:00", "utc"),
        ("time", "2025-07-08 10:00:0{k}", "gps"),
    ],
)
def test_clocks_are_in_names_and_dates(tmp_path, head, first, clock):
    rows = [
        (first.format(k=k) if "{" in first else str(int(first) + k)) + ",40,-4,700"
        for k in range(5)
    ]
    assert table(tmp_path, f"{head},lat,lon,alt", rows).clock == clock


@pytest.mark.parametrize(
    ("head", "row", "text"),
    [
        ("time,lat,lon,alt", "08.07.2025 10:00:00,40,-4,700", "a date and a time of day in one"),
        ("t,lat,lon,alt", "{k},4019.8,-352.8,700", "must be degrees or 1e-7 degrees"),
        ("t,ax,ay,b", "{k},0.1,0.2,-9.8", "of which fx_mps2, fy_mps2 are known"),
    ],
)
def test_what_is_half_known_is_refused(tmp_path, head, row, text):
    with pytest.raises(BadInputError, match=text):
        table(tmp_path, head, [row.format(k=k) for k in range(5)])


def test_zeros_before_a_first_fix_are_no_place(tmp_path):
    rows = [f"{k},0,0,0,9" for k in range(3)] + [f"{k},40,-4,700,9" for k in range(3, 6)]
    found = table(tmp_path, "t,lat,lon,alt,satellites", rows)
    recording = cleaned(read_csv(tmp_path / "a.csv", Settings(csv=(found,)), tmp_path))
    assert len(recording.tables["fixes"]["t_s"]) == 3
    assert {one.what: one.count for one in recording.losses} == {
        "a.csv column satellites": 6,
        "fixes row": 3,
    }
