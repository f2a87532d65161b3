"""The inputs of the trust network: residuals that mean something, whatever the order."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.integers.array.candidates import candidates
from fgnav_models.trust_features import FEATURES, links_of, trust_rows
from tests.integers.arrays import PAPER_ANTENNAS_B_M, make

PHASE, CODE = 11, 12  # log(1 + mean square of whitened residuals)


def rows_of(differences):
    listed = candidates(differences)
    return listed, trust_rows(differences, listed)


@pytest.mark.parametrize("antennas", [2, 8])
@pytest.mark.parametrize("satellites", [(5,), (4, 3), (6, 6, 6, 6)])
@pytest.mark.parametrize("missing", [0.0, 0.08])
def test_square_sum_of_whitened_residuals_is_the_cost(satellites, antennas, missing):
    rng = np.random.default_rng(1)
    gone = rng.random((20, antennas, sum(satellites))) < missing
    gone[:, :, np.cumsum((0, *satellites[:-1]))] = gone[:, 0] = False  # the references
    array = 2.0 * PAPER_ANTENNAS_B_M[[0, 3, 1, 2, 4, 5, 6, 7]][:antennas]
    made = make(rng, epochs=20, antennas_b_m=array, satellites=satellites, sine=True, missing=gone)
    listed, rows = rows_of(made.differences)
    assert rows.features.shape[1] == FEATURES
    assert np.isfinite(rows.features).all()
    number = links_of(made.differences).sum(axis=(1, 2))[listed.epoch]
    mean = np.expm1(rows.features[:, [PHASE, CODE]].astype(float)).sum(axis=1)
    np.testing.assert_allclose(number * mean, listed.cost, rtol=1e-4)


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
    np.testing.assert_allclose(two.features, one.features, rtol=0, atol=1e-3)
    np.testing.assert_allclose(two.worse, one.worse[:, :, order], rtol=0, atol=1e-3)


def test_links_of_a_reference_count_where_any_of_their_group_do():
    d = make(np.random.default_rng(4), satellites=(3, 2)).differences
    code_m = d.code_m.copy()
    code_m[0, 2, 3:] = np.nan  # antenna 4 lacks the second group
    links = links_of(replace(d, code_m=code_m))
    assert links[0, 0].all()
    assert links[0, 3].tolist() == [True, True, True, False, False]


def test_the_true_integers_are_likelier_by_the_mixture_where_links_are_bad():
    rng = np.random.default_rng(6)
    made = make(rng, epochs=60, antennas_b_m=PAPER_ANTENNAS_B_M[::2], code_m=1.0, satellites=(4,))
    d = made.differences
    bad = (rng.random(d.phase_m.shape) < 0.1) & d.resolvable
    phase_m = d.phase_m + 0.03 * bad * rng.normal(size=bad.shape)
    code_m = d.code_m + 3.0 * bad * rng.normal(size=bad.shape)
    listed, rows = rows_of(replace(d, phase_m=phase_m, code_m=code_m))
    right = (listed.cycles == made.cycles[listed.epoch]).all(axis=(1, 2))
    several = right & (np.bincount(listed.epoch, minlength=60) > 1)[listed.epoch]
    assert several.sum() > 10
    mixture, gauss = rows.features[several, 0], rows.features[several, 1]
    assert mixture.mean() > 0.5 * gauss.mean()
