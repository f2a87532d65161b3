"""Names and units of columns in the wild."""

import pytest

from fgnav.checks import BadInputError
from fgnav.io.importers.formats.text_columns import read_csv
from fgnav.io.importers.guess import guess_table
from fgnav.io.importers.recording import clean_rows
from fgnav.io.importers.settings import Settings

FORCE, RATE = "0.1,0.2,-9.8", "0.1,0.2,0.3"


def table(tmp_path, head, row, times="01234"):
    """Return what is guessed of five rows; ``{t}`` in a row is its time, which else goes before."""
    rows = [row.format(t=t) if "{t}" in row else f"{t},{row}" for t in times]
    (tmp_path / "a.csv").write_text("\n".join([head, *rows]) + "\n")
    return guess_table(tmp_path / "a.csv")


def units(words):
    return dict(zip(("s", "mps2", "radps"), words.split(), strict=True))


EUROC = "#timestamp [ns]," + ",".join(
    [f"w_RS_S_{axis} [rad s^-1]" for axis in "xyz"] + [f"a_RS_S_{axis} [m s^-2]" for axis in "xyz"]
)
PX4 = "timestamp_us," + ",".join(
    f"{name}[{k}]" for name in ("gyro_rad", "accelerometer_m_s2") for k in range(3)
)


@pytest.mark.parametrize(
    ("head", "row", "want"),
    [
        ("time_s,acc_{}_g,gyro_{}_deg_s", f"0,0,1,{RATE}", "s g deg/s"),
        ("time_ms,acc_{}_mg,gyr_{}_mdps", f"0,0,1000,{RATE}", "ms mg mdeg/s"),
        ("TimeUS,a{}_mps2,w{}_radps", f"{FORCE},{RATE}", "us m/s2 rad/s"),
        ("t_s,{}acc [g],{}gyro [°/s]", f"0,0,1,{RATE}", "s g deg/s"),
        (EUROC, f"{RATE},{FORCE}", "ns m/s2 rad/s"),
        (PX4, f"{RATE},{FORCE}", "us m/s2 rad/s"),
    ],
)
def test_units_are_in_names(tmp_path, head, row, want):
    """A name with {} stands for three, of x, y and z."""
    names = [name.format(a) for name in head.split(",") for a in ("xyz" if "{}" in name else "t")]
    found = table(tmp_path, ",".join(names), row)
    assert found.units == units(want)
    assert "radps" not in found.unconfirmed
    assert set(found.columns) > {"fx_mps2", "wz_radps"}


@pytest.mark.parametrize(
    ("velocity", "down"),
    [
        ("vn,ve,vu", "-vu"),
        ("vel_east,vel_north,vel_up", "-vel_up"),
        ("vN,vE,vD", "vD"),
        ("vn_kmh,ve_kmh,vd_kmh", "vd_kmh"),
    ],
)
def test_velocities_point_down_in_their_unit(tmp_path, velocity, down):
    found = table(tmp_path, f"t,lat_rad,lon_rad,h_m,{velocity}", "0.7,-0.1,700,1,2,3")
    speed = {"mps": "km/h"} if "kmh" in velocity else {}
    assert found.units == {"s": "s", "deg": "rad", "m": "m", **speed}
    assert found.columns["vd_mps"] == down
    assert "n" in found.columns["vn_mps"].lower()


@pytest.mark.parametrize(
    ("head", "row", "kinds"),
    [
        ("t,ax,ay,az,gx,gy,gz", f"{FORCE},{RATE}", ("radps",)),
        ("t,ax,ay,az", "0.1,0.1,0.2", ("mps2",)),
        ("t,lat,lon,alt", "0.7,0.1,700", ("deg",)),
        ("t,lat,lon,alt,vn,ve,vd", "400000000,-40000000,700000,1,2,3", ("mps",)),
        ("t,lat,lon,alt_msl", "40,-4,700", ("height",)),
        ("p,q,r,s", FORCE, ("columns",)),
    ],
)
def test_what_neither_name_nor_size_determines_is_marked(tmp_path, head, row, kinds):
    times = [f"0.0{k}" for k in range(5)]
    assert table(tmp_path, head, row, times).unconfirmed == kinds


@pytest.mark.parametrize(
    ("head", "first", "clock"),
    [
        ("gps_time", "143000000", "gps"),
        ("tow", "20880", "week"),
        ("unix_time", "175196875", "utc"),
        ("time", "2025-07-08T10:00:0{t}+02:00", "utc"),
        ("time", "2025-07-08 10:00:0{t}", "gps"),
    ],
)
def test_clocks_are_in_names_and_dates(tmp_path, head, first, clock):
    first = first if "{t}" in first else first + "{t}"
    found = table(tmp_path, f"{head},lat,lon,alt", f"{first},40,-4,700")
    assert found.clock == clock
    if "+02:00" in first:
        recording = read_csv(tmp_path / "a.csv", Settings(csv=(found,)), tmp_path)
        assert recording.gps_start_s == 2374 * 604_800 + 208_818 - 7200


@pytest.mark.parametrize(
    ("head", "row", "text"),
    [
        ("time,lat,lon,alt", "08.07.2025 10:00:00,40,-4,{t}", "a date and a time of day in one"),
        ("t,lat,lon,alt", "{t},4019.8,-352.8,700", "must be degrees or 1e-7 degrees"),
        ("t,lat,lon,ew,alt", "{t},40,4,W,700", "column 'ew' has hemispheres"),
        ("t,ax,ay,b", "{t},0.1,0.2,-9.8", "of which fx_mps2, fy_mps2 are known"),
    ],
)
def test_what_is_half_known_is_refused(tmp_path, head, row, text):
    with pytest.raises(BadInputError, match=text):
        table(tmp_path, head, row)


@pytest.mark.parametrize(
    ("head", "row", "want"),
    [
        ("t,latency,lat,lon,heading,hdop,alt", "9,40,-4,350,1,700", "lat lon alt"),
        (
            "t,b_gyr_x,gyr_bias_x,gyr_x,gyr_y,gyr_z,ax,ay,az",
            "0,0,1,2,3,0,0,9.8",
            "gyr_x gyr_y gyr_z",
        ),
        ("t,lat,lon,alt,sdn,sde,sdu", "40,-4,700,.1,.1,.2", "sdn sde sdu"),
    ],
)
def test_a_name_is_more_than_how_it_begins(tmp_path, head, row, want):
    columns = table(tmp_path, head, row).columns.values()
    assert set(want.split()) <= set(columns)
    assert not {"latency", "heading", "hdop", "gyr_bias_x"} & set(columns)


@pytest.mark.parametrize(("first", "is_open"), [(1.41e9, True), (1.75e9, False)])
def test_seconds_that_may_be_of_gps_are_in_doubt(tmp_path, first, is_open):
    found = table(tmp_path, "t,lat,lon,alt", "40,-4,700", [f"{first + k:.0f}" for k in range(5)])
    assert (found.clock, "clock" in found.unconfirmed) == ("utc", is_open)


@pytest.mark.parametrize(("step_ms", "is_open"), [(10, False), (200, True)])
def test_a_step_that_two_units_of_time_explain_is_in_doubt(tmp_path, step_ms, is_open):
    found = table(tmp_path, "t,ax,ay,az", FORCE, [str(step_ms * k) for k in range(5)])
    assert ("s" in found.unconfirmed) == is_open


def test_one_fall_of_a_long_row_of_times_is_a_wrap(tmp_path):
    times = [str((604_790 + k) % 604_800) for k in range(30)]
    assert table(tmp_path, "tow,lat,lon,alt", "40,-4,700", times).columns["t_s"] == "tow"


def test_zeros_before_a_first_fix_are_no_place(tmp_path):
    rows = [f"{k},0,0,0,9" for k in range(3)] + [f"{k},40,-4,700,9" for k in range(3, 6)]
    (tmp_path / "a.csv").write_text("\n".join(["t,lat,lon,alt,satellites", *rows]) + "\n")
    settings = Settings(csv=(guess_table(tmp_path / "a.csv"),))
    recording = clean_rows(read_csv(tmp_path / "a.csv", settings, tmp_path))
    assert len(recording.tables["fixes"]["t_s"]) == 3
    unused = {one.what: one.count for one in recording.unused}
    assert unused == {"a.csv column satellites": 6, "fixes row": 3}
