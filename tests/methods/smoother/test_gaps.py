import dataclasses

import msgspec
import numpy as np
import pytest

from fgnav import rotations
from fgnav.attitude import RotationQuadratic
from fgnav.flight import Imu
from fgnav.integers.truth import Truth
from fgnav.methods.smoother import Batch, Forward, gaps
from fgnav.methods.smoother.filling import filled, held_on
from fgnav_sim.receiver_tables import OutageTable
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.methods.simulated import SCENARIOS, errors_rad

SECONDS = np.arange(0, 10, 0.01)
GYROSCOPE = {
    "gyroscope_noise_radps_per_sqrt_hz": 1e-4,
    "gyroscope_bias_radps": 2e-3,
    "gyroscope_bias_walk_radps_per_sqrt_s": 1e-6,
}


def record(t_s=SECONDS, gyro=False):
    f_b = np.stack([np.sin(t_s), 0 * t_s, -9.8 + 0 * t_s], axis=1)
    return Imu(
        t_s=t_s,
        f_b_mps2=f_b,
        w_b_radps=f_b / 10 if gyro else None,
        accelerometer_noise_mps2_per_sqrt_hz=1e-3,
        accelerometer_bias_mps2=3e-2,
        accelerometer_bias_walk_mps2_per_sqrt_s=1e-4,
        **(GYROSCOPE if gyro else {}),
    )


def with_hole(imu, from_s, until_s):
    keep = (imu.t_s <= from_s) | (imu.t_s >= until_s)
    rates = None if imu.w_b_radps is None else imu.w_b_radps[keep]
    return dataclasses.replace(imu, t_s=imu.t_s[keep], f_b_mps2=imu.f_b_mps2[keep], w_b_radps=rates)


@pytest.mark.parametrize("gyro", [False, True])
def test_a_hole_is_filled_with_straight_lines_at_the_records_own_rate(gyro):
    holed = with_hole(record(gyro=gyro), 3.0, 5.0)
    bridge = gaps.bridged(holed)
    np.testing.assert_allclose(bridge.gaps_s, [[3.0, 5.0]])
    assert np.diff(bridge.imu.t_s).max() < 0.0151
    own = np.isin(bridge.imu.t_s, holed.t_s)
    assert (bridge.imu.f_b_mps2[own] == holed.f_b_mps2).all()
    middle = np.abs(bridge.imu.t_s - 4.0).argmin()
    assert bridge.imu.f_b_mps2[middle, 0] == pytest.approx((np.sin(3) + np.sin(5)) / 2, abs=0.01)
    assert bridge.loose.accelerometer_noise_mps2_per_sqrt_hz > 1
    assert (bridge.imu.w_b_radps is None) != gyro


def test_a_record_without_holes_stays_as_it_is():
    imu = record()
    bridge = gaps.bridged(imu)
    assert bridge.imu is imu
    assert not bridge.touched(np.arange(0, 9.0, 0.1)).any()


def test_keyframes_from_which_the_way_leads_through_a_hole_are_named():
    bridge = gaps.bridged(with_hole(record(), 3.05, 5.05))
    t_s = np.arange(0, 9.05, 0.1)
    touched = t_s[bridge.touched(t_s)]
    assert (touched[0], touched[-1]) == pytest.approx((3.0, 5.0))
    assert len(touched) == 21


@pytest.mark.parametrize(
    ("epochs_s", "expected_s"),
    [
        ([0, 0.1, 0.2, 0.5, 0.6], [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6]),
        ([0, 1, 2], np.arange(21) / 10),
        ([0, 0.1, 0.2, 0.31, 0.4], [0, 0.1, 0.2, 0.31, 0.4]),
        ([7.0], [7.0]),
    ],
    ids=["an outage", "one a second", "a late tag", "one epoch"],
)
def test_keyframes_fill_the_time_between_epochs_that_are_far_apart(epochs_s, expected_s):
    np.testing.assert_allclose(gaps.keyframe_times(np.array(epochs_s, dtype=float)), expected_s)


def test_what_is_missing_is_told_from_measurement_to_measurement():
    t_s = np.arange(0, 10.05, 0.1)
    missing = ((t_s > 2.05) & (t_s < 4.05)) | (np.abs(t_s - 6) < 0.15) | (t_s > 9.05)
    found = gaps.spans(t_s, missing)
    np.testing.assert_allclose(found, [[2.0, 4.1], [9.0, 10.0]])
    assert [*gaps.told("position", found)] == [
        "No position from 2.00 to 4.10 s.",
        "No position from 9.00 to 10.00 s.",
    ]


def test_measurements_once_a_second_have_no_gaps_between_them():
    t_s = np.arange(0, 10.05, 0.1)
    assert not len(gaps.spans(t_s, np.arange(len(t_s)) % 10 != 0))


def test_many_gaps_end_in_their_number():
    found = np.array([[k, k + 0.6] for k in range(8)], dtype=float)
    assert [*gaps.told("velocity", found)][-1] == "No velocity in 3 more gaps of up to 0.60 s."


def test_a_pretended_gap_finds_the_intensity_of_a_random_walk():
    """In truth the rate is a random walk: then every length of gap says the same."""
    rng = np.random.default_rng(0)
    n, dt, density = 1500, 0.1, 1e-4
    rate = np.cumsum(np.sqrt(density * dt) * rng.standard_normal((n, 3)), axis=0)
    rate -= np.linspace(0, 1, n)[:, None] * rate[-1]
    R_nb = [np.eye(3)]
    for step in rotations.exp((rate[1:] + rate[:-1]) / 2 * dt):
        R_nb.append(R_nb[-1] @ step)
    t_s, there = dt * np.arange(n), np.ones(n, dtype=bool)
    there[1000:1020] = False
    usual = np.full(3, 1e-7)
    found = gaps.density_in_gaps(t_s, np.array(R_nb), there, np.zeros((n - 20, 3, 3)), usual)
    assert (found[:999] == usual).all()
    assert (found[1100:] == usual).all()
    # Rates told from half a second are not those of an instant: a quarter more, and chance.
    np.testing.assert_allclose(found[1005], density, rtol=0.5)


def test_a_longer_gap_is_bridged_by_no_calmer_a_walk_than_a_shorter_one():
    t_s = np.arange(0, 60.05, 0.1)
    R_nb = rotations.exp(np.radians(20) * np.sin(t_s)[:, None] * np.eye(3)[:1])
    asked = []
    for length_s in (4.0, 5.0, 20.0):
        there = (t_s < 20.05) | (t_s > 19.95 + length_s)
        covariance = np.tile(1e-6 * np.eye(3), (there.sum(), 1, 1))
        found = gaps.density_in_gaps(t_s, R_nb, there, covariance, np.full(3, 1e-6))
        asked.append(found[220, 0])
    assert asked[1] > 2 * asked[0]  # the cubic errs by the fourth power of the length
    assert asked[2] > asked[1]


def test_a_steady_spin_is_carried_through_whole_turns():
    first, rate = np.eye(3)[None], np.array([[2 * np.pi * 2, 0.1, 0]])
    last = first @ rotations.exp(1.3 * rate)
    found = gaps.carried(first, last, rate, rate, 1.3, np.array(0.4))
    np.testing.assert_allclose(found, rotations.exp(0.52 * rate), atol=1e-9)


def test_hardly_known_leaves_what_is_told_and_pulls_by_a_radian():
    rng = np.random.default_rng(1)
    t_s, there = np.arange(0, 10.05, 0.1), np.ones(101, dtype=bool)
    there[30:70] = False
    R_nb = rotations.exp(rng.standard_normal((101, 3)))
    form = RotationQuadratic(
        information=np.tile(np.eye(9), (101, 1, 1)),
        vector=R_nb.reshape(-1, 9),
        constant=np.full(101, 3.0),
        count=np.full(101, 9),
    )
    vague = gaps.hardly_known(form, R_nb, t_s, there)
    assert (vague.information[there] == form.information[there]).all()
    off = R_nb @ rotations.exp(np.tile([0.1, 0, 0], (101, 1)))
    # A tenth of a radian, over the four seconds and forty keyframes together: 4 s / (2 * 2 s).
    assert vague.chi_square(off)[~there].sum() == pytest.approx(0.1**2, rel=0.01)


def test_without_an_array_all_keyframes_are_hardly_known():
    t_s, R_nb = np.arange(0, 2, 0.1), rotations.exp(np.tile([0.3, 0.2, -0.1], (20, 1)))
    vague = gaps.hardly_known(None, R_nb, t_s, np.ones(20, dtype=bool))
    off = R_nb @ rotations.exp(np.tile([0.0, 0.1, 0], (20, 1)))
    assert vague.chi_square(R_nb) == pytest.approx(np.zeros(20), abs=1e-9)
    assert vague.chi_square(off).sum() == pytest.approx(0.1**2 * 2 / 4, rel=0.01)


def flown(outages=(), gyro=False, span_s=40.0):
    scenario = load_scenario(SCENARIOS / "demo.toml")
    gnss = msgspec.structs.replace(scenario.gnss, outages=outages)
    imu = msgspec.structs.replace(scenario.imu, **(GYROSCOPE if gyro else {}))
    scenario = msgspec.structs.replace(scenario, duration_s=span_s, gnss=gnss, imu=imu)
    return simulate(scenario, np.random.default_rng(1))


def within_three_sigma(flight, estimate):
    """Axis by axis, (n, 6): all six normal errors at once are within at 98.4 % of epochs."""
    sigma = np.sqrt(np.einsum("nii->ni", estimate.attitude_covariance_rad2))
    attitude = np.abs(errors_rad(flight, estimate)) < 3 * sigma
    truth = flight.truth
    place = np.stack([np.interp(estimate.t_s, truth.t_s, x) for x in truth.p_n_m.T], axis=1)
    sigma = np.sqrt(np.einsum("nii->ni", estimate.position_covariance_m2))
    return np.hstack([attitude, np.abs(estimate.p_n_m - place) < 3 * sigma])


@pytest.mark.parametrize("length_s", [5.0, 15.0])
def test_an_outage_of_all_satellites_is_bridged_within_what_is_stated(length_s):
    flight = flown((OutageTable(from_s=12.0, until_s=12.0 + length_s),))
    estimate = Batch(resolver=Truth())(flight)
    assert estimate.available == 1
    assert within_three_sigma(flight, estimate).mean() >= 0.99
    assert f"No position from 11.90 to {12 + length_s:.2f} s." in estimate.notes


def test_epochs_that_are_not_in_the_file_have_estimates_all_the_same():
    flight = flown(span_s=20.0)
    seen = flight.observations
    keep = (seen.t_s < 8.0) | (seen.t_s > 10.05)
    arrays = ("t_s", "tag_s", "code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")
    rest = dataclasses.replace(seen, **{name: getattr(seen, name)[keep] for name in arrays})
    estimate = Batch(resolver=Truth())(dataclasses.replace(flight, observations=rest))
    np.testing.assert_allclose(estimate.t_s, seen.t_s, atol=0.02)
    assert within_three_sigma(flight, estimate).mean() >= 0.99


def test_one_antenna_that_is_gone_is_told_and_costs_little():
    flight = flown((OutageTable(from_s=5.0, until_s=15.0, antennas=("a3",)),), span_s=20.0)
    estimate = Batch(resolver=Truth())(flight)
    assert "No phase of antenna a3 from 4.90 to 15.00 s." in estimate.notes
    assert within_three_sigma(flight, estimate).mean() >= 0.99
    assert np.degrees(np.linalg.norm(errors_rad(flight, estimate), axis=1)).max() < 2


def test_a_hole_in_the_inertial_record_is_bridged_and_told():
    flight = flown(span_s=20.0)
    holed = dataclasses.replace(flight, imu=with_hole(flight.imu, 6.0, 11.0))
    estimate = Batch(resolver=Truth())(holed)
    assert estimate.converged
    assert estimate.available == 1
    assert "No inertial samples from 6.00 to 11.00 s." in estimate.notes
    assert within_three_sigma(flight, estimate).mean() >= 0.99
    assert not any(loss.reason == "off its neighbours" for loss in estimate.losses)


def test_a_filter_counts_from_the_last_attitude_a_smoother_from_the_next_too():
    t_s, there = np.arange(0, 1.05, 0.1), np.ones(11, dtype=bool)
    there[3:8] = False
    both = gaps.without_attitude(t_s, there)
    np.testing.assert_allclose(both[2:9], [0, 0.1, 0.2, 0.3, 0.2, 0.1, 0], atol=1e-9)
    last = gaps.without_attitude(t_s, there, causal=True)
    np.testing.assert_allclose(last[2:9], [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0], atol=1e-9)


def test_a_filter_holds_on_to_the_last_attitude_and_a_smoother_turns_to_the_next():
    t_s, there = np.arange(0, 1.05, 0.1), np.ones(11, dtype=bool)
    there[3:8] = False
    R_nb = rotations.exp(np.stack([t_s, 0 * t_s, 0 * t_s], axis=1))
    seen = np.where(there[:, None, None], R_nb, np.eye(3))
    np.testing.assert_allclose(held_on(t_s, seen, there)[3:8], np.tile(R_nb[2], (5, 1, 1)))
    np.testing.assert_allclose(filled(t_s, seen, there), R_nb, atol=1e-9)


def test_a_minute_without_satellites_leaves_a_filter_within_what_it_states():
    """Normal equations lose the position: elimination goes on by rows."""
    flight = flown((OutageTable(from_s=6.0, until_s=66.0),), span_s=70.0)
    estimate = Forward(resolver=Truth())(flight)
    assert estimate.available == 1
    sigma_m = np.sqrt(np.einsum("nii->ni", estimate.position_covariance_m2)).max(axis=1)
    assert sigma_m[655] > 1000 > 10 > sigma_m[680]
    assert within_three_sigma(flight, estimate).mean() >= 0.99
