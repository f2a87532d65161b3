from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.geometry.earth import geodetic
from fgnav.gnss.atmosphere import klobuchar_m, saastamoinen_m
from fgnav.gnss.single_point.model import orbits_of
from fgnav.gnss.single_point.solution import code_solution
from fgnav.types.flight import Flight
from fgnav.types.observations import Observations
from fgnav.types.orbits import BroadcastOrbits
from tests.gnss import recordings, rtklib
from tests.gnss.flights import ORIGIN, Made, walker_orbits
from tests.gnss.test_atmosphere import KLOBUCHAR

MM = 1e-3
ONE = np.zeros((1, 3))
T_S = np.arange(0.0, 10.0, 0.5)


def with_code(flight: Flight, code_m: FloatArray) -> Flight:
    observations = flight.observations
    assert observations is not None
    return replace(flight, observations=replace(observations, code_m=code_m))


def codes(flight: Flight) -> FloatArray:
    assert flight.observations is not None
    return flight.observations.code_m.copy()


def by_second(flight: Flight) -> Flight:
    """Return a flight of two antennas, the second put first."""
    names = ("tag_s", "code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")
    arrays = {name: getattr(flight.observations, name)[:, ::-1] for name in names}
    observations = replace(flight.observations, **arrays)
    return replace(flight, antennas=flight.antennas[::-1], observations=observations)


def reasons(unused) -> dict[tuple[str, str], int]:
    return {(loss.what, loss.reason): loss.count for loss in unused}


@pytest.mark.parametrize("letters", ["G", "GEC"])
def test_exact_ranges_give_the_exact_position_clock_and_velocity(letters):
    made = Made(
        t_s=T_S, arms_b_m=ONE, letters=letters, v_n_mps=(250.0, -80.0, 12.0), clock_s=(1e-3,)
    )
    solution = code_solution(made.flight())
    np.testing.assert_array_equal(solution.t_s, T_S)
    assert np.abs(solution.p_n_m - made.position_n_m(T_S, ONE[0])).max() < 0.2 * MM
    assert np.abs(solution.clock_s - 1e-3).max() < 1e-12
    assert solution.v_n_mps is not None
    assert np.abs(solution.v_n_mps - np.array(made.v_n_mps)).max() < 0.5 * MM
    assert np.abs(solution.clock_drift_sps).max() < 1e-11
    assert solution.constellations == tuple(letters)


def test_each_antenna_has_its_own_solution_and_is_solved_once():
    made = Made(t_s=T_S[:3], arms_b_m=np.array([[0.0, 0, 0], [2.0, 1.0, -0.5]]))
    flight = made.flight()
    for turned, arm_b_m in zip((flight, by_second(flight)), made.arms_b_m, strict=True):
        solution = code_solution(turned)
        truth = made.position_n_m(T_S[:3], arm_b_m)
        assert np.abs(solution.p_n_m - truth).max() < 0.2 * MM
        assert code_solution(turned) is solution


def test_an_origin_a_thousand_kilometres_away_is_near_enough():
    made = Made(t_s=T_S[:3], arms_b_m=ONE)
    flight = made.flight()
    far = replace(flight, origin=replace(ORIGIN, latitude_rad=ORIGIN.latitude_rad - 0.16))
    solution = code_solution(far)
    found = far.origin.to_e(solution.p_n_m)
    assert np.abs(found - ORIGIN.to_e(made.position_n_m(T_S[:3], ONE[0]))).max() < 0.2 * MM


def test_errors_are_those_the_covariances_state():
    t_s = np.arange(0.0, 150.0, 0.5)
    made = Made(t_s=t_s, arms_b_m=ONE, letters="GE", v_n_mps=(30.0, 0, 0), code_sigma_m=1.0)
    solution = code_solution(made.flight())
    error = solution.p_n_m - made.position_n_m(t_s, ONE[0])
    inverse = np.linalg.inv(solution.position_covariance_m2)
    nees = np.einsum("ni,nij,nj->n", error, inverse, error).mean()
    low, high = chi2(3 * len(t_s)).ppf([0.001, 0.999]) / len(t_s)
    assert low < nees < high
    # Messages that state no error leave nothing but noise.
    np.testing.assert_allclose(
        solution.position_noise_m2, solution.position_covariance_m2, rtol=1e-6, atol=1e-9
    )


def test_message_errors_enlarge_the_covariance_but_not_the_noise():
    orbits = walker_orbits("GE")
    records = orbits.records.copy()
    records["accuracy_m"] = 2.4
    doubtful = BroadcastOrbits(records=records, klobuchar=np.zeros(8))
    flight = Made(t_s=T_S[:3], arms_b_m=ONE, letters="GE", code_sigma_m=1.0).flight(doubtful)
    solution = code_solution(flight)
    ratio = solution.position_covariance_m2[0] / solution.position_noise_m2[0]
    np.testing.assert_allclose(np.diag(ratio), 1 + 2.4**2, rtol=1e-6)


def test_a_gross_error_is_dropped_and_counted():
    made = Made(t_s=T_S, arms_b_m=ONE, letters="GE", code_sigma_m=0.5)
    flight = made.flight()
    code_m = codes(flight)
    visible = int(np.nonzero(code_solution(flight).used[4])[0][0])
    satellite = code_solution(flight).satellites[visible]
    column = flight.observations.satellites.index(satellite)
    code_m[4, 0, column] += 60.0
    solution = code_solution(with_code(flight, code_m))
    assert reasons(solution.unused)["a1 code observation", "contradicts the other satellites"] == 1
    assert not solution.used[4, visible]
    error = solution.p_n_m - made.position_n_m(T_S, ONE[0])
    assert np.abs(error).max() < 5.0


def test_epochs_without_enough_satellites_are_lost_by_name():
    flight = Made(t_s=T_S, arms_b_m=ONE).flight()
    code_m = codes(flight)
    code_m[3, 0, 3:] = np.nan
    code_m[5] = np.nan
    solution = code_solution(with_code(flight, code_m))
    assert reasons(solution.unused)["a1 epoch", "fewer satellites than unknowns"] == 2
    np.testing.assert_array_equal(np.delete(np.arange(len(T_S)), [3, 5]), solution.epoch)


def test_satellites_below_the_mask_and_sick_ones_are_counted():
    orbits = walker_orbits("G")
    made = Made(t_s=T_S, arms_b_m=ONE)
    flight = made.flight(orbits)
    satellite = code_solution(flight).satellites[int(code_solution(flight).used[0].argmax())]
    records = orbits.records.copy()
    records["health"][records["satellite"] == satellite] = 1
    sick = replace(flight, broadcast=BroadcastOrbits(records=records, klobuchar=np.zeros(8)))
    masked = replace(sick, elevation_mask_rad=np.radians(25.0))
    lost = reasons(code_solution(masked).unused)
    assert lost["a1 code observation", "satellite not healthy"] == len(T_S)
    assert lost["a1 code observation", "below the elevation mask"] >= len(T_S)


def atmosphere(klobuchar: FloatArray, made: Made):
    """Return the delays of a still antenna at the origin."""
    place = geodetic(ORIGIN.p_e_m[None])

    def delay_m(t_s: FloatArray, elevation: FloatArray) -> FloatArray:
        low = elevation.clip(0.05)
        there = np.repeat(place, len(t_s), axis=0)
        azimuth = np.zeros_like(low)  # nearly: the model's azimuth matters centimetres here
        gps_s = 1_277_078_400.0 + t_s
        return klobuchar_m(klobuchar, there, low, azimuth, gps_s) + saastamoinen_m(there, low)

    return replace(made, delay_m=delay_m)


@pytest.mark.parametrize("coefficients", [np.zeros(8), KLOBUCHAR])
def test_the_atmosphere_of_the_messages_is_taken_out(coefficients):
    made = Made(t_s=T_S, arms_b_m=ONE, letters="GE", code_sigma_m=0.5)
    orbits = walker_orbits("GE", coefficients)
    solution = code_solution(atmosphere(coefficients, made).flight(orbits))
    error = solution.p_n_m.mean(axis=0)
    assert np.abs(error).max() < 1.5


def test_without_doppler_there_is_no_velocity():
    solution = code_solution(Made(t_s=T_S[:3], arms_b_m=ONE, doppler=False).flight())
    assert solution.v_n_mps is None
    assert solution.velocity_covariance_m2ps2 is None
    assert np.isnan(solution.clock_drift_sps).all()


def three_satellites(flight):
    code_m = codes(flight)
    code_m[:, :, 3:] = np.nan
    return with_code(flight, code_m)


def no_channel(flight):
    none = np.empty((3, 1, 0))
    values = dict.fromkeys(("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags"), none)
    empty = Observations(t_s=T_S[:3], tag_s=T_S[:3, None], satellites=(), signals=(), **values)
    return replace(flight, observations=empty)


@pytest.mark.parametrize(
    ("spoilt", "text"),
    [
        (lambda f: replace(f, observations=None), "flight made: position needs GNSS observations"),
        (
            lambda f: with_code(f, np.full_like(codes(f), np.nan)),
            "antenna a1: no code observation of a supported",
        ),
        (no_channel, "no code observation of a supported satellite"),
        (three_satellites, "no epoch has a code solution .*fewer satellites"),
    ],
)
def test_what_is_missing_for_a_position_is_named(spoilt, text):
    flight = Made(t_s=T_S[:3], arms_b_m=ONE).flight()
    with pytest.raises(NoSolutionError, match=text):
        code_solution(spoilt(flight))
    blind = replace(flight, observations=None, broadcast=None)
    with pytest.raises(NoSolutionError, match="flight made: GNSS needs navigation or orbits files"):
        orbits_of(blind)


@pytest.mark.parametrize("antenna", [0, 1])
def test_positions_are_within_half_a_metre_of_rtklibs(shared, antenna):
    nav = rtklib.navigation(shared / "orbits" / "ESBC00DNK_R_20201770000_01D_MN.rnx")
    path = recordings.observation_files(shared)[antenna]
    t_s, p_e_m = rtklib.point_positions(path, nav)
    flight = recordings.wettzell(shared)
    solution = code_solution(by_second(flight) if antenna else flight)
    assert len(solution.t_s) == 120
    difference = solution.p_n_m - flight.origin.to_n(p_e_m)[: len(solution.t_s)]
    np.testing.assert_allclose(solution.t_s, t_s, atol=1e-3)
    assert np.linalg.norm(difference, axis=1).max() < 0.5
    assert solution.v_n_mps is not None
    assert np.sqrt(np.nanmean(solution.v_n_mps**2)) < 0.02


def test_precise_orbits_place_the_still_station_within_two_metres(shared):
    flight = replace(recordings.wettzell(shared), precise=recordings.precise(shared))
    solution = code_solution(flight)
    assert np.abs(np.median(solution.p_n_m, axis=0)).max() < 2.0
