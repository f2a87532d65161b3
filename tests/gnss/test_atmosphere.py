import numpy as np
import pyrtklib5 as rk

from fgnav.gnss.atmosphere import klobuchar_m, saastamoinen_m
from tests.gnss import rtklib
from tests.gnss.recordings import START_GPS_S

# Broadcast on 2020-06-25.
KLOBUCHAR = np.array(
    [4.6566e-9, 1.4901e-8, -5.9605e-8, -1.1921e-7, 8.1920e4, 9.8304e4, -6.5536e4, -5.2429e5]
)
PLACES = np.array([[0.86, 0.22, 666.0], [-0.3, -2.0, 10.0], [1.2, 3.0, 2500.0]])


def test_klobuchar_is_rtklibs():
    elevation, azimuth = np.radians([[10.0, 45.0, 88.0]] * 3), np.radians([[0.0, 130.0, 300.0]] * 3)
    t_s = np.array([0.0, 30_000.0, 52_000.0])
    ours = klobuchar_m(KLOBUCHAR, PLACES, elevation, azimuth, START_GPS_S + t_s)
    for k, j in np.ndindex(3, 3):
        theirs = rk.ionmodel(
            rtklib.time(t_s[k]),
            rtklib.array(KLOBUCHAR),
            rtklib.array(PLACES[k]),
            rtklib.array(np.array([azimuth[k, j], elevation[k, j]])),
        )
        assert abs(ours[k, j] - theirs) < 1e-6


def test_no_coefficients_mean_no_ionosphere():
    angle = np.full((3, 2), 0.7)
    assert (klobuchar_m(np.zeros(8), PLACES, angle, angle, np.zeros(3)) == 0).all()


def test_saastamoinen_is_rtklibs():
    elevation = np.radians([[10.0, 30.0, 90.0]] * 3)
    ours = saastamoinen_m(PLACES, elevation)
    for k, j in np.ndindex(3, 3):
        angles = rtklib.array(np.array([0.0, elevation[k, j]]))
        theirs = rk.tropmodel(rtklib.time(0.0), rtklib.array(PLACES[k]), angles, 0.7)
        assert abs(ours[k, j] - theirs) < 1e-4


def test_troposphere_ends_above_it():
    high = np.array([[0.7, 0.0, h] for h in (0.0, 20e3, 80e3)])
    zenith = saastamoinen_m(high, np.full((3, 1), np.pi / 2))[:, 0]
    assert zenith[0] > 2.3
    assert 0 < zenith[1] < 0.15
    assert abs(zenith[2]) < 0.001
