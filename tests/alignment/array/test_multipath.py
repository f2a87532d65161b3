"""Phase errors that stay with antenna and satellite: found, timed, and one state without loss."""

import numpy as np
import pytest

from fgnav.alignment.array.multipath import (
    _basis,
    _kept,
    correlated_process,
    link_residuals,
    symmetric_root,
)
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.types.integers import fixed_ranges_m
from fgnav_sim.gauss_markov import gauss_markov
from tests.assembly.flights import E_N, motion
from tests.attitude.arrays import synthetic

STEP_S, CONSTANT_S, SHARE = 0.1, 15.0, 0.4
LINKS = 60


def drawn(seed, share, epochs=600):
    """Residuals of links whose error lasts for a part."""
    rng = np.random.default_rng(seed)
    slow = gauss_markov(CONSTANT_S, STEP_S, (epochs, LINKS), rng=rng)
    white = rng.standard_normal((epochs, LINKS))
    residuals = np.sqrt(share) * slow + np.sqrt(1 - share) * white
    residuals[rng.random((epochs, LINKS)) < 0.1] = np.nan
    return np.arange(epochs) * STEP_S, 0.7 * residuals


def test_what_lasts_is_sized_and_timed():
    found = np.array([correlated_process(*drawn(seed, SHARE)) for seed in range(8)])
    # A minute is four time constants of sixty links, five of whose six tell a variance apart: the
    # mean of eight is known to 2 % and 4 %.
    np.testing.assert_allclose(found.mean(axis=0), (SHARE, CONSTANT_S), rtol=0.1)


def test_white_errors_are_no_states():
    assert [correlated_process(*drawn(seed, 0.0)) for seed in range(20)] == [None] * 20


def test_nothing_is_found_of_a_single_epoch():
    t_s, residuals = drawn(0, SHARE)
    assert correlated_process(t_s[:2], residuals[:2]) is None
    assert correlated_process(t_s, np.full_like(residuals, np.nan)) is None


def test_residuals_of_right_attitudes_are_noise_less_what_clocks_take():
    R_nb = motion(np.arange(200.0), 0.3)[0]
    differences, integers = synthetic(R_nb, E_N, np.random.default_rng(3))
    ranges_m = fixed_ranges_m(differences, integers)
    residuals = link_residuals(differences, ranges_m, np.arange(200), R_nb)
    antennas, channels = len(differences.baselines_b_m) + 1, len(differences.satellites)
    groups = len(np.unique(differences.group))
    left = (antennas - 1) * (channels - groups) / (antennas * channels)
    count = 200 * (antennas - 1) * (channels - groups)
    assert (residuals**2).mean() == pytest.approx(left, rel=4 * np.sqrt(2 / count))
    by_antenna = residuals.reshape(200, antennas, channels)
    np.testing.assert_allclose(by_antenna.sum(axis=1), 0.0, atol=1e-6)


def test_what_stays_is_the_covariance_of_links_that_stay():
    """Of two epochs one link of an antenna is lost: all that is left is N_1^-1 N_01 N_0^-1."""
    R_nb = motion(np.arange(2.0), 0.3)[0]
    differences, integers = synthetic(R_nb, E_N, np.random.default_rng(4))
    ranges_m = fixed_ranges_m(differences, integers)
    ranges_m[1, 0, int((~differences.is_reference[1]).argmax())] = np.nan
    basis = _basis(differences.baselines_b_m)
    kept = _kept(differences, ranges_m, np.arange(2), basis)
    information = RotationQuadratic.of_ranges(differences, ranges_m).information
    _, inverse = symmetric_root(information)
    # N_01 is N_1 here, whose links are all among those before.
    expected = basis.T @ inverse[1] @ information[1] @ inverse[0] @ basis
    np.testing.assert_allclose(kept[0], expected, rtol=0, atol=1e-9)
    size = np.linalg.svd(kept[0])[1]
    assert size.min() < 0.99
    assert size.max() <= 1.0 + 1e-12


def test_keyframes_between_epochs_keep_all():
    R_nb = motion(np.arange(2.0), 0.3)[0]
    differences, integers = synthetic(R_nb, E_N, np.random.default_rng(4))
    ranges_m = fixed_ranges_m(differences, integers)
    basis = _basis(differences.baselines_b_m)
    kept = _kept(differences, ranges_m, np.array([0, -1, 1]), basis)
    np.testing.assert_array_equal(kept[0], np.eye(basis.shape[1]))
    np.testing.assert_allclose(kept[1], np.eye(basis.shape[1]), rtol=0, atol=1e-6)


@pytest.mark.parametrize(("antennas", "dimensions"), [(2, 3), (3, 6), (4, 9)])
def test_an_array_knows_three_elements_of_each_of_its_dimensions(antennas, dimensions):
    arms = np.random.default_rng(5).normal(size=(antennas - 1, 3))
    basis = _basis(arms)
    assert basis.shape == (9, dimensions)
    np.testing.assert_allclose(basis.T @ basis, np.eye(dimensions), atol=1e-12)
    for e in np.eye(3):
        link = np.outer(e, arms[0]).ravel()
        np.testing.assert_allclose(basis @ (basis.T @ link), link, atol=1e-12)
