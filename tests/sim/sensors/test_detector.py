"""Currents of the beacon, turned back into the line of sight they came from."""

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fgnav.photodetector import line_of_sight, spot_fraction
from fgnav_sim.motion import Motion, Sine, Straight
from fgnav_sim.scenario import OcclusionTable, OpticsTable, PhotodetectorTable, Place, Scenario
from fgnav_sim.sensors.detector import calibration, saturated, share_within, watch
from fgnav_sim.simulate import simulate

BEACON = Place(latitude_deg=40.36, longitude_deg=-3.88, height_m=700.0)  # 3.3 km north
TOWARD = Scenario(
    duration_s=20.0,
    motion=Motion(
        path=Straight(speed_mps=100.0),
        roll=Sine(amplitude_deg=30.0),
        pitch=Sine(amplitude_deg=6.0),
        yaw=Sine(amplitude_deg=6.0, rate_radps=2.0),
    ),
)


def true_direction_b(sensor, scenario, t_s):
    state = scenario.motion(t_s)
    beacon_n_m = scenario.origin.frame.to_n(sensor.landmark.frame.p_e_m[None])[0]
    sight_n_m = beacon_n_m - state.p_n_m - state.R_nb @ np.array(sensor.position_b_m)
    sight_b_m = np.einsum("nji,nj->ni", state.R_nb, sight_n_m)
    return sight_b_m / np.linalg.norm(sight_b_m, axis=1, keepdims=True)


def test_the_reconstruction_returns_the_true_line_of_sight():
    sensor = PhotodetectorTable(landmark=BEACON, range_m=1e4, line_of_sight_noise_rad=1e-12)
    seen = line_of_sight(watch(sensor, TOWARD, rng=np.random.default_rng(1)))
    assert len(seen.t_s) == 200
    assert not seen.unused
    error = seen.e_b - true_direction_b(sensor, TOWARD, seen.t_s)
    assert np.abs(error).max() < 1e-10  # rad


def test_noise_of_the_line_of_sight_has_the_size_asked_for():
    steady = Scenario(duration_s=100.0, motion=Motion(path=Straight(speed_mps=0.0)))
    beacon = Place(latitude_deg=40.34, longitude_deg=-3.88, height_m=700.0)
    sensor = PhotodetectorTable(landmark=beacon, rate_hz=50.0, line_of_sight_noise_rad=1e-3)
    seen = line_of_sight(watch(sensor, steady, rng=np.random.default_rng(1)))
    error = seen.e_b - true_direction_b(sensor, steady, seen.t_s)
    assert np.std(error[:, 1:], axis=0) == pytest.approx([1e-3, 1e-3], rel=0.05)
    assert np.abs(error[:, 1:].mean(axis=0)).max() < 1e-4


def test_a_misaligned_detector_sees_the_beacon_turned_by_one_rotation():
    sensor = PhotodetectorTable(landmark=BEACON, range_m=1e4, line_of_sight_noise_rad=1e-12)
    turned = msgspec.structs.replace(sensor, misalignment_rad=2e-3)
    turns = []
    for seed in range(200):
        seen = line_of_sight(watch(turned, TOWARD, rng=np.random.default_rng(seed)))
        true_b = true_direction_b(turned, TOWARD, seen.t_s)
        turn, off = Rotation.align_vectors(true_b, seen.e_b)
        assert off < 1e-6
        turns.append(turn.as_rotvec())
    # 200 draws of three angles: their standard deviation is known to 3 %.
    assert np.std(turns) == pytest.approx(2e-3, rel=0.1)


def test_the_beacon_is_seen_within_range_and_field_of_view_only():
    sensor = PhotodetectorTable(landmark=BEACON, range_m=2500.0, field_of_view_deg=4.0)
    photodetector = watch(sensor, TOWARD, rng=np.random.default_rng(1))
    t_s = TOWARD.epochs_s(sensor.rate_hz)
    state = TOWARD.motion(t_s)
    place_n_m = state.p_n_m + state.R_nb @ np.array(sensor.position_b_m)
    near = np.linalg.norm(photodetector.landmark_n_m - place_n_m, axis=1) <= 2500.0
    ahead = true_direction_b(sensor, TOWARD, t_s)[:, 0] >= np.cos(np.radians(4.0))
    assert 0 < len(photodetector.t_s) < len(t_s)
    assert np.array_equal(photodetector.t_s, t_s[near & ahead])


STILL = Scenario(duration_s=100.0, motion=Motion(path=Straight(speed_mps=0.0)))
DARK = OpticsTable(noise_a=1e-20, threshold_sigmas=0.0)


def ahead(distance_deg, **settings):
    """Return a detector that looks at a beacon so many degrees of latitude north."""
    beacon = Place(latitude_deg=40.33 + distance_deg, longitude_deg=-3.88, height_m=700.0)
    return PhotodetectorTable(landmark=beacon, range_m=1e5, rate_hz=50.0, **settings)


def test_currents_are_what_the_irradiance_makes_of_them():
    for distance_deg in (0.005, 0.02):
        sensor = ahead(distance_deg, optics=DARK)
        seen = watch(sensor, STILL, rng=np.random.default_rng(1))
        distance_m = np.linalg.norm(seen.landmark_n_m - np.array(sensor.position_b_m))
        expected_a = 0.5 * 1000.0 / distance_m**2 * np.pi * 0.01**2
        assert seen.currents.sum(axis=1) == pytest.approx(expected_a, rel=1e-4)
    hazy = ahead(0.02, optics=OpticsTable(noise_a=1e-20, attenuation_per_m=1e-3))
    dimmed = watch(hazy, STILL, rng=np.random.default_rng(1)).currents.sum(axis=1)
    assert dimmed == pytest.approx(expected_a * np.exp(-1e-3 * distance_m), rel=1e-4)


def test_with_optics_the_direction_is_as_good_as_the_light_is_strong():
    optics = OpticsTable(noise_a=2e-11)
    slope = spot_fraction(calibration(), np.array([1e-3]))[0] / 1e-3
    for distance_deg in (0.01, 0.03):
        sensor = ahead(distance_deg, optics=optics)
        photodetector = watch(sensor, STILL, rng=np.random.default_rng(1))
        seen = line_of_sight(photodetector)
        assert not seen.unused
        error = seen.e_b - true_direction_b(sensor, STILL, seen.t_s)
        quarter_a = photodetector.currents.mean()
        per_logarithm = slope * sensor.detector_radius_m / sensor.focal_length_m
        expected = per_logarithm * np.sqrt(2) * optics.noise_a / quarter_a
        assert np.std(error[:, 1:]) == pytest.approx(expected, rel=0.06)


def test_a_beacon_too_faint_reads_zero_and_is_a_gap():
    photodetector = watch(ahead(0.3, optics=OpticsTable()), STILL, rng=np.random.default_rng(1))
    assert (photodetector.currents.min(axis=1) == 0).mean() > 0.9
    unused = {loss.reason: loss.count for loss in line_of_sight(photodetector).unused}
    zero = (photodetector.currents.min(axis=1) == 0).sum()
    assert unused["a current is zero or below"] == zero


def test_near_the_rim_a_large_spot_loses_light_but_not_direction():
    swing = Scenario(
        duration_s=10.0, motion=Motion(path=Straight(speed_mps=0.0), yaw=Sine(amplitude_deg=9.0))
    )
    dark = {"noise_a": 1e-20, "threshold_sigmas": 0.0}
    # 9 degrees off: the cosine alone, and 3.2 mm of a 5 mm radius with a spot of 3 mm.
    for spot_m, least in ((1e-4, 0.988), (3e-3, 0.81)):
        sensor = ahead(0.02, optics=OpticsTable(spot_radius_m=spot_m, **dark))
        photodetector = watch(sensor, swing, rng=np.random.default_rng(1))
        total = photodetector.currents.sum(axis=1)
        assert total.min() / total.max() == pytest.approx(least, abs=0.01)
        seen = line_of_sight(photodetector)
        error = seen.e_b - true_direction_b(sensor, swing, seen.t_s)
        assert np.abs(error).max() < 1e-9


@pytest.mark.parametrize(("small", "large"), [(1.0, 3.0), (2.0, 2.0), (3.0, 1.0)])
def test_the_share_of_a_circle_within_another_is_that_of_counted_points(small, large):
    rng = np.random.default_rng(1)
    radius, angle = small * np.sqrt(rng.random(100_000)), rng.uniform(0, 2 * np.pi, 100_000)
    for distance in (0.0, 0.5, 1.5, 2.5, 3.5, 4.5):
        inside = np.hypot(distance + radius * np.cos(angle), radius * np.sin(angle)) <= large
        share = share_within(np.array([distance]), small, large)
        assert share == pytest.approx(inside.mean(), abs=0.006)


def test_currents_saturate_near_the_beacon_and_are_counted():
    optics = OpticsTable(noise_a=1e-12, saturation_a=1e-7)
    sensor = ahead(0.03, optics=optics)
    flight = simulate(
        Scenario(
            duration_s=30.0, motion=Motion(path=Straight(speed_mps=100.0)), photodetector=sensor
        ),
        np.random.default_rng(1),
    )
    assert flight.photodetector.currents.max() == 1e-7
    cut = (flight.photodetector.currents == 1e-7).any(axis=1)
    assert 0 < cut.sum() < len(cut)
    assert (np.diff(cut.astype(int)) >= 0).mean() > 0.99  # far first, near last
    assert [(loss.what, loss.count) for loss in flight.unused] == [
        ("photodetector sample", cut.sum())
    ]
    assert flight.unused[0].reason == "a current saturated at 1e-07 A"
    assert saturated(ahead(0.03), flight.photodetector) == ()


@pytest.mark.parametrize("optics", [None, OpticsTable()])
def test_a_quadrant_in_the_dark_is_a_gap(optics):
    shade = OcclusionTable(quadrant=3, from_s=20.0, until_s=60.0)
    clear = watch(ahead(0.02, optics=optics), STILL, rng=np.random.default_rng(1))
    sensor = ahead(0.02, optics=optics, occlusions=(shade,))
    photodetector = watch(sensor, STILL, rng=np.random.default_rng(1))
    dark = (photodetector.t_s >= 20.0) & (photodetector.t_s < 60.0)
    assert (photodetector.currents[dark, 2] == 0).all()
    assert np.array_equal(photodetector.currents[~dark], clear.currents[~dark])
    seen = line_of_sight(photodetector)
    assert np.array_equal(seen.t_s, photodetector.t_s[~dark])
    assert [(loss.reason, loss.count) for loss in seen.unused] == [
        ("a current is zero or below", 2000)
    ]
