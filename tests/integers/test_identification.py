"""Bad links are named, left out, and the rest is right."""

import dataclasses

import numpy as np
import pytest

from fgnav.attitude import RotationQuadratic, maximum_likelihood
from fgnav.geometry import rotations
from fgnav.integers.identification import Residuals, touched, w_tests
from fgnav.integers.resolvers.constrained import LEFT_OUT, Constrained
from fgnav.types.integers import fixed_ranges_m
from tests.attitude.arrays import sky, synthetic

from .arrays import PAPER_ANTENNAS_B_M, link_covariance, make

PAIR_B_M = np.array([[0.0, 0.0, 0.0], [1.6, 0.0, 0.0]])
STATED = Constrained(estimate_noise=False)
PHASE_M = 0.045  # a quarter of a cycle: no integer takes it in


def spoilt(made, errors, epochs=slice(None)):
    """The same with phase errors, m, of undifferenced links {(antenna, channel): error}."""
    d = made.differences
    links = np.zeros((len(d.t_s), len(d.baselines_b_m) + 1, len(d.satellites)))
    for (antenna, channel), error_m in errors.items():
        links[epochs, antenna, channel] = error_m
    return dataclasses.replace(d, phase_m=d.phase_m + spoilt_by(d, links))


def spoilt_by(d, links):
    """Errors of undifferenced links, (n, a, m), in the double differences."""
    single = links[:, 1:] - links[:, :1]
    of_reference = d.reference[:, d.group][:, None, :]
    return single - np.take_along_axis(single, of_reference, axis=2)


def named(found):
    return {loss.what: loss.count for loss in found.unused if loss.reason == LEFT_OUT}


@pytest.mark.parametrize("antennas", [2, 4])
def test_a_w_test_is_what_the_cost_falls_by_with_the_links_error_unknown(antennas):
    """Of code and phase: against least squares of double differences in full covariance."""
    rng = np.random.default_rng(antennas)
    arms, e_n = PAPER_ANTENNAS_B_M[:antennas], np.concatenate([sky(7, rng), sky(5, rng)])
    R_nb = rotations.from_euler(*rng.uniform(-1, 1, (3, 2)))
    d, true = synthetic(
        R_nb, e_n, rng, antennas_b_m=arms, group=[0] * 7 + [1] * 5, sine=True, missing=0.1
    )
    R_nb = maximum_likelihood(RotationQuadratic.of_double_differences(d, true)).R_nb
    n_m = np.einsum("nij,bj->nbi", R_nb, d.baselines_b_m)
    ranges_m = fixed_ranges_m(d, true)
    at_reference = np.where(d.is_reference[:, None] & (d.phase_m == 0), 0.0, np.nan)
    code_m = np.where(true.fixed, d.code_m - d.array_m(R_nb), at_reference)
    kinds = [
        Residuals(code_m, d.code_variance_m2),
        Residuals(ranges_m - d.array_m(R_nb), d.phase_variance_m2),
    ]
    tests = w_tests(d, kinds, n_m)
    for k, antenna, j in np.argwhere(tests > 1e-6)[::7]:
        error = np.zeros((2, antennas, len(e_n)))
        error[:, antenna, j] = 1.0
        column = spoilt_by(d, error)[k][true.fixed[k]]
        turned = np.stack(
            [d.array_m(R_nb @ rotations.exp(1e-6 * axis[None]))[k] for axis in np.eye(3)], axis=-1
        )
        J = (turned - d.array_m(R_nb)[k][..., None])[true.fixed[k]] / 1e-6
        off = [kind.off_m[k][true.fixed[k]] for kind in kinds]
        C = [link_covariance(d, k, true.fixed[k], kind.variance_m2) for kind in kinds]
        zero = np.zeros_like(column)
        of_both = np.concatenate([J, J])
        W = np.linalg.inv(np.block([[C[0], 0 * C[0]], [0 * C[0], C[1]]]))
        fallen = [
            cost(np.concatenate(off), W, of_both)
            - cost(np.concatenate(off), W, np.c_[of_both, extra])
            for extra in (np.r_[column, zero], np.r_[zero, column])
        ]
        assert tests[k, antenna, j] == pytest.approx(sum(fallen), rel=1e-4, abs=1e-6)


def cost(y, W, A):
    """Return the least weighted square sum of y - A x."""
    left = y - A @ np.linalg.pinv(A.T @ W @ A) @ A.T @ W @ y
    return left @ W @ left


def test_bad_link_is_named_and_the_rest_of_its_epochs_is_right():
    made = make(np.random.default_rng(1), epochs=60)
    d = spoilt(made, {(3, 4): PHASE_M}, slice(0, 40))
    found = STATED(d, made.flight)
    assert named(found) == {"a4 G05 1C link": 40}
    assert not found.fixed[:40, 2, 4].any()
    assert found.fixed.sum() == 60 * 35 - 40
    assert (found.cycles == made.cycles)[found.fixed].all()
    assert set(found.reasons[:40]) == {f"a link {LEFT_OUT}"}
    assert set(found.reasons[40:]) == {""}
    assert set(found.outcome) == {"fixed"}


def test_bad_link_of_the_reference_antenna_costs_its_channel():
    made = make(np.random.default_rng(2), epochs=20)
    found = STATED(spoilt(made, {(0, 2): PHASE_M}), made.flight)
    assert named(found) == {"a1 G03 1C link": 20 * 7}
    assert not found.fixed[:, :, 2].any()
    assert found.fixed.sum() == 20 * 28
    assert (found.cycles == made.cycles)[found.fixed].all()


def test_bad_link_of_the_reference_channel_costs_its_antenna():
    made = make(np.random.default_rng(3), epochs=20)
    found = STATED(spoilt(made, {(5, 0): PHASE_M}), made.flight)
    assert named(found) == {"a6 G01 1C link": 20 * 5}
    assert not found.fixed[:, 4].any()
    assert (found.cycles == made.cycles)[found.fixed].all()


@pytest.mark.parametrize("code_m", [4.0, -8.0])
def test_bad_code_is_found_too(code_m):
    made = make(np.random.default_rng(4), epochs=20)
    measured_m = made.differences.code_m.copy()
    measured_m[:, 4, 3] += code_m
    d = dataclasses.replace(made.differences, code_m=measured_m)
    found = STATED(d, made.flight)
    assert named(found) == {"a6 G04 1C link": 20}
    assert (found.cycles == made.cycles)[found.fixed].all()


def test_three_bad_links_are_found_one_after_the_other_and_four_are_refused():
    made = make(np.random.default_rng(5), epochs=20, satellites=(8,))
    errors = {(3, 4): PHASE_M, (6, 2): -PHASE_M, (1, 7): 0.06}
    found = STATED(spoilt(made, errors), made.flight)
    fixed = found.fixed.any(axis=(1, 2))
    assert fixed.mean() >= 0.9
    assert (found.cycles == made.cycles)[found.fixed].all()
    assert {"a4 G05 1C link", "a7 G03 1C link", "a2 G08 1C link"} <= set(named(found))
    errors[(4, 1)] = -0.06
    found = STATED(spoilt(made, errors), made.flight)
    assert not found.fixed.any()
    assert named(found) == {}
    assert [loss.count for loss in found.unused] == [20 * 49]


def test_which_of_two_antennas_is_bad_is_not_claimed():
    made = make(np.random.default_rng(6), epochs=60, satellites=(8, 8), antennas_b_m=PAIR_B_M)
    found = STATED(spoilt(made, {(1, 4): PHASE_M}), made.flight)
    assert found.fixed.any(axis=(1, 2)).mean() > 0.9
    assert (found.cycles == made.cycles)[found.fixed].all()
    assert named(found)["a1 or a2 G05 1C link"] >= 50


def test_a_pair_of_few_links_is_refused_with_a_bad_one():
    made = make(np.random.default_rng(6), epochs=60, satellites=(10,), antennas_b_m=PAIR_B_M)
    found = STATED(spoilt(made, {(1, 4): PHASE_M}), made.flight)
    assert named(found) == {}
    assert found.fixed.any(axis=(1, 2)).mean() < 0.1


def test_link_left_out_counts_once_where_two_share_a_difference():
    made = make(np.random.default_rng(8), epochs=20, satellites=(8,))
    errors = {(0, 2): PHASE_M, (3, 4): -PHASE_M}
    found = STATED(spoilt(made, errors), made.flight)
    assert found.fixed.sum() + sum(loss.count for loss in found.unused) == 20 * 49
    # left out one by one, so now and then a link more than need be
    assert 0.95 * 20 * 41 <= found.fixed.sum() <= 20 * 41


def test_differences_that_a_link_takes_part_in():
    made = make(np.random.default_rng(9), antennas_b_m=PAPER_ANTENNAS_B_M[:3], satellites=(3, 2))
    for (antenna, channel), expected in {
        (1, 1): [[0, 1, 0, 0, 0], [0, 0, 0, 0, 0]],
        (2, 0): [[0, 0, 0, 0, 0], [1, 1, 1, 0, 0]],
        (0, 4): [[0, 0, 0, 0, 1], [0, 0, 0, 0, 1]],
        (0, 3): [[0, 0, 0, 1, 1], [0, 0, 0, 1, 1]],
    }.items():
        links = np.zeros((1, 3, 5), bool)
        links[0, antenna, channel] = True
        found = touched(made.differences, links)
        np.testing.assert_array_equal(found[0], np.array(expected, bool))
