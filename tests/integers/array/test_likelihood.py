"""Integers once listed give the likelihood of any noise that a search for that noise gives."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.integers.array.kernel import PROVEN
from fgnav.integers.array.likelihood import likelihood_of
from fgnav.integers.array.search import search_constrained
from tests.integers.arrays import PAPER_ANTENNAS_B_M, make

ALIKE = 1e9  # epochs: none is calmer or rougher than the mean, and noise is Gaussian
NODES = 10**7
LAWS = [(1.0, 1.0), (0.8, 1.1), (1.2, 0.9)]  # standard deviations of code and phase


def some_missing(rng, shape, references):
    missing = rng.random(shape) < 0.1
    missing[:, :, references] = False
    missing[:, 0] = False
    return missing


def log_determinants(d, variance):
    """Those of each epoch's covariance of double differences, (n,), link by link."""
    out = np.zeros(len(variance))
    for k, links in enumerate(d.resolvable):
        b, j = np.nonzero(links)
        of_reference = variance[k, d.reference[k, d.group[j]]]
        same_group = d.group[j][:, None] == d.group[j]
        satellites = same_group * of_reference + np.diag(variance[k])[j][:, j]
        out[k] = np.linalg.slogdet(satellites * (1.0 + (b[:, None] == b)))[1]
    return out


def searched(d):
    """The log likelihood of Gaussian noise as stated, but for a constant."""
    found = search_constrained(d, NODES)
    assert (found.status == PROVEN).all()
    determinants = log_determinants(d, d.code_variance_m2)
    determinants += log_determinants(d, d.phase_variance_m2)
    return np.sum(found.log_evidence - 0.5 * determinants)


@pytest.mark.parametrize(
    ("antennas", "satellites", "code_m"),
    [
        (slice(None), (7,), 0.1),
        (slice(None), (5, 4), 0.1),
        ([0, 1, 3], (9,), 0.1),
        ([0, 3], (9,), 0.1),
        ([0, 1, 3, 7], (8,), 0.1),
        ([0, 3], (6,), 0.3),  # from here on integers are doubtful
        ([0, 3, 5], (5,), 0.3),
    ],
)
def test_likelihood_of_noise_is_that_of_the_search_but_for_a_constant(antennas, satellites, code_m):
    rng = np.random.default_rng(1)
    references = np.cumsum((0, *satellites[:-1]))
    antennas_b_m = PAPER_ANTENNAS_B_M[antennas]
    missing = some_missing(rng, (20, len(antennas_b_m), sum(satellites)), references)
    made = make(
        rng,
        epochs=20,
        antennas_b_m=antennas_b_m,
        satellites=satellites,
        code_m=code_m,
        sine=code_m < 0.3,
        missing=missing if code_m < 0.3 else None,
    )
    d = made.differences
    likelihood = likelihood_of(d, NODES)
    assert likelihood.epochs == 20
    apart = []
    for code, phase in LAWS:
        variances = code**2 * d.code_variance_m2, phase**2 * d.phase_variance_m2
        of_law = replace(d, code_variance_m2=variances[0], phase_variance_m2=variances[1])
        apart.append(likelihood.logarithm(*variances, ALIKE) - searched(of_law))
    # what is not linear in the attitude of an epoch, and what dearer integers weigh
    np.testing.assert_allclose(apart, apart[0], rtol=0, atol=0.01 * 20)


def test_epochs_of_too_many_integers_count_under_no_noise():
    made = make(np.random.default_rng(2), epochs=5, antennas_b_m=PAPER_ANTENNAS_B_M[[0, 3]])
    d = made.differences
    assert likelihood_of(d, NODES).epochs == 5
    none = likelihood_of(d, 1)
    assert none.epochs == 0
    assert none.logarithm(d.code_variance_m2, d.phase_variance_m2, ALIKE) == 0.0
