import json
from dataclasses import replace
from time import sleep

import numpy as np
import pytest

import fgnav
from fgnav.checks import BadInputError, Unused
from fgnav.evaluation.comparison import compare
from fgnav.geometry import rotations
from tests.evaluation.conftest import Lost, Off, true_state

DEG = np.pi / 180


def test_rmse_of_the_angle_is_the_length_of_a_constant_tangent(flight):
    tangent = np.array([2.0, -1.0, 2.0]) * DEG
    score = compare(flight, [Off("tilted", tangent, position_m=0.5)])["tilted"].score
    assert score.attitude_rmse_deg == pytest.approx(3.0, abs=1e-9)
    assert score.position_rmse_m == pytest.approx(0.5, abs=1e-9)
    assert score.velocity_rmse_mps == pytest.approx(1.0, abs=1e-9)


def test_euler_errors_are_to_first_order_what_the_jacobian_says(flight):
    tangent = np.array([3e-6, -2e-6, 5e-6])
    errors = compare(flight, [Off("tilted", tangent)])["tilted"].errors
    J = rotations.euler_jacobian(flight.truth.R_nb[:100])
    np.testing.assert_allclose(errors.euler_rad, J @ tangent, rtol=0, atol=1e-10)
    np.testing.assert_allclose(errors.tangent_b_rad, -tangent + 0 * errors.euler_rad, atol=1e-12)


def test_yaw_errors_across_the_south_are_wrapped(flight):
    # After 10.47 s of 0.3 rad/s yaw passes 180 degrees; the estimate is a degree behind it.
    t_s = np.arange(0, 12, 0.1)
    longer = replace(flight, truth=true_state(t_s))
    estimate = Off("behind", t_s=t_s)(longer)
    roll, pitch, yaw = rotations.to_euler(estimate.R_nb).T
    behind = Off("behind", t_s=t_s, more={"R_nb": rotations.from_euler(roll, pitch, yaw - DEG)})
    rmse = compare(longer, [behind])["behind"].score.rmse_deg
    assert rmse.yaw == pytest.approx(1.0, abs=1e-9)
    assert rmse.roll == pytest.approx(0.0, abs=1e-9)


def test_mean_nees_of_an_honest_covariance_is_three(flight):
    rng = np.random.default_rng(3)
    t_s = np.arange(0, 10, 0.002)
    sigma_rad = np.array([0.6, 0.2, 0.1]) * DEG
    tangent = sigma_rad * rng.standard_normal((len(t_s), 3))
    covariance = np.tile(np.diag(sigma_rad**2), (len(t_s), 1, 1))
    honest = Off("honest", tangent, t_s=t_s, more={"attitude_covariance_rad2": covariance})
    nees = compare(flight, [honest])["honest"].score.attitude_nees_mean
    assert abs(nees - 3) < 4 * np.sqrt(6 / len(t_s))  # chi-square with 3 dof has variance 6


def test_sigmas_of_a_reference_count_beside_the_estimate_s(flight):
    """The body is pitched and rolled, so that Euler angles are not axes of the body."""
    rng = np.random.default_rng(4)
    t_s = np.arange(0, 10, 0.002)
    sigma_rad = np.array([0.6, 0.2, 0.1]) * DEG
    covariance = np.tile(np.diag(sigma_rad**2), (len(t_s), 1, 1))
    k = len(flight.truth.t_s)
    euler_sigma_rad = np.array([0.3, 0.5, 2.0]) * DEG
    J = np.linalg.inv(rotations.euler_jacobian(flight.truth.R_nb[:1]))[0]  # the same all along
    tangent = sigma_rad * rng.standard_normal((len(t_s), 3))
    tangent += (euler_sigma_rad * rng.standard_normal((len(t_s), 3))) @ J.T
    truth = replace(
        flight.truth,
        source="filter",
        euler_sigma_rad=np.tile(euler_sigma_rad, (k, 1)),
        position_sigma_m=np.full((k, 3), 2.0),
        velocity_sigma_mps=np.full((k, 3), 0.5),
    )
    more = {"attitude_covariance_rad2": covariance}
    more |= dict.fromkeys(("position_covariance_m2", "velocity_covariance_m2ps2"), 0 * covariance)
    method = Off("one", tangent, 4.0, t_s=t_s, more=more)
    outcome = compare(replace(flight, truth=truth), [method])
    score = outcome["one"].score
    assert abs(score.attitude_nees_mean - 3) < 4 * np.sqrt(6 / len(t_s))
    assert score.position_nees_mean == pytest.approx((4.0 / 2.0) ** 2)
    assert score.velocity_nees_mean == pytest.approx((8.0 / 0.5) ** 2, rel=1e-4)  # the turn
    content = outcome.to_dict()
    assert content["judged_by"] == "reference"
    assert content["counted_sigmas"] == ("position", "velocity", "attitude")
    assert compare(flight, [method]).judged_by == "truth"


def test_an_epoch_with_a_broken_covariance_is_left_out_of_the_nees_and_counted(flight):
    covariance = np.tile(np.eye(3), (100, 1, 1))
    covariance[7] = np.diag([1.0, 1.0, -1.0])
    broken = Off("broken", (1.0, 0, 0), more={"attitude_covariance_rad2": covariance})
    score = compare(flight, [broken])["broken"].score
    assert score.attitude_nees_mean == pytest.approx(1.0)
    reason = "not in the NEES: covariance not positive definite"
    assert Unused(what="epoch", reason=reason, count=1) in score.unused


def test_position_and_velocity_are_held_against_their_covariances(flight):
    wide = np.tile(np.diag([1.0, 1.0, 4.0]), (100, 1, 1))
    more = {"position_covariance_m2": wide, "velocity_covariance_m2ps2": wide}
    score = compare(flight, [Off("off", position_m=3.0, more=more)])["off"].score
    assert score.position_nees_mean == pytest.approx(9 / 4, rel=1e-3)
    assert score.velocity_nees_mean == pytest.approx(36 / 4, rel=1e-3)
    bare = compare(flight, [Off("bare", position_m=3.0)])["bare"].score
    assert bare.position_nees_mean is None


def test_epochs_outside_the_truth_are_not_judged_but_counted(flight):
    early = Off("early", t_s=np.arange(-1, 10, 0.1))
    method = compare(flight, [early])["early"]
    assert len(method.errors.t_s) == 100
    reason = "not judged: outside the truth's time span or in a gap of it"
    assert Unused(what="epoch", reason=reason, count=10) in method.score.unused


def test_unobservable_angles_have_no_figure(flight):
    blind = Off("blind", more={"unobservable": ("roll",)}, position_m=1.0)
    score = compare(flight, [blind])["blind"].score
    assert score.rmse_deg.roll is None
    assert score.rmse_deg.yaw is not None
    assert score.attitude_rmse_deg is None
    assert score.attitude_nees_mean is None
    assert score.position_rmse_m == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["attitude", "rotation about the body axis [0.6, 0.8, 0.0]"])
def test_a_rotation_about_no_body_axis_takes_all_three_angles(flight, name):
    blind = Off("blind", more={"unobservable": (name,)})
    rmse = compare(flight, [blind])["blind"].score.rmse_deg
    assert (rmse.roll, rmse.pitch, rmse.yaw) == (None, None, None)


def test_a_method_without_solution_is_named_and_the_others_go_on(flight):
    comparison = compare(flight, [Lost(), Off("fine")])
    assert comparison["lost"].score.failure == "yaw: not in the data"
    assert comparison["lost"].score.available == 0
    assert comparison["lost"].estimate is None
    assert comparison["fine"].score.failure is None
    assert comparison.epochs == 100


def test_without_truth_methods_are_held_against_each_other(flight):
    here = Off("here", position_m=0.0)
    there = Off("there", np.array([0, 0, DEG]), position_m=2.0, t_s=np.arange(5, 15, 0.1))
    comparison = compare(replace(flight, truth=None), [here, there, Off("third")])
    assert [d.methods for d in comparison.differences] == [
        ("here", "there"),
        ("here", "third"),
        ("there", "third"),
    ]
    first = comparison.differences[0]
    assert first.epochs == 50
    assert first.attitude_rms_deg == pytest.approx(1.0, abs=1e-9)
    assert first.position_rms_m == pytest.approx(2.0, abs=1e-9)
    assert comparison.differences[1].position_rms_m is None
    assert comparison["here"].score.rmse_deg.yaw is None
    assert comparison["here"].errors is None


def test_with_truth_there_are_no_differences(flight):
    assert compare(flight, [Off("a"), Off("b")]).differences == ()


def test_json_has_the_promised_keys_and_null_for_what_is_unknown(flight):
    comparison = fgnav.compare(flight, [Off("fine"), Lost()])
    content = json.loads(json.dumps(comparison.to_dict(), allow_nan=False))
    assert content["flight"] == "turn"
    assert content["epochs"] == 100
    unknown = {"roll": None, "pitch": None, "yaw": None}
    assert content["bound"] == {"crlb_deg": unknown, "posterior_deg": unknown}
    fine = content["methods"]["fine"]
    assert set(fine["rmse_deg"]) == {"roll", "pitch", "yaw"}
    assert fine["position_rmse_m"] is None
    assert fine["integers"] is None
    assert fine["available"] == 1.0
    assert isinstance(fine["seconds"], float)
    assert content["methods"]["lost"]["failure"] == "yaw: not in the data"


def test_an_estimator_gets_a_flight_object_of_its_own(flight):
    seen = []

    class Keeper:
        name = "keeper"

        def __call__(self, given):
            seen.append(given)
            return Off("keeper")(given)

    compare(flight, [Keeper()])
    assert seen[0] is not flight
    assert seen[0].truth is flight.truth


def test_methods_are_judged_by_what_the_first_one_made_of_its_flight(flight, monkeypatch):
    """Differences are kept with the flight object; of another's no method would profit."""
    seen, judged = [], []

    class Keeper:
        def __init__(self, name):
            self.name = name

        def __call__(self, given):
            seen.append(given)
            return Off(self.name)(given)

    monkeypatch.setattr("fgnav.evaluation.comparison._differences_of", judged.append)
    compare(flight, [Keeper("first"), Keeper("second")])
    assert judged == seen[:1]
    assert seen[1] is not seen[0]


def test_compilation_of_kernels_is_in_nobody_s_time(flight):
    from numba.core.event import trigger_event

    slept = 0.2

    class Compiles:
        name = "compiles"

        def __call__(self, given):
            with trigger_event("numba:compile"):
                sleep(slept)
            return Off("compiles")(given)

    charged = compare(flight, [Compiles()])["compiles"].score.seconds
    assert 0 < charged < slept  # whatever the machine: what was slept is not charged


def test_no_estimator_is_an_error(flight):
    with pytest.raises(BadInputError, match="compare: no estimators; pass one or more"):
        compare(flight, [])


def test_two_estimators_of_one_name_are_an_error(flight):
    with pytest.raises(BadInputError, match="two estimators are named 'a'; give each its own"):
        compare(flight, [Off("a"), Off("a")])


def test_asking_for_a_method_that_did_not_run_is_an_error(flight):
    with pytest.raises(BadInputError, match="method 'b': not one of a"):
        compare(flight, [Off("a")])["b"]
