"""Echoes: the process has its size and memory, the body's mirrors their geometry."""

import numpy as np
import pytest

from fgnav.gnss.signals import wavelengths_m
from fgnav_sim.gnss.tables import GnssTable, MultipathTable, ReflectorTable
from fgnav_sim.motion import Motion, Rate, Straight
from fgnav_sim.propagation.multipath import echoes
from fgnav_sim.scenario import Scenario
from fgnav_sim.simulate import simulate
from tests.sim.motions import STILL

L1_M = 299_792_458.0 / 1575.42e6
FLOOR = ReflectorTable(point_b_m=(0.0, 0.0, 0.5), normal_b=(0.0, 0.0, -2.0), amplitude=0.4)
NONE_TURNS = np.zeros((1, 3))


def made(*, motion=STILL, duration_s=60.0, antennas=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), **gnss):
    table = GnssTable(**{"elevation_weights": "uniform", **gnss})
    scenario = Scenario(duration_s=duration_s, motion=motion, antennas_b_m=antennas, gnss=table)
    return simulate(scenario, np.random.default_rng(1)).observations


def direction(elevation_deg, azimuth_deg=0.0):
    """Return a direction in the axes of a level body, (1, 1, 3)."""
    e, a = np.radians([elevation_deg, azimuth_deg])
    return np.array([[[np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), -np.sin(e)]]])


def test_echoes_from_anywhere_have_their_variance_and_time_constant():
    table = MultipathTable(code_m=0.7, phase_m=0.006, time_constant_s=2.0)
    calm, echoing = (made(duration_s=600.0, multipath=m) for m in (None, table))
    wavelength_m = wavelengths_m(calm.satellites, calm.signals)
    code_m = echoing.code_m - calm.code_m
    phase_m = (echoing.phase_cycles - calm.phase_cycles) * wavelength_m
    for error_m, sigma_m in ((code_m, 0.7), (phase_m, 0.006)):
        assert np.nanstd(error_m) == pytest.approx(sigma_m, rel=0.05)
        lagged = np.nanmean(error_m[20:] * error_m[:-20]) / sigma_m**2
        assert lagged == pytest.approx(np.exp(-1.0), abs=0.06)  # 2 s at 10 Hz
    both = np.isfinite(code_m[:, 0]) & np.isfinite(code_m[:, 1])
    assert np.corrcoef(code_m[:, 0][both], code_m[:, 1][both])[0, 1] == pytest.approx(0, abs=0.06)


def test_estimators_are_told_of_noise_and_echoes_together():
    table = MultipathTable(code_m=0.4, phase_m=0.004, time_constant_s=2.0)
    gnss = GnssTable(code_noise_m=0.3, phase_noise_m=0.003, multipath=table)
    flight = simulate(Scenario(duration_s=1.0, gnss=gnss), np.random.default_rng(1))
    assert flight.gnss_noise.code_m == pytest.approx(0.5)
    assert flight.gnss_noise.phase_m == pytest.approx(0.005)


def test_echoes_weigh_by_elevation_as_the_noise_does():
    table = MultipathTable(code_m=0.7, phase_m=0.006, time_constant_s=0.5)
    settings = {"duration_s": 200.0, "elevation_weights": "sine", "receiver_mask_deg": 12.0}
    calm, echoing = (made(multipath=m, **settings) for m in (None, table))
    sine = (np.nanmean(calm.cn0_dbhz, axis=(0, 1)) - 35.0) / 15.0
    size = np.nanstd(echoing.code_m - calm.code_m, axis=(0, 1))
    assert size * sine == pytest.approx(0.7, rel=0.2)


def test_one_mirror_errs_by_the_arc_tangent_of_its_geometry():
    for elevation_deg in (7.0, 33.0, 80.0):
        seen = echoes(
            (FLOOR,), np.zeros((1, 3)), direction(elevation_deg), NONE_TURNS, np.array([L1_M])
        )
        longer_m = 2 * 0.5 * np.sin(np.radians(elevation_deg))
        theta = 2 * np.pi * longer_m / L1_M + np.pi
        a = 0.4
        lag = np.arctan(a * np.sin(theta) / (1 + a * np.cos(theta)))
        power = 1 + 2 * a * np.cos(theta) + a**2
        assert seen.phase_m.item() == pytest.approx(lag * L1_M / (2 * np.pi), rel=1e-9)
        late_m = longer_m * (a * np.cos(theta) + a**2) / power
        assert seen.code_m.item() == pytest.approx(late_m, rel=1e-9)
        assert seen.gain_db.item() == pytest.approx(10 * np.log10(power), rel=1e-9)


def test_a_mirror_reflects_only_before_its_front_and_within_its_rim():
    arms = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.6]])  # the second is behind the mirror
    seen = echoes((FLOOR,), arms, direction(30.0), NONE_TURNS, np.array([L1_M]))
    assert seen.phase_m[0, 0, 0] != 0
    assert seen.phase_m[0, 1, 0] == 0
    below = echoes((FLOOR,), arms[:1], direction(-30.0), NONE_TURNS, np.array([L1_M]))
    assert below.phase_m.item() == 0
    # At 45 degrees the ray is mirrored as far beside the middle as the antenna is above it: 0.5 m,
    # on the side where the satellite stands.
    small = {"point_b_m": (0.4, 0.0, 0.5), "normal_b": (0.0, 0.0, -1.0), "radius_m": 0.15}
    disc = ReflectorTable(**small)
    for azimuth_deg, lit in ((0.0, True), (180.0, False)):
        e_b = direction(45.0, azimuth_deg)
        seen = echoes((disc,), arms[:1], e_b, NONE_TURNS, np.array([L1_M]))
        assert (seen.phase_m.item() != 0) == lit


def test_two_mirrors_add_as_waves():
    wall = ReflectorTable(point_b_m=(-0.7, 0, 0), normal_b=(1, 0, 0), amplitude=0.2)
    e_b = direction(40.0)
    seen = echoes((FLOOR, wall), np.zeros((1, 3)), e_b, NONE_TURNS, np.array([L1_M]))
    ways_m = np.array([1.0 * np.sin(np.radians(40.0)), 1.4 * np.cos(np.radians(40.0))])
    waves = np.array([0.4, 0.2]) * np.exp(-1j * (2 * np.pi * ways_m / L1_M + np.pi))
    assert seen.phase_m.item() == pytest.approx(-np.angle(1 + waves.sum()) / 2 / np.pi * L1_M)


def test_the_doppler_holds_what_turning_does_to_the_mirrored_way():
    turning = Motion(path=Straight(speed_mps=0.0), roll=Rate(rate_degps=20.0))
    settings = {
        "motion": turning,
        "duration_s": 1.0,
        "rate_hz": 200.0,
        "antennas": ((0.0, 0.0, 0.0),),
        "code_noise_m": 1e-9,
        "phase_noise_m": 1e-9,
        "doppler_noise_mps": 1e-9,
    }
    calm, mirrored = (made(reflectors=r, **settings) for r in ((), (FLOOR,)))
    change = mirrored.phase_cycles - calm.phase_cycles
    by_phase_hz = -(change[2:] - change[:-2]) / 0.01
    doppler_hz = (mirrored.doppler_hz - calm.doppler_hz)[1:-1]
    assert np.nanmax(np.abs(doppler_hz)) > 0.1
    error_hz = np.abs(by_phase_hz - doppler_hz)
    # All but the few samples at which a satellite rises above the mirror's plane.
    assert np.nanquantile(error_hz, 0.98) < 0.005
