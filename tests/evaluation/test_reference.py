import numpy as np

from fgnav.evaluation.reference import common_epochs, covered, truth_at
from fgnav.geometry import rotations
from fgnav.types.flight import Truth
from tests.evaluation.conftest import true_state


def test_truth_between_samples_follows_a_steady_turn(flight):
    t_s = np.linspace(0.013, 9.97, 301)
    got, want = truth_at(flight.truth, t_s), true_state(t_s)
    turn_rad = rotations.log(rotations.transpose(got.R_nb) @ want.R_nb)
    assert np.abs(turn_rad).max() < 1e-12  # constant rate about one axis is met exactly
    # A cubic over 0.1 s of an arc with 9 m/s3 change of acceleration per second: h^4/384 * p''''
    np.testing.assert_allclose(got.p_n_m, want.p_n_m, rtol=0, atol=1e-4 / 384 * 100 * 0.3**3 * 1.01)
    np.testing.assert_allclose(got.v_n_mps, want.v_n_mps, rtol=0, atol=0.01 / 8 * 9.1)


def test_truth_at_its_own_samples_is_returned_as_it_is(flight):
    got = truth_at(flight.truth, flight.truth.t_s)
    np.testing.assert_allclose(got.p_n_m, flight.truth.p_n_m, rtol=0, atol=1e-9)
    np.testing.assert_allclose(got.v_n_mps, flight.truth.v_n_mps, rtol=0, atol=1e-12)
    np.testing.assert_allclose(got.R_nb, flight.truth.R_nb, rtol=0, atol=1e-14)


def test_nothing_is_known_outside_the_span_or_inside_a_gap():
    t_s = np.concatenate([np.arange(0, 3, 0.1), np.arange(5, 8, 0.1)])
    truth = true_state(t_s)
    asked_s = np.array([-0.01, 0.0, 2.85, 2.9, 3.5, 4.99, 5.0, 5.05, 7.9004, 7.91])
    want = [False, True, True, True, False, False, True, True, True, False]
    assert covered(truth, asked_s).tolist() == want


def test_a_single_sample_covers_only_its_own_time():
    truth = true_state(np.array([2.0]))
    assert covered(truth, np.array([1.0, 2.0, 3.0])).tolist() == [False, True, False]
    assert truth_at(truth, np.array([2.0])).p_n_m.tolist() == truth.p_n_m.tolist()


def test_no_sample_covers_nothing():
    truth = Truth(
        t_s=np.empty(0), p_n_m=np.empty((0, 3)), v_n_mps=np.empty((0, 3)), R_nb=np.empty((0, 3, 3))
    )
    assert not covered(truth, np.array([0.0])).any()
    assert len(truth_at(truth, np.empty(0)).t_s) == 0


def test_common_epochs_forgive_rounding_in_the_last_digits():
    of_a, of_b = common_epochs(np.array([0.1, 0.2, 0.4]), np.array([0.2 + 1e-9, 0.3, 0.4]))
    assert of_a.tolist() == [1, 2]
    assert of_b.tolist() == [0, 2]
