import numpy as np
import pymap3d
import pytest
from numpy.testing import assert_allclose

from fgnav.checks import BadInputError
from fgnav.geometry.earth import EARTH_RATE_RADPS, Origin, geodetic

MADRID = Origin(latitude_rad=np.radians(40.33), longitude_rad=np.radians(-3.88), height_m=700.0)
MGAL = 1e-5  # m/s2


def at(latitude_deg, height_m=0.0):
    return Origin(latitude_rad=np.radians(latitude_deg), longitude_rad=0.3, height_m=height_m)


def test_local_frame_is_that_of_pymap3d():
    p_n_m = np.array([[1000.0, -2000.0, 300.0], [0, 0, 0]])
    e = MADRID.to_e(p_n_m)
    place = np.degrees(MADRID.latitude_rad), np.degrees(MADRID.longitude_rad), MADRID.height_m
    assert_allclose(e, np.stack(pymap3d.ned2ecef(*p_n_m.T, *place), axis=1), atol=1e-6)
    assert_allclose(MADRID.to_n(e), p_n_m, atol=1e-6)


def test_north_there_turns_away_from_north_at_the_origin():
    p_n_m = np.array([[0.0, 10_000.0, 0.0]])
    R = MADRID.local_ned(p_n_m)[0]
    place = geodetic(MADRID.to_e(p_n_m))[0]
    convergence = (place[1] - MADRID.longitude_rad) * np.sin(place[0])
    # Meridians meet at the pole: east of the origin, north leans to the west.
    assert_allclose(np.arctan2(R[1, 0], R[0, 0]), -convergence, rtol=1e-3)


@pytest.mark.parametrize(
    ("latitude_deg", "gravity"), [(0, 9.7803253359), (45, 9.8061977694), (90, 9.8321849379)]
)
def test_normal_gravity_has_its_published_values(latitude_deg, gravity):
    """WGS-84 normal gravity on the ellipsoid (NIMA TR8350.2, section 4)."""
    g = at(latitude_deg).gravity_n_mps2(np.zeros((1, 3)))[0]
    assert_allclose(g, [0, 0, gravity], atol=0.01 * MGAL)


def test_normal_gravity_falls_with_height_by_the_free_air_gradient():
    up = at(45).gravity_n_mps2(np.array([[0.0, 0, -1000.0]]))[0]
    down = at(45).gravity_n_mps2(np.zeros((1, 3)))[0]
    assert_allclose(down[2] - up[2], 308.6 * MGAL, atol=0.3 * MGAL)


def test_gravity_models_differ_by_micro_g():
    """-4.5, +5.1, -12 ug at latitudes 0, 40, 90 degrees, in one order or the other."""
    gaps = []
    for latitude_deg in (0, 40, 90):
        origin, here = at(latitude_deg), np.zeros((1, 3))
        normal, j2 = (origin.gravity_n_mps2(here, model)[0, 2] for model in ("wgs84-normal", "j2"))
        gaps.append((normal - j2) / 9.8e-6)
    assert_allclose(np.abs(gaps), [4.5, 5.1, 12], atol=0.3)


def test_constant_gravity_points_down_where_the_body_is():
    g = MADRID.gravity_n_mps2(np.array([[10_000.0, 0, 0]]), "constant")[0]
    assert_allclose(np.linalg.norm(g), 9.81)
    assert_allclose(g[0] / g[2], -10_000 / 6.36e6, rtol=0.01)


def test_unknown_gravity_model_is_named():
    with pytest.raises(BadInputError, match="gravity model: must be wgs84-normal, j2 or constant"):
        MADRID.gravity_n_mps2(np.zeros((1, 3)), "moon")


def test_earth_rate_lies_in_the_meridian():
    rate = MADRID.earth_rate_n_radps
    latitude = MADRID.latitude_rad
    expected = EARTH_RATE_RADPS * np.array([np.cos(latitude), 0, -np.sin(latitude)])
    assert_allclose(rate, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("field", "value", "text"),
    [
        ("latitude_rad", 2.0, "latitude: must be within"),
        ("longitude_rad", 7.0, "longitude: must be within"),
        ("height_m", np.nan, "height_m: must be within"),
    ],
)
def test_a_place_off_the_earth_is_refused(field, value, text):
    good = {"latitude_rad": 0.1, "longitude_rad": 0.1, "height_m": 0.0}
    with pytest.raises(BadInputError, match=text):
        Origin(**(good | {field: value}))
