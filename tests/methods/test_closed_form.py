from dataclasses import replace

import msgspec
import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.geometry import rotations
from fgnav.integers.resolvers.truth import Truth
from fgnav.methods.closed_form import ClosedForm
from fgnav.types.flight import Flight
from fgnav_sim.gnss.tables import GnssTable
from fgnav_sim.motion import Motion, Sine, Straight
from fgnav_sim.scenario import FixesTable, ImuTable, PhotodetectorTable, Place, Scenario
from fgnav_sim.simulate import simulate

LIVELY = Motion(
    path=Straight(speed_mps=100.0, climb_mps=-12.0),
    roll=Sine(amplitude_deg=20.0),
    pitch=Sine(amplitude_deg=5.0, offset_deg=-7.0),
    yaw=Sine(amplitude_deg=5.0),
)
GNSS = GnssTable(rate_hz=5.0, code_noise_m=0.3, elevation_weights="uniform")
FIXES = FixesTable(rate_hz=5.0, velocity_noise_mps=0.02)
BEACON = PhotodetectorTable(landmark=Place(latitude_deg=40.3500, height_m=300.0))  # 2.2 km ahead


def flown(seed=4, **scenario):
    made = Scenario(**{"duration_s": 10.0, "motion": LIVELY, **scenario})
    return simulate(made, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def array_flight():
    return flown(gnss=GNSS)


class Partial:
    """True integers, but only at every third epoch."""

    name = "partial"

    def __call__(self, differences, flight):
        whole = Truth()(differences, flight)
        keep = (np.arange(len(differences.t_s)) % 3 == 0)[:, None, None]
        fixed = whole.fixed & keep
        return replace(whole, cycles=np.where(fixed, whole.cycles, 0), fixed=fixed)


class Nothing(Partial):
    """No integer at all."""

    def __call__(self, differences, flight):
        whole = Truth()(differences, flight)
        none = np.zeros_like(whole.fixed)
        return replace(whole, cycles=np.zeros_like(whole.cycles), fixed=none)


def true_attitude(flight, t_s):
    row = np.searchsorted(flight.truth.t_s, t_s - 1e-6)
    np.testing.assert_allclose(flight.truth.t_s[row], t_s, atol=1e-6)
    return flight.truth.R_nb[row]


def euler_rmse_deg(flight, estimate):
    truth = rotations.to_euler(true_attitude(flight, estimate.t_s))
    error = rotations.wrap(rotations.to_euler(estimate.R_nb) - truth)
    return np.degrees(np.sqrt((error**2).mean(axis=0)))


def test_array_with_true_integers_gives_attitude_at_every_epoch(array_flight):
    estimate = ClosedForm(resolver=Truth())(array_flight)
    assert estimate.n_epochs == len(estimate.t_s) == 50
    # Some times the bound of .65 .16 .08 degrees of six satellites.
    assert (euler_rmse_deg(array_flight, estimate) < [3.5, 0.7, 0.4]).all()
    assert estimate.integers.resolver == "truth"
    assert estimate.unobservable == ()


def test_position_is_that_of_the_body_and_not_of_the_antenna():
    far = ((3.0, -4.0, 5.0), (3.0, -3.0, 5.0), (4.0, -4.0, 5.0))
    flight = flown(gnss=replace_noise(code=0.01), antennas_b_m=far)
    estimate = ClosedForm(resolver=Truth())(flight)
    truth_n_m = flight.truth.p_n_m[np.searchsorted(flight.truth.t_s, estimate.t_s - 1e-6)]
    # Broadcast against itself with 1 cm of code: what is left is far below the lever arm of 7 m.
    assert np.sqrt(((estimate.p_n_m - truth_n_m) ** 2).mean()) < 1.0
    assert estimate.position_covariance_m2.shape == (50, 3, 3)
    assert any(note.code == "W504" for note in estimate.notes)


def replace_noise(code):
    return GnssTable(rate_hz=5.0, code_noise_m=code, atmosphere=False)


def test_epochs_without_two_baselines_are_counted(array_flight):
    estimate = ClosedForm(resolver=Partial())(array_flight)
    assert (len(estimate.t_s), estimate.n_epochs) == (17, 50)
    counts = {loss.reason: loss.count for loss in estimate.unused if loss.what == "epoch"}
    assert counts == {"no two vectors out of line": 33}


def test_no_fixed_baseline_at_all_is_no_solution(array_flight):
    with pytest.raises(NoSolutionError, match="attitude: no vector at any of 50 epochs"):
        ClosedForm(resolver=Nothing())(array_flight)


def test_two_antennas_leave_roll_open_by_name():
    flight = flown(gnss=GNSS, antennas_b_m=((0.0, 0.0, 0.0), (1.6, 0.0, 0.0)))
    estimate = ClosedForm(resolver=Truth())(flight)
    assert estimate.unobservable == ("roll",)
    np.testing.assert_allclose(rotations.to_euler(estimate.R_nb)[:, 0], 0, atol=1e-9)
    assert (euler_rmse_deg(flight, estimate)[1:] < 0.6).all()


def test_two_antennas_have_their_roll_from_an_accelerometer_and_not_from_a_few_sights():
    two = ((0.0, 0.0, 0.0), (1.6, 0.0, 0.0))
    by_force = ClosedForm(resolver=Truth())(flown(gnss=GNSS, antennas_b_m=two, imu=ImuTable()))
    assert by_force.unobservable == ()
    assert len(by_force.t_s) == 48  # both ends lack an acceleration
    beacon = msgspec.structs.replace(BEACON, range_m=1500.0)  # from the eighth second on
    by_sight = ClosedForm(resolver=Truth())(
        flown(gnss=GNSS, antennas_b_m=two, photodetector=beacon)
    )
    assert by_sight.unobservable == ("roll",)
    assert len(by_sight.t_s) == 50


def test_specific_force_and_line_of_sight_replace_an_array():
    flight = flown(fixes=FIXES, imu=ImuTable(), photodetector=BEACON)
    estimate = ClosedForm(moves_forward=False)(flight)
    assert "Pairs: 41 of specific force, 41 of line of sight." in estimate.notes
    assert estimate.unobservable == ()
    # Velocity noise of 0.02 m/s over 0.4 s is 0.07 m/s2: 0.4 degrees of gravity, which is roll.
    # The line of sight holds the other two to its own 1 mrad.
    assert (euler_rmse_deg(flight, estimate) < [0.6, 0.12, 0.15]).all()
    assert estimate.available > 0.7


def test_velocity_stands_for_the_nose_where_nothing_else_is_left():
    flight = flown(fixes=FIXES, imu=ImuTable(), motion=Motion(path=Straight(speed_mps=50.0)))
    estimate = ClosedForm()(flight)
    assert any(note.startswith("Velocity stands for x_b at 48 epochs") for note in estimate.notes)
    assert estimate.attitude_covariance_rad2 is None  # nobody states the sideslip
    assert (euler_rmse_deg(flight, estimate) < 2.0).all()


def test_specific_force_alone_leaves_yaw_open_by_name():
    flight = flown(fixes=FIXES, imu=ImuTable())
    estimate = ClosedForm(moves_forward=False)(flight)
    assert estimate.unobservable == ("yaw",)
    assert (euler_rmse_deg(flight, estimate)[:2] < 3.0).all()


def test_a_single_antenna_is_placed_by_its_code():
    flight = flown(gnss=GNSS, antennas_b_m=((0.0, 0.0, 0.0),), photodetector=BEACON)
    estimate = ClosedForm()(flight)
    assert estimate.n_epochs == 50
    assert estimate.p_n_m is not None
    assert any("of line of sight," in n and "of velocity" in n for n in estimate.notes)


def test_a_flight_that_shows_no_vector_is_no_solution():
    flight = flown(fixes=FIXES)
    still = replace(
        flight, fixes=(replace(flight.fixes[0], v_n_mps=None, velocity_sigma_mps=None),)
    )
    with pytest.raises(NoSolutionError, match="attitude: no vector at any of 50 ep"):
        ClosedForm()(still)


def test_a_flight_without_any_position_is_no_solution(array_flight):
    empty = Flight(name="empty", start_gps_s=0.0, origin=array_flight.origin)
    with pytest.raises(NoSolutionError, match="flight empty has no antenna array, no raw data"):
        ClosedForm()(empty)


def test_velocity_does_not_join_a_line_of_sight_that_it_follows():
    flight = flown(fixes=FIXES, imu=ImuTable(), photodetector=BEACON)
    estimate = ClosedForm()(flight)
    # Both ends lack an acceleration, so specific force: the two others lie 5 degrees apart.
    assert (len(estimate.t_s), estimate.n_epochs) == (48, 50)
    roll_deg, *_ = np.degrees(
        rotations.to_euler(true_attitude(flight, estimate.t_s)) - rotations.to_euler(estimate.R_nb)
    ).T
    assert np.abs(roll_deg).max() < 2.0
