from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from fgnav.checks import BadInputError
from fgnav.integers import integer_least_squares
from fgnav.integers.ils.partial import partial_integer_least_squares
from fgnav.integers.resolvers.lambda_ import Lambda
from tests.integers.arrays import make
from tests.integers.resolvers.test_resolvers import without


def baseline(rng, n=6, code=2.0):
    """Float ambiguities whose decorrelated ones are partly precise, around true integers."""
    A = rng.normal(size=(n, 3))
    Q = np.diag(rng.choice([0.003, 0.03, 0.3], n)) + code * A @ A.T
    true = rng.integers(-(10**6), 10**6, n)
    return true, true + np.linalg.cholesky(Q) @ rng.normal(size=n), Q


def test_all_are_fixed_where_all_can_be_trusted():
    rng = np.random.default_rng(1)
    true = rng.integers(-100, 100, 5)
    Q = 1e-4 * (np.eye(5) + 1)
    fix = partial_integer_least_squares(true + 0.01, Q, 0.999)
    assert fix.fixed.all()
    nearest = integer_least_squares(true + 0.01, Q)[0][0]
    assert_array_equal(fix.combinations @ nearest, fix.integers)
    assert abs(np.linalg.det(fix.combinations)) == pytest.approx(1.0)


def test_nothing_is_fixed_where_nothing_can_be_trusted():
    a, Q = np.array([0.3, 0.8]), np.diag([4.0, 9.0])
    fix = partial_integer_least_squares(a, Q, 0.9)
    assert fix.combinations.shape == (0, 2)
    assert not fix.fixed.any()
    assert fix.success == 1.0


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), success_min=st.sampled_from([0.5, 0.9, 0.999]))
def test_no_neighbour_of_the_fixed_integers_is_nearer(seed, success_min):
    _, a, Q = baseline(np.random.default_rng(seed))
    fix = partial_integer_least_squares(a, Q, success_min)
    assert fix.success >= success_min
    p = len(fix.integers)
    around = fix.integers + np.array(list(product((-1, 0, 1), repeat=p))).reshape(3**p, p)
    off = around - fix.combinations @ a
    metric = fix.combinations @ Q @ fix.combinations.T
    norms = np.einsum("ki,ki->k", off, np.linalg.solve(metric, off.T).T)
    assert norms[len(norms) // 2] <= norms.min() * (1 + 1e-6)


def test_what_is_fixed_is_right_as_often_as_it_says():
    rng = np.random.default_rng(7)
    right, fixed = [], []
    for _ in range(400):
        true, a, Q = baseline(rng)
        fix = partial_integer_least_squares(a, Q, 0.95)
        right.append(bool((fix.combinations @ true == fix.integers).all()))
        fixed.append(len(fix.integers))
    assert 0 < np.mean(fixed) < 6
    assert np.mean(right) > 0.95 - 3 * np.sqrt(0.05 * 0.95 / 400)


@pytest.mark.parametrize("success_min", [-0.1, 1.1, np.nan])
def test_success_rate_that_is_no_probability_is_refused(success_min):
    with pytest.raises(BadInputError, match="success_min: must be between 0 and 1, got"):
        partial_integer_least_squares([0.1], [[1.0]], success_min)


def test_bad_problem_is_refused_by_name():
    with pytest.raises(BadInputError, match="positive definite"):
        partial_integer_least_squares([0.1], [[-1.0]], 0.9)


def vague_newcomer():
    """Twenty epochs in which the code of one satellite of eight is 40 times worse."""
    made = make(np.random.default_rng(3), epochs=20, satellites=(8,), code_m=0.02)
    variance = made.differences.code_variance_m2.copy()
    variance[:, 5] *= 1600.0
    phase = made.differences.phase_variance_m2.copy()
    phase[:, 5] *= 1600.0
    noise = np.random.default_rng(4).normal(size=(2, 20, 7))
    code_m, phase_m = made.differences.code_m.copy(), made.differences.phase_m.copy()
    code_m[:, :, 5] += 0.8 * noise[0]
    phase_m[:, :, 5] += 0.12 * noise[1]
    worse = without(
        made, code_m=code_m, phase_m=phase_m, code_variance_m2=variance, phase_variance_m2=phase
    )
    return made, worse


@pytest.mark.parametrize("joint", [True, False])
def test_lambda_fixes_what_it_can_trust_and_counts_the_rest(joint):
    made, worse = vague_newcomer()
    found = Lambda(joint=joint, success_min=0.99)(worse, made.flight)
    others = np.delete(np.arange(8), [0, 5])
    assert found.fixed[:, :, others].mean() > 0.95
    assert not found.fixed[:, :, 5].any()
    assert_array_equal(found.cycles[found.fixed], made.cycles[found.fixed])
    (loss,) = found.unused
    assert loss.reason == "too vague for a success rate of 0.99"
    assert found.fixed.sum() + loss.count == worse.resolvable.sum()
    assert (found.wrong_probability <= (0.01 if joint else 0.07)).all()


@pytest.mark.parametrize("success_min", [0.0, 1.0, np.nan])
def test_lambda_refuses_a_success_rate_without_meaning(success_min):
    with pytest.raises(BadInputError, match="success_min: must be between 0 and 1, or None"):
        Lambda(success_min=success_min)
