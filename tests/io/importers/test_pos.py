import numpy as np
import pytest

from fgnav.geometry.earth import ecef
from tests.io.importers.helpers import imported, refused

HEAD = "%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)\n"
ROW = "2374 243258.500 40.0 -4.0 700.0 1 21 0.0100 0.0200 0.0000\n"


def test_the_car_comes_out_as_its_numbers_are(shared, tmp_path):
    file = shared / "flights" / "drive_0708" / "gnss_1934_sf.pos"
    _, flight = imported(tmp_path, "pos", file)
    rows = [line.split() for line in file.read_text().splitlines()[1:]]
    assert len(flight.fixes[0].t_s) == len(rows)
    # 2025-07-08 is day 2 of GPS week 2374; the first row is at 19:34:18.499.
    day_s = 19 * 3600 + 34 * 60 + 18.499
    assert flight.start_gps_s == pytest.approx(2374 * 604800 + 2 * 86400 + day_s, abs=1e-6)
    place = np.array([row[2:5] for row in rows], float)
    p_e_m = ecef(np.radians(place[:, 0]), np.radians(place[:, 1]), place[:, 2])
    np.testing.assert_allclose(flight.origin.to_e(flight.fixes[0].p_n_m), p_e_m, rtol=0, atol=1e-4)
    speed = np.linalg.norm(np.array([row[15:18] for row in rows], float), axis=1)
    np.testing.assert_allclose(np.linalg.norm(flight.fixes[0].v_n_mps, axis=1), speed, atol=1e-6)
    east = np.array([row[8] for row in rows], float)
    np.testing.assert_allclose(flight.fixes[0].position_sigma_m[:, 1], east, atol=1e-9)


def test_weeks_and_ecef_are_read_too(tmp_path):
    (tmp_path / "a.pos").write_text(HEAD + ROW)
    _, geodetic = imported(tmp_path, "pos", tmp_path / "a.pos")
    place = ecef(*np.radians([[40.0], [-4.0]]), np.array([700.0]))[0]
    x, y, z = (f"{one:.4f}" for one in place)
    head = HEAD.replace("latitude(deg) longitude(deg)  height(m)", "x-ecef(m) y-ecef(m) z-ecef(m)")
    (tmp_path / "b.pos").write_text(head + ROW.replace("40.0 -4.0 700.0", f"{x} {y} {z}"))
    (tmp_path / "b").mkdir()
    _, earth = imported(tmp_path / "b", "pos", tmp_path / "b.pos")
    assert earth.start_gps_s == geodetic.start_gps_s == 2374 * 604800 + 243258.5
    np.testing.assert_allclose(earth.origin.p_e_m, geodetic.origin.p_e_m, rtol=0, atol=1e-3)
    np.testing.assert_allclose(geodetic.fixes[0].position_sigma_m, [[0.01, 0.02, 5e-5]])


MINUTES = HEAD.replace("latitude(deg) longitude(deg)", "latitude(d'\") longitude(d'\")")


@pytest.mark.parametrize(
    ("text", "unused"),
    [
        (HEAD + ROW + ROW[:30] + "\n", {"a.pos line": 1, "a.pos columns Q, ns": 1}),
        (HEAD + ROW + ROW.rstrip(), {"a.pos last line": 1, "a.pos columns Q, ns": 1}),
        (
            HEAD + ROW + ROW.replace("700.0", "-nan(ind)"),
            {"fixes row": 1, "a.pos columns Q, ns": 2},
        ),
        ((HEAD + ROW).replace(" ", ";"), {"a.pos columns Q, ns": 1}),
        ((HEAD + ROW).replace(" ", ","), {"a.pos columns Q, ns": 1}),
        (HEAD + ROW.replace(" 21 ", " -1.#IND "), {"a.pos columns Q, ns": 1}),
        (MINUTES + ROW.replace("40.0 -4.0", "39 59 60.0 -3 59 60.0"), {"a.pos columns Q, ns": 1}),
        ("\ufeff" + HEAD + ROW.rstrip() + "\x1a", {"a.pos columns Q, ns": 1}),
    ],
)
def test_separators_minutes_and_cut_rows(tmp_path, text, unused):
    (tmp_path / "a.pos").write_text(text)
    whole, flight = imported(tmp_path, "pos", tmp_path / "a.pos")
    assert {one.what: one.count for one in whole.unused} == unused
    assert flight.start_gps_s == 2374 * 604800 + 243258.5
    np.testing.assert_allclose(np.degrees(flight.origin.latitude_rad), 40, rtol=1e-12)
    np.testing.assert_allclose(np.degrees(flight.origin.longitude_rad), -4, rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("", "must have RTKLIB's line of column names"),
        (HEAD, "holds no solution"),
        (HEAD + ROW[:30] + "\n", "rows must have 10 columns, got 5"),
        (HEAD + ROW.replace("-4.0", "-4.x"), "no row is usable of 1"),
        (HEAD + ROW.replace("2374 ", "2374/7/4x "), "dates must be like 2025-07-08 19:34:18.5"),
        (HEAD.replace("latitude(deg)", "e-baseline(m)") + ROW, "set out-solformat to llh or xyz"),
    ],
)
def test_what_is_wrong_is_one_line(tmp_path, capsys, text, rule):
    (tmp_path / "a.pos").write_text(text)
    assert rule in refused(capsys, tmp_path, tmp_path / "a.pos", "--format", "pos")
