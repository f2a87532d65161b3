import json
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from fgnav.checks import BadInputError
from fgnav.integers import integer_least_squares
from fgnav.integers.ils.search import (
    OK,
    UNFINISHED,
    solve,
    solve_subset,
)

seeds = st.integers(0, 2**32 - 1)


def problem(seed, n, spread):
    """Random float vector and covariance whose conditional variances spread over 10^spread."""
    rng = np.random.default_rng(seed)
    d = 10 ** rng.uniform(-spread, 0.5, n)
    L = np.tril(rng.normal(size=(n, n)) * 2, -1) + np.eye(n)
    Q = L.T @ np.diag(d) @ L
    return rng.uniform(-5, 5, n), (Q + Q.T) / 2


def brute_force(a, Q, count, within):
    """All integer vectors near the float one, best first; valid where their box holds the best."""
    reach = np.sqrt(within * np.diag(Q))
    axes = [np.arange(np.ceil(x - r), np.floor(x + r) + 1) for x, r in zip(a, reach, strict=True)]
    z = np.array(list(product(*axes)))
    norms = np.einsum("ki,ij,kj->k", a - z, np.linalg.inv(Q), a - z)
    best = np.argsort(norms)[:count]
    return z[best].astype(int), norms[best]


@pytest.mark.parametrize("table", ["rtklib_utest", "delft", "sidereon_golden", "dd_rtklib_oracle"])
def test_published_problems_give_the_published_integers_and_norms(shared, table):
    cases = json.loads((shared / "integers" / f"lambda_{table}.json").read_text())["cases"]
    for case in cases:
        published = case.get("sq_residuals_expected") or case["sq_residuals"]
        integers, norms = integer_least_squares(
            case["float_ambiguities"], case["covariance"], len(case["fixed"])
        )
        assert_array_equal(integers, case["fixed"], err_msg=case["name"])
        # RTKLIB's unit test prints seven digits; its own tolerance is 1e-4
        assert_allclose(norms, published, rtol=1e-6, atol=0, err_msg=case["name"])


@settings(max_examples=200, deadline=None)
@given(seed=seeds, n=st.integers(1, 4), spread=st.sampled_from([0.0, 1.0, 2.0]))
def test_search_finds_what_brute_force_finds(seed, n, spread):
    a, Q = problem(seed, n, spread)
    integers, norms = integer_least_squares(a, Q, 3)
    # every vector of squared norm c lies in the box |a_i - z_i| <= sqrt(c Q_ii)
    box = np.prod(2 * np.sqrt(norms[-1] * np.diag(Q)) + 1)
    if box > 2e5:
        return
    expected, expected_norms = brute_force(a, Q, 3, norms[-1] * (1 + 1e-9))
    assert_allclose(norms, expected_norms, rtol=1e-8, atol=1e-12)
    if np.diff(expected_norms).min() > 1e-6:
        assert_array_equal(integers, expected)


@settings(max_examples=50, deadline=None)
@given(seed=seeds, n=st.integers(1, 12))
def test_integer_shift_moves_the_answer_and_nothing_else(seed, n):
    a, Q = problem(seed, n, 2.0)
    a = np.round(a * 2**20) / 2**20  # so that adding 1e9 loses no bit
    shift = np.random.default_rng(seed + 1).integers(-(10**9), 10**9, n)
    integers, norms = integer_least_squares(a, Q)
    shifted, shifted_norms = integer_least_squares(a + shift, Q)
    assert_array_equal(shifted, integers + shift)
    assert_allclose(shifted_norms, norms, rtol=1e-9)


@settings(max_examples=50, deadline=None)
@given(seed=seeds, n=st.integers(2, 12))
def test_unimodular_transform_of_the_problem_transforms_the_answer(seed, n):
    a, Q = problem(seed, n, 1.0)
    rng = np.random.default_rng(seed + 2)
    Z = np.eye(n)
    for _ in range(2 * n):
        i, j = rng.choice(n, 2, replace=False)
        Z[i] += rng.integers(-2, 3) * Z[j]
    Z = Z[rng.permutation(n)]
    integers, norms = integer_least_squares(a, Q)
    transformed, transformed_norms = integer_least_squares(Z @ a, Z @ Q @ Z.T)
    # the transform worsens the condition; what double precision can keep follows it
    precision = max(1e-9, 100 * np.finfo(float).eps * np.linalg.cond(Z @ Q @ Z.T))
    assert_allclose(transformed_norms, norms, rtol=precision)
    if np.ptp(norms) > 2 * precision * norms[1]:
        assert_array_equal(transformed[0], Z @ integers[0])


@settings(max_examples=60, deadline=None)
@given(
    seed=seeds,
    n=st.integers(1, 60),
    scale=st.sampled_from([1e-12, 1.0, 1e10]),
    sign=st.sampled_from([-1.0, 1.0]),
)
def test_integers_near_a_precise_float_are_found_whatever_scale_and_correlation(
    seed, n, scale, sign
):
    # one sigma of 1e-2 in every direction, then stretched: code's directions far beyond a cycle
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, min(n, 3)))
    A[1:] *= sign
    precise = 1e-4 * (np.eye(n) + 1.0)
    true = rng.integers(-(10**6), 10**6, n)
    noise = np.linalg.cholesky(precise) @ rng.normal(size=n)
    stretch = A @ rng.normal(size=A.shape[1]) if n > 8 else 0.0
    metric = precise + (A @ A.T if n > 8 else 0.0)
    integers, norms = integer_least_squares(true + noise + stretch, scale * metric, 2)
    assert_array_equal(integers[0], true)
    assert norms[0] < norms[1]


def test_read_only_and_transposed_input_is_as_good():
    a, Q = problem(9, 4, 1.0)
    a.flags.writeable = Q.flags.writeable = False
    expected, _ = integer_least_squares(a.copy(), Q.copy())
    assert_array_equal(integer_least_squares(a, Q.T)[0], expected)
    assert_array_equal(integer_least_squares(a.tolist(), Q.tolist())[0], expected)


@pytest.mark.parametrize("success_min", [0.0, 0.9])
def test_subset_is_searched_and_its_ambiguities_alone_are_determined(success_min):
    Q = np.diag([1e-4, 4.0, 1e-3])
    status, integers, norms, determined, success = solve_subset(
        np.array([3.01, 0.4, -2.02]), Q, 1, 10**6, success_min
    )
    assert status == OK
    assert_array_equal(integers, [[3, 0, -2]])
    assert_array_equal(determined, [True, success_min == 0.0, True])
    assert_allclose(norms[0], 0.01**2 / 1e-4 + 0.02**2 / 1e-3 + (0.04 if determined[1] else 0.0))
    assert success >= success_min


def test_search_says_that_it_reached_a_limit_of_nodes():
    a, Q = problem(7, 6, 2.0)
    assert solve(a, Q, 2, 3)[0] == UNFINISHED
    assert solve(a, Q, 2, 10**6)[0] == OK


@pytest.mark.parametrize(
    ("a", "Q", "candidates", "text"),
    [
        ([np.nan, 0.0], np.eye(2), 2, "must be finite"),
        ([1e16, 0.0], np.eye(2), 2, "below 2\\^53"),
        ([0.0, 0.0], np.diag([1.0, np.inf]), 2, "must be finite"),
        ([0.0, 0.0], [[1.0, 0.5], [0.4, 1.0]], 2, "covariance: must be symmetric"),
        ([0.0, 0.0], [[1.0, 2.0], [2.0, 1.0]], 2, "covariance: must be positive definite"),
        ([0.0, 0.0], np.ones((2, 2)), 2, "covariance: must be positive definite"),
        ([0.0, 0.0], np.zeros((2, 2)), 2, "covariance: must be positive definite"),
        ([0.0, 0.0], np.ones((2, 3)), 2, r"covariance: expected shape \(2, 2\), got \(2, 3\)"),
        ([0.0, 0.0], np.eye(2), 0, "candidates: must be 1 or more, got 0"),
        ([], np.zeros((0, 0)), 2, r"float_cycles: expected shape \(n,\).*got \(0,\)"),
        (0.5, 1.0, 2, r"float_cycles: expected shape \(n,\).*got \(\)"),
    ],
)
def test_bad_input_is_refused_by_name(a, Q, candidates, text):
    with pytest.raises(BadInputError, match=text):
        integer_least_squares(a, Q, candidates)
