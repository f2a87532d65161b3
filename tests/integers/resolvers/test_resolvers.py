import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fgnav.checks import BadInputError
from fgnav.geometry import rotations
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.integers.resolvers.rounding import Rounding
from fgnav.integers.resolvers.truth import Truth, attitude_at, true_integers
from fgnav.types.flight import Flight
from fgnav.types.flight import Truth as FlightTruth
from fgnav.types.integers import fixed_ranges_m
from tests.integers.arrays import make


def without(made, **changed):
    """The same differences with some fields changed."""
    d = made.differences
    fields = {name: getattr(d, name) for name in d.__slots__ if name != "__weakref__"}
    return type(d)(**{**fields, **changed})


def test_rounding_is_right_where_code_is_far_better_than_a_cycle():
    made = make(np.random.default_rng(1), epochs=3, code_m=0.005)
    found = Rounding()(made.differences, made.flight)
    assert_array_equal(found.cycles, made.cycles)
    assert_array_equal(found.fixed, made.differences.resolvable)
    assert np.isnan(found.ratio).all()
    assert found.unused == ()


def test_integers_at_references_are_neither_fixed_nor_missing():
    made = make(np.random.default_rng(2), code_m=0.1, satellites=(8,))
    found = Lambda()(made.differences, made.flight)
    assert not found.fixed[:, :, 0].any()
    ranges_m = fixed_ranges_m(made.differences, found)
    modelled_m = made.differences.array_m(made.R_nb)
    assert np.abs(ranges_m - modelled_m).max() < 6 * 2 * 3e-3  # six sigma of four links


@pytest.mark.parametrize("resolver", [Rounding(), Lambda(), Lambda(joint=False)])
def test_phase_without_code_is_counted_and_not_fixed(resolver):
    made = make(np.random.default_rng(3), satellites=(8,), code_m=0.1)
    code_m = made.differences.code_m.copy()
    code_m[0, 2, 4:6] = np.nan
    found = resolver(without(made, code_m=code_m), made.flight)
    assert not found.fixed[0, 2, 4:6].any()
    assert (found.cycles[0, 2, 4:6] == 0).all()
    assert [(loss.reason, loss.count) for loss in found.unused] == [("phase without code", 2)]


@pytest.mark.parametrize("joint", [True, False])
def test_every_link_of_lambda_is_fixed_or_counted(joint):
    rng = np.random.default_rng(4)
    missing = rng.random((30, 8, 8)) < 0.3
    made = make(rng, epochs=30, satellites=(5, 3), missing=missing)
    found = Lambda(joint=joint, ratio_min=3.0)(made.differences, made.flight)
    links = made.differences.resolvable
    assert found.fixed.sum() + sum(loss.count for loss in found.unused) == links.sum()
    reasons = " ".join(loss.reason for loss in found.unused)
    assert "ratio below 3" in reasons
    if not joint:
        assert "too few satellites" in reasons


def test_ratio_test_keeps_what_passes_and_drops_the_rest():
    made = make(np.random.default_rng(5), epochs=200, code_m=0.3)
    every = Lambda()(made.differences, made.flight)
    tested = Lambda(ratio_min=2.0)(made.differences, made.flight)
    passes = every.ratio >= 2.0
    assert 0 < passes.sum() < passes.size
    assert_array_equal(tested.fixed, every.fixed & passes[:, :, None])
    assert_array_equal(tested.ratio, every.ratio)
    right = (every.cycles == made.cycles).all(axis=2)
    assert right[passes].mean() > right.mean()


def test_vague_float_solution_is_given_up_and_counted(monkeypatch):
    from fgnav.integers.ils import affine
    from fgnav.integers.resolvers import lambda_

    def unfinished(differences, **options):
        found = affine.search_array(differences, **options)
        status = np.full_like(found.status, affine.UNFINISHED)
        return found._replace(status=status, fixed=np.zeros_like(found.fixed))

    monkeypatch.setattr(lambda_, "search_array", unfinished)
    made = make(np.random.default_rng(6))
    found = Lambda()(made.differences, made.flight)
    assert not found.fixed.any()
    assert [(loss.count, loss.reason) for loss in found.unused] == [
        (35, "integer search given up: float solution too vague")
    ]


@pytest.mark.parametrize("ratio_min", [0.5, np.nan, np.inf])
def test_ratio_that_tests_nothing_is_refused(ratio_min):
    with pytest.raises(BadInputError, match="ratio_min: must be 1 or more, or None"):
        Lambda(ratio_min=ratio_min)


def test_truth_gives_the_integers_that_made_the_phase():
    made = make(np.random.default_rng(7), epochs=20, satellites=(5, 5), code_m=10.0, sine=True)
    found = Truth()(made.differences, made.flight)
    assert_array_equal(found.cycles, made.cycles)
    assert_array_equal(found.cycles, true_integers(made.differences, made.R_nb))


def test_truth_needs_truth():
    made = make(np.random.default_rng(8))
    bare = Flight(name="bare", start_gps_s=0.0, origin=made.flight.origin)
    with pytest.raises(BadInputError, match="flight bare: integers 'truth' need truth"):
        Truth()(made.differences, bare)


def test_epochs_outside_truth_are_counted_and_not_fixed():
    made = make(np.random.default_rng(9), epochs=5)
    whole = made.flight.truth
    short = FlightTruth(
        t_s=whole.t_s[1:4], p_n_m=whole.p_n_m[1:4], v_n_mps=whole.v_n_mps[1:4], R_nb=whole.R_nb[1:4]
    )
    flight = Flight(
        name="short",
        start_gps_s=0.0,
        origin=made.flight.origin,
        antennas=made.flight.antennas,
        truth=short,
    )
    found = Truth()(made.differences, flight)
    assert_array_equal(found.fixed.any(axis=(1, 2)), [False, True, True, True, False])
    assert [(loss.reason, loss.count) for loss in found.unused] == [
        ("truth does not cover the epoch", 70)
    ]


def test_attitude_between_samples_turns_evenly():
    turn_rad = np.array([0.3, -0.2, 0.5])
    R = rotations.exp(np.array([[1.0, 2.0, -0.5]]))[0]
    t_s = np.array([0.0, 2.0, 4.0])
    R_nb = R @ rotations.exp(t_s[:, None] * turn_rad)
    truth = FlightTruth(t_s=t_s, p_n_m=np.zeros((3, 3)), v_n_mps=np.zeros((3, 3)), R_nb=R_nb)
    asked_s = np.array([-1.0, 0.0, 0.7, 2.0, 3.1, 4.0, 4.0005, 9.0])
    found, covered = attitude_at(truth, asked_s)
    expected = R @ rotations.exp(np.clip(asked_s, 0, 4)[:, None] * turn_rad)
    assert np.abs(found - expected).max() < 1e-12
    assert_array_equal(covered, [False, True, True, True, True, True, True, False])


def test_attitude_of_a_single_sample_is_that_sample():
    truth = FlightTruth(
        t_s=[1.0], p_n_m=np.zeros((1, 3)), v_n_mps=np.zeros((1, 3)), R_nb=np.eye(3)[None]
    )
    found, covered = attitude_at(truth, np.array([0.0, 1.0]))
    assert_array_equal(found, np.stack([np.eye(3)] * 2))
    assert_array_equal(covered, [False, True])
