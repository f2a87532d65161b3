"""The inputs of the trust network: residuals that mean something, whatever the order."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.integers.array.candidates import candidates
from fgnav_models.trust_features import links_of, probabilities, trust_rows
from tests.integers.arrays import PAPER_ANTENNAS_B_M, make


def rows_of(differences):
    found = candidates(differences)
    return found, trust_rows(differences, found)


@pytest.mark.parametrize("satellites", [(5,), (4, 3)])
def test_square_sum_of_whitened_residuals_is_the_cost(satellites):
    made = make(np.random.default_rng(1), epochs=20, satellites=satellites, sine=True)
    found, rows = rows_of(made.differences)
    total = (rows.links[..., 0] ** 2 + rows.links[..., 2] ** 2).sum(axis=1)
    np.testing.assert_allclose(total, found.cost, rtol=1e-4)


def test_missing_links_leave_the_square_sum_what_it_is():
    rng = np.random.default_rng(2)
    missing = rng.random((20, 8, 6)) < 0.08
    missing[:, :, 0] = missing[:, 0] = False  # the references
    made = make(rng, epochs=20, sine=True, missing=missing)
    found, rows = rows_of(made.differences)
    assert (rows.is_present.sum(axis=1) == (~missing).sum(axis=(1, 2))[rows.epoch]).all()
    total = (rows.links[..., 0] ** 2 + rows.links[..., 2] ** 2).sum(axis=1)
    np.testing.assert_allclose(total, found.cost, rtol=1e-4)


def test_order_and_reference_of_satellites_make_no_difference():
    d = make(np.random.default_rng(3), epochs=10, code_m=1.0, satellites=(5,)).differences
    other = 3  # the new reference, which takes the first place
    order = np.array([other, 1, 2, 0, 4])

    def ordered(value):
        return np.ascontiguousarray(value[:, order])  # else all kernels compile once more

    def against(value):
        turned = (value - value[:, :, other : other + 1]).swapaxes(1, 2)
        return np.ascontiguousarray(turned[:, order].swapaxes(1, 2))

    changed = replace(
        d,
        e_n=ordered(d.e_n),
        elevation_rad=ordered(d.elevation_rad),
        code_m=against(d.code_m),
        phase_m=against(d.phase_m),
        code_variance_m2=ordered(d.code_variance_m2),
        phase_variance_m2=ordered(d.phase_variance_m2),
    )
    (_, one), (_, two) = rows_of(d), rows_of(changed)
    np.testing.assert_allclose(two.whole, one.whole, rtol=0, atol=1e-3)
    sums = [rows.links.sum(axis=1) for rows in (one, two)]
    np.testing.assert_allclose(sums[1], sums[0], rtol=0, atol=1e-2)


def test_links_of_a_reference_count_where_any_of_their_group_do():
    d = make(np.random.default_rng(4), satellites=(3, 2)).differences
    code_m = d.code_m.copy()
    code_m[0, 2, 3:] = np.nan  # antenna 4 lacks the second group
    links = links_of(replace(d, code_m=code_m))
    assert links[0, 0].all()
    assert links[0, 3].tolist() == [True, True, True, False, False]


def test_probabilities_are_shares_of_exponentials():
    score, none = np.log([3.0, 1.0, 4.0]), np.log([4.0, 99.0, 1.0])
    epoch = np.array([0, 0, 2])
    probability, of_none, best = probabilities(score, none, epoch, 3)
    np.testing.assert_allclose(probability, [3 / 8, 1 / 8, 4 / 5])
    np.testing.assert_allclose(of_none, [4 / 8, 1.0, 1 / 5])
    assert best.tolist() == [0, -1, 2]


def test_the_true_integers_are_likelier_by_the_mixture_where_links_are_bad():
    rng = np.random.default_rng(6)
    made = make(rng, epochs=60, antennas_b_m=PAPER_ANTENNAS_B_M[::2], code_m=1.0, satellites=(4,))
    d = made.differences
    bad = (rng.random(d.phase_m.shape) < 0.1) & d.resolvable
    phase_m = d.phase_m + 0.03 * bad * rng.normal(size=bad.shape)
    code_m = d.code_m + 3.0 * bad * rng.normal(size=bad.shape)
    found, rows = rows_of(replace(d, phase_m=phase_m, code_m=code_m))
    right = (found.cycles == made.cycles[found.epoch]).all(axis=(1, 2))
    several = right & (np.bincount(found.epoch, minlength=60) > 1)[found.epoch]
    assert several.sum() > 10
    mixture, gauss = rows.whole[several, 0], rows.whole[several, 1]
    assert mixture.mean() > 0.5 * gauss.mean()
