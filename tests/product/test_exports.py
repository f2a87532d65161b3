"""Estimates in the formats of other programs, read back by their rules."""

import sys
from dataclasses import fields, replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import fgnav
from fgnav.checks import BadInputError
from fgnav.cli import main
from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import from_euler
from fgnav.io.exports import exporter_named
from fgnav.io.exports.recorded import RecordedEstimate, load_estimate, save_estimate
from fgnav.io.exports.trajectories import _above_sea
from fgnav.io.flight.local_frame import place_of_n
from fgnav.types.estimate import Estimate, Verdict
from fgnav.types.flight import Flight

ORIGIN = Origin(latitude_rad=0.7, longitude_rad=-0.06, height_m=700.0)
START_GPS_S = 1_400_000_000.25  # 2024-05-17 16:53:20.25, GPS time


@pytest.fixture
def recorded():
    """Return what ``made`` makes."""
    return made()


def made():
    """Return an estimate with all that an estimate may state."""
    rng = np.random.default_rng(3)
    n = 5
    spread = rng.normal(size=(n, 3, 3))
    covariance = spread @ spread.swapaxes(1, 2)
    estimate = Estimate(
        method="m",
        t_s=np.arange(n) / 10,
        n_epochs=n + 1,
        R_nb=from_euler(*rng.uniform(-1, 1, (3, n))),
        attitude_covariance_rad2=covariance * 1e-6,
        p_n_m=rng.normal(0, 500, (n, 3)),
        position_covariance_m2=covariance,
        v_n_mps=rng.normal(0, 50, (n, 3)),
        velocity_covariance_m2ps2=covariance * 1e-2,
        angular_rate_b_radps=rng.normal(size=(n, 3)),
        accelerometer_bias_mps2=rng.normal(size=(n, 3)),
        accelerometer_bias_covariance_m2ps4=covariance,
        unobservable=("roll",),
        verdicts=(Verdict(sensor="v", from_s=0.1, until_s=0.3, ratio=9.0, limit=2.0, test="1 s"),),
        notes=("It rained.",),
    )
    return RecordedEstimate(
        flight="f & g", start_gps_s=START_GPS_S, origin=ORIGIN, estimate=estimate
    )


def test_a_recorded_estimate_comes_back_bit_by_bit(recorded, tmp_path):
    flight = Flight(name="f & g", start_gps_s=START_GPS_S, origin=ORIGIN)
    save_estimate(recorded.estimate, flight, tmp_path / "estimate.npz")
    back = load_estimate(tmp_path)
    assert (back.flight, back.start_gps_s, back.origin) == ("f & g", START_GPS_S, ORIGIN)
    for field in fields(Estimate):
        want, got = (getattr(one.estimate, field.name) for one in (recorded, back))
        np.testing.assert_array_equal(got, want, err_msg=field.name)


@pytest.mark.parametrize("content", [b"", b"t_s,roll_deg\n", b"PK\x03\x04 and no more"])
def test_what_is_no_estimate_is_one_line(content, tmp_path):
    (tmp_path / "estimate.npz").write_bytes(content)
    with pytest.raises(BadInputError, match=r"estimate\.npz: must be an estimate\.npz"):
        load_estimate(tmp_path)
    with pytest.raises(BadInputError, match="no such estimate"):
        load_estimate(tmp_path / "other.npz")


def test_tum_has_absolute_time_position_and_a_quaternion_of_the_attitude(recorded, tmp_path):
    exporter_named("tum")(recorded, tmp_path / "e.tum")
    head = (tmp_path / "e.tum").read_text().splitlines()[:3]
    assert "UTC, s since 1970-01-01" in head[0]
    assert f"latitude {np.degrees(ORIGIN.latitude_rad):.9f} deg" in head[0]
    assert "from body axes, forward, right, down" in head[1]
    table = np.loadtxt(tmp_path / "e.tum")
    unix_s = START_GPS_S + 315_964_800 - 18 + recorded.estimate.t_s
    np.testing.assert_allclose(table[:, 0], unix_s, rtol=0, atol=1e-6)
    np.testing.assert_allclose(table[:, 1:4], recorded.estimate.p_n_m, rtol=0, atol=1e-9)
    x, y, z, w = table[:, 4:].T
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2))
    np.testing.assert_allclose(np.degrees(yaw), recorded.estimate.euler_deg[:, 2], atol=1e-6)


def test_pos_has_rtklib_s_columns_in_gps_time(recorded, tmp_path):
    exporter_named("pos")(recorded, tmp_path / "e.pos")
    rows = [line.split() for line in (tmp_path / "e.pos").read_text().splitlines()[2:]]
    assert rows[1][:2] == ["2024/05/17", "16:53:20.350"]
    table = np.array([[float(x) for x in row[2:]] for row in rows])
    estimate = recorded.estimate
    np.testing.assert_allclose(table[:, :2], place_of_n(ORIGIN, estimate.p_n_m)[:, :2], atol=1e-9)
    assert set(table[:, 3]) == {5.0}
    # The trace of a covariance is the same in any axes; so are the norms of vectors.
    variance = np.trace(estimate.position_covariance_m2, axis1=1, axis2=2)
    np.testing.assert_allclose((table[:, 5:8] ** 2).sum(axis=1), variance, atol=1e-3)
    speed = np.linalg.norm(estimate.v_n_mps, axis=1)
    np.testing.assert_allclose(np.linalg.norm(table[:, 13:16], axis=1), speed, atol=1e-4)


@pytest.mark.parametrize("name", ["kml", "gpx"])
def test_maps_are_xml_with_a_point_per_position_in_utc(recorded, name, tmp_path):
    gap = recorded.estimate.p_n_m.copy()
    gap[2] = np.nan
    with_gap = replace(recorded, estimate=replace(recorded.estimate, p_n_m=gap))
    exporter_named(name)(with_gap, tmp_path / "e")
    tags = list(ET.parse(tmp_path / "e").iter())
    times = [one.text for one in tags if one.tag.endswith(("}when", "}time"))]
    assert len(times) == 4
    assert times[0] == "2024-05-17T16:53:02.250Z"  # 18 s behind GPS time


# Test points of the model's own program F477, National Geospatial-Intelligence Agency.
EGM96 = [
    [38.6281550, 269.7791550, -31.628],
    [-14.6212170, 305.0211140, -2.969],
    [46.8743190, 102.4487290, -43.575],
    [-23.6174460, 133.8747120, 15.871],
    [38.6254730, 359.9995000, 50.066],
]


def test_heights_on_maps_are_above_the_sea():
    pytest.importorskip("pyrtklib5")
    place = np.array(EGM96)
    above, is_known = _above_sea(place * [1.0, 1.0, 0.0])
    assert is_known
    np.testing.assert_allclose(-above[:, 2], place[:, 2], atol=1.5)  # a grid of a degree


@pytest.mark.parametrize(("name", "wanted"), [("kml", "clampToGround"), ("gpx", "desc>no heights")])
def test_without_a_geoid_maps_have_no_heights(recorded, name, wanted, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "pyrtklib5", None)
    exporter_named(name)(recorded, tmp_path / "e")
    text = (tmp_path / "e").read_text()
    assert wanted in text
    assert "<ele>" not in text


def test_a_table_in_csv_is_read_back_exactly(recorded, tmp_path):
    exporter_named("csv")(recorded, tmp_path / "e.csv")
    names = (tmp_path / "e.csv").read_text().splitlines()[0].split(",")
    back = dict(
        zip(names, np.loadtxt(tmp_path / "e.csv", delimiter=",", skiprows=1).T, strict=True)
    )
    estimate = recorded.estimate
    np.testing.assert_array_equal(back["p_e_m"], estimate.p_n_m[:, 1])
    np.testing.assert_array_equal(back["cov_p_nd_m2"], estimate.position_covariance_m2[:, 0, 2])
    np.testing.assert_array_equal(back["roll_deg"], estimate.euler_deg[:, 0])
    assert "latitude_deg" in names
    assert not [name for name in names if name.startswith("gyroscope")]


def test_pandas_xarray_and_parquet_hold_the_same(recorded, tmp_path):
    pandas = pytest.importorskip("pandas", reason="extra tables")
    pytest.importorskip("xarray", reason="extra tables")
    estimate = recorded.estimate
    frame = estimate.to_pandas()
    np.testing.assert_array_equal(frame["v_d_mps"], estimate.v_n_mps[:, 2])
    whole = estimate.to_xarray()
    assert whole["position_covariance_m2"].dims == ("t_s", "n", "n_")
    np.testing.assert_array_equal(whole["p_n_m"].sel(n="e"), estimate.p_n_m[:, 1])
    exporter_named("parquet")(recorded, tmp_path / "e.parquet")
    back = pandas.read_parquet(tmp_path / "e.parquet")
    np.testing.assert_array_equal(back["yaw_deg"], estimate.euler_deg[:, 2])


@pytest.mark.parametrize(
    ("module", "use"),
    [
        ("pandas", lambda one, _: one.estimate.to_pandas()),
        ("xarray", lambda one, _: one.estimate.to_xarray()),
        ("pyarrow", exporter_named("parquet")),
    ],
)
def test_an_extra_that_is_not_installed_is_named(recorded, module, use, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(BadInputError, match=rf"{module}; pip install 'fgnav\[tables\]'"):
        use(recorded, tmp_path / "e")


def test_a_format_without_positions_says_which_do_without(recorded, tmp_path):
    bare = replace(recorded, estimate=replace(recorded.estimate, p_n_m=None))
    for name in ("tum", "pos", "kml", "gpx"):
        with pytest.raises(BadInputError, match="csv and parquet do without"):
            exporter_named(name)(bare, tmp_path / "e")
    exporter_named("csv")(bare, tmp_path / "e")


def test_the_command_writes_beside_the_estimate_or_where_asked(recorded, tmp_path, capsys):
    flight = Flight(name="f", start_gps_s=START_GPS_S, origin=ORIGIN)
    fgnav.save_estimate(recorded.estimate, flight, tmp_path / "estimate.npz")
    assert main(["export", str(tmp_path), "--format", "kml"]) == 0
    assert main(["export", str(tmp_path), "--format", "csv", "--out", str(tmp_path / "x")]) == 0
    assert sorted(one.name for one in tmp_path.iterdir()) == ["estimate.kml", "estimate.npz", "x"]
    assert "m: 5 epochs in" in capsys.readouterr().out
    assert main(["export", str(tmp_path), "--format", "magic"]) == 2
    assert "format 'magic': not one of tum, pos" in capsys.readouterr().err
