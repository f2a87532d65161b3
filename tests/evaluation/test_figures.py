"""Proper scores are lowest for the right covariance; figures count matched epochs only."""

import numpy as np
import pytest

from fgnav.evaluation.figures import energy_score, negative_log_likelihood


@pytest.fixture
def drawn():
    rng = np.random.default_rng(5)
    root = rng.normal(size=(3, 3))
    covariance = root @ root.T
    error = rng.multivariate_normal(np.zeros(3), covariance, size=4000)
    return error, covariance


@pytest.mark.parametrize("score", [negative_log_likelihood, energy_score])
@pytest.mark.parametrize("factor", [0.25, 0.5, 2.0, 4.0])
def test_the_right_covariance_scores_best(drawn, score, factor):
    error, covariance = drawn
    right = score(error, np.tile(covariance, (len(error), 1, 1)))
    wrong = score(error, np.tile(factor * covariance, (len(error), 1, 1)))
    assert right < wrong


def test_energy_score_of_one_dimension_is_the_crps():
    from scipy.stats import norm

    rng = np.random.default_rng(6)
    error, sigma = rng.normal(size=(50, 1)), 0.7
    z = error[:, 0] / sigma
    crps = sigma * (z * (2 * norm.cdf(z) - 1) + 2 * norm.pdf(z) - 1 / np.sqrt(np.pi))
    ours = energy_score(error, np.full((50, 1, 1), sigma**2))
    assert ours == pytest.approx(crps.mean(), rel=0.01)


def test_negative_log_likelihood_is_scipys():
    from scipy.stats import multivariate_normal

    covariance = np.diag([1.0, 4.0, 9.0])
    error = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 1.0]])
    ours = negative_log_likelihood(error, np.tile(covariance, (2, 1, 1)))
    assert ours == pytest.approx(-multivariate_normal(np.zeros(3), covariance).logpdf(error).mean())


def test_a_covariance_that_is_none_has_no_score():
    assert np.isnan(negative_log_likelihood(np.ones((1, 2)), np.diag([1.0, 0.0])[None]))
