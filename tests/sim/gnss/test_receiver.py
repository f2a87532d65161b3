"""What receivers measure: geometry, clocks, integers, delays and noise, each told apart."""

import msgspec
import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.geometry.earth import C_MPS
from fgnav.gnss.orbits.satellites import look_angles, satellite_states
from fgnav.gnss.signals import wavelengths_m
from fgnav.types.observations import LOST_LOCK
from fgnav_sim.gnss.constellation import built_in_orbits
from fgnav_sim.gnss.receiver import observe
from fgnav_sim.gnss.tables import ClockTable, Cn0Table, GnssTable
from fgnav_sim.scenario import Scenario
from tests.sim.motions import STILL, SWING

QUIET = GnssTable(
    code_noise_m=1e-9,
    phase_noise_m=1e-9,
    doppler_noise_mps=1e-9,
    elevation_weights="uniform",
    atmosphere=False,
    clock=ClockTable(offset_s=0.0, drift_sps=0.0, drift_walk_sps_per_sqrt_s=0.0),
)
FLIGHT = Scenario(duration_s=2.0, motion=SWING)


def changed(table, **fields):
    return msgspec.structs.replace(table, **fields)


def run(sensor, scenario=FLIGHT, seed=1):
    letters = tuple(sensor.signals)
    orbits = built_in_orbits(letters, scenario.start_gps_s, scenario.duration_s)
    rng = np.random.default_rng(seed)
    seen = observe(sensor, scenario, orbits, rng=rng)
    return orbits, seen.observations


def double_difference(value):
    single = value[:, 1:] - value[:, :1]
    return single[..., 1:] - single[..., :1]


def test_double_differences_of_phase_minus_the_array_are_integers():
    scenario = Scenario(duration_s=10.0, motion=SWING)
    orbits, seen = run(changed(QUIET, signals={"G": ("1C", "5Q")}), scenario)
    state = scenario.motion(seen.t_s)
    p_e_m = scenario.origin.frame.to_e(state.p_n_m)
    left_s = seen.t_s[:, None] - seen.code_m[:, 0] / C_MPS
    sats_e_m = satellite_states(orbits, seen.satellites, left_s).p_e_m
    e_e, _, _ = look_angles(p_e_m, sats_e_m)
    e_n = e_e @ scenario.origin.frame.R_ne.T
    arms_n_m = np.einsum("nij,aj->nai", state.R_nb, np.array(scenario.antennas_b_m))
    array_m = -np.einsum("nai,nmi->nam", arms_n_m, e_n)
    wavelength_m = wavelengths_m(seen.satellites, seen.signals)
    for signal in ("1C", "5Q"):
        of = [k for k, s in enumerate(seen.signals) if s == signal]
        cycles = (seen.phase_cycles - array_m / wavelength_m)[..., of]
        integers = double_difference(cycles)
        assert len(of) >= 7
        # 0.1 mm: the axes of the time of reception have turned by 5e-6 rad since transmission
        assert np.abs(integers - np.round(integers)).max() * wavelength_m[of[0]] < 1e-4
        assert (np.round(integers) == np.round(integers[0])).all()
        assert np.unique(np.round(integers[0])).size == integers[0].size


def test_phase_and_code_hold_the_same_range_and_doppler_its_rate():
    clock = ClockTable(drift_sps=1e-7, drift_walk_sps_per_sqrt_s=0.0)
    _, seen = run(changed(QUIET, clock=clock, rate_hz=200.0))
    wavelength_m = wavelengths_m(seen.satellites, seen.signals)
    constant = seen.code_m - wavelength_m * seen.phase_cycles
    assert np.abs(constant - constant[0]).max() < 1e-6
    by_phase_hz = -(seen.phase_cycles[2:] - seen.phase_cycles[:-2]) / 0.01
    error_mps = wavelength_m * (by_phase_hz - seen.doppler_hz[1:-1])
    assert np.abs(error_mps).max() < 1e-4  # m/s


def test_a_clock_offset_lengthens_code_and_moves_the_time_of_reception():
    late = ClockTable(offset_s=1e-4, drift_sps=0.0, drift_walk_sps_per_sqrt_s=0.0)
    _, punctual = run(QUIET)
    _, seen = run(changed(QUIET, clock=late))
    wavelength_m = wavelengths_m(seen.satellites, seen.signals)
    longer_m = seen.code_m - punctual.code_m
    offset_s = longer_m.mean(axis=(0, 2)) / C_MPS
    assert np.std(offset_s) == pytest.approx(1e-4, rel=0.7)
    rate_mps = -wavelength_m * punctual.doppler_hz
    expected_m = (C_MPS - rate_mps) * offset_s[:, None]
    spread_m = longer_m - expected_m
    assert np.abs(spread_m - spread_m.mean(axis=(0, 2))[:, None]).max() < 1e-3
    assert np.array_equal(seen.tag_s, np.repeat(seen.t_s[:, None], 8, axis=1))


def test_the_atmosphere_delays_code_and_the_ionosphere_advances_phase():
    _, vacuum = run(changed(QUIET, signals={"G": ("1C", "5Q")}))
    _, air = run(changed(QUIET, signals={"G": ("1C", "5Q")}, atmosphere=True))
    wavelength_m = wavelengths_m(air.satellites, air.signals)
    code_m = (air.code_m - vacuum.code_m)[0, 0]
    phase_m = (wavelength_m * (air.phase_cycles - vacuum.phase_cycles))[0, 0]
    ions_m, air_m = 0.5 * (code_m - phase_m), 0.5 * (code_m + phase_m)
    assert (air_m > 2.0).all()
    assert (ions_m > 1.0).all()
    l1, l5 = (np.array(air.signals) == s for s in ("1C", "5Q"))
    assert np.allclose(ions_m[l5] / ions_m[l1], (1575.42 / 1176.45) ** 2, rtol=1e-6, atol=0)
    assert np.allclose(air_m[l5], air_m[l1], rtol=0, atol=1e-6)


@pytest.mark.parametrize("weights", ["uniform", "sine"])
def test_noise_has_its_size_and_grows_toward_the_horizon_if_asked(weights):
    scenario = Scenario(duration_s=200.0, motion=STILL)
    sizes = {"code_noise_m": 0.4, "phase_noise_m": 0.004, "doppler_noise_mps": 0.06}
    _, quiet = run(QUIET, scenario)
    orbits, noisy = run(changed(QUIET, elevation_weights=weights, **sizes), scenario)
    left_s = quiet.t_s[:, None] - quiet.code_m[:, 0] / C_MPS
    p_e_m = np.tile(scenario.origin.frame.p_e_m, (len(left_s), 1))
    places = satellite_states(orbits, quiet.satellites, left_s).p_e_m
    elevation_rad = look_angles(p_e_m, places)[1][:, None]
    factor = np.sin(elevation_rad) if weights == "sine" else np.ones_like(elevation_rad)
    wavelength_m = wavelengths_m(quiet.satellites, quiet.signals)
    for name, size, scale in zip(
        ("code_m", "phase_cycles", "doppler_hz"),
        sizes.values(),
        (1.0, wavelength_m, wavelength_m),
        strict=True,
    ):
        error = scale * (getattr(noisy, name) - getattr(quiet, name)) * factor
        assert np.nanstd(error, axis=(0, 1)) == pytest.approx(size, rel=0.05)


def test_nothing_is_tracked_below_the_receivers_mask_and_cn0_grows_with_elevation():
    scenario = Scenario(duration_s=4 * 3600.0, motion=STILL)
    sensor = changed(QUIET, rate_hz=1 / 300.0, receiver_mask_deg=20.0)
    orbits, seen = run(sensor, scenario)
    times_s = np.repeat(seen.t_s[:, None] - 0.075, len(seen.satellites), axis=1)
    places = satellite_states(orbits, seen.satellites, times_s).p_e_m
    p_e_m = np.tile(scenario.origin.frame.p_e_m, (len(seen.t_s), 1))
    elevation_rad = look_angles(p_e_m, places)[1]
    tracked = seen.tracked.all(axis=1)
    assert np.array_equal(tracked, seen.tracked.any(axis=1))
    assert np.array_equal(tracked, elevation_rad > np.radians(20.0))
    assert tracked.any(axis=0).all()
    expected_dbhz = 35.0 + 15.0 * np.sin(elevation_rad[tracked])
    assert np.allclose(seen.cn0_dbhz[:, 0][tracked], expected_dbhz, rtol=0, atol=0.02)


def test_a_satellite_that_rises_again_has_new_integers_and_says_so():
    scenario = Scenario(duration_s=24 * 3600.0, motion=STILL)
    _, seen = run(changed(QUIET, rate_hz=1 / 600.0), scenario)
    tracked = seen.tracked[:, 0]
    rises = np.vstack([np.zeros_like(tracked[:1]), tracked[1:] & ~tracked[:-1]])
    assert np.array_equal(seen.lock_flags[:, 3], LOST_LOCK * rises)
    channel = int(np.argmax(rises.sum(axis=0)))
    assert rises[:, channel].sum() >= 2
    wavelength_m = wavelengths_m(seen.satellites, seen.signals)
    constant = (seen.code_m / wavelength_m - seen.phase_cycles)[:, 0, channel]
    of_pass = np.cumsum(rises[:, channel])
    passes = [constant[(of_pass == k) & tracked[:, channel]] for k in (1, 2)]
    assert all(np.ptp(one) < 1e-3 for one in passes)
    apart = passes[1][0] - passes[0][0]
    assert abs(apart) > 1.0
    assert abs(apart - np.round(apart)) < 1e-3


def test_noise_follows_carrier_to_noise_density_if_asked():
    cn0 = Cn0Table(horizon_dbhz=30.0, zenith_dbhz=48.0, sets_noise=True)
    scenario = Scenario(duration_s=200.0, motion=STILL)
    _, quiet = run(changed(QUIET, cn0=cn0), scenario)
    _, noisy = run(changed(QUIET, cn0=cn0, code_noise_m=0.4), scenario)
    assert 30.0 < np.nanmin(quiet.cn0_dbhz) < np.nanmax(quiet.cn0_dbhz) <= 48.0
    expected_m = 0.4 * 10 ** ((48.0 - np.nanmean(quiet.cn0_dbhz, axis=(0, 1))) / 20)
    assert np.nanstd(noisy.code_m - quiet.code_m, axis=(0, 1)) == pytest.approx(
        expected_m, rel=0.05
    )


@pytest.mark.parametrize("sets_noise", [True, False])
def test_an_antenna_may_be_noisier_than_the_others(sets_noise):
    scenario = Scenario(duration_s=100.0, motion=STILL)
    flat = Cn0Table(horizon_dbhz=50.0, sets_noise=sets_noise)
    factors = (1.0, 1.0, 3.0, 1.0, 0.5, 1.0, 1.0, 1.0)
    _, quiet = run(QUIET, scenario)
    _, noisy = run(changed(QUIET, cn0=flat, antenna_noise=factors, code_noise_m=0.4), scenario)
    size = np.nanstd(noisy.code_m - quiet.code_m, axis=(0, 2))
    assert size == pytest.approx(0.4 * np.array(factors), rel=0.05)


def test_blocks_leave_no_seam(monkeypatch):
    whole = run(GnssTable())[1]
    monkeypatch.setattr("fgnav_sim.gnss.receiver._BLOCK", 7)
    pieces = run(GnssTable())[1]
    for name in ("code_m", "phase_cycles", "doppler_hz"):
        assert np.array_equal(getattr(whole, name), getattr(pieces, name))


def test_a_sky_without_satellites_is_refused_by_name():
    with pytest.raises(BadInputError, match=r"no satellite of G above receiver_mask_deg 89\.9"):
        run(changed(QUIET, receiver_mask_deg=89.9))
    _, seen = run(QUIET)
    highest_deg = np.degrees(np.arcsin((np.nanmax(seen.cn0_dbhz) - 35.0) / 15.0))
    just_above = changed(QUIET, receiver_mask_deg=float(highest_deg) + 0.2)
    with pytest.raises(BadInputError, match=r"no satellite of G above receiver_mask_deg"):
        run(just_above)
