"""Integers held give the likelihood that a search gives where it finds no others."""

import numpy as np
import pytest

from fgnav.integers.constrained_held import hold
from fgnav.integers.constrained_noise import _log_searched, _Sample, _student
from fgnav.integers.constrained_prior import AttitudePrior
from fgnav.integers.constrained_search import search_constrained

from .arrays import PAPER_ANTENNAS_B_M, make

LAWS = [
    (0.0, 0.0, 0.0, 0.0),
    (0.7, 0.3, -0.5, 0.0),
    (-0.4, -0.2, -0.3, 0.2),
]  # none so loud that integers become doubtful


def some_missing(rng, shape, references):
    missing = rng.random(shape) < 0.1
    missing[:, :, references] = False
    missing[:, 0] = False
    return missing


@pytest.mark.parametrize(
    ("antennas", "satellites", "prior"),
    [
        (slice(None), (7,), False),
        (slice(None), (5, 4), False),
        ([0, 1, 3], (9,), False),
        ([0, 3], (9,), False),
        ([0, 1, 3, 7], (8,), True),
    ],
)
def test_likelihood_of_noise_is_that_of_the_search_but_for_a_constant(antennas, satellites, prior):
    rng = np.random.default_rng(1)
    references = np.cumsum((0, *satellites[:-1]))
    antennas_b_m = PAPER_ANTENNAS_B_M[antennas]
    missing = some_missing(rng, (20, len(antennas_b_m), sum(satellites)), references)
    made = make(
        rng,
        epochs=20,
        antennas_b_m=antennas_b_m,
        satellites=satellites,
        code_m=0.1,
        sine=True,
        missing=missing,
    )
    d = made.differences
    attitude = None
    if prior:
        covariance = np.tile(1e-4 * np.eye(3), (20, 1, 1))
        attitude = AttitudePrior(R_nb=made.R_nb, attitude_covariance_rad2=covariance)
    found = search_constrained(d, 10**6, attitude)
    sure = np.flatnonzero(found.wrong_probability < 1e-6)
    assert len(sure) >= 10
    stated = [v / np.median(v) for v in (d.code_variance_m2, d.phase_variance_m2)]
    sample = _Sample(d, attitude, *stated).at(np.isin(np.arange(20), sure))
    held = hold(sample.differences, found.rows(sure), sample.prior)
    apart = []
    for law in np.array(LAWS):
        cost, rest = held.log_likelihoods(*sample.variances_m2(law))
        ours = np.sum(rest - 0.5 * cost + _student(cost, held.degrees))
        apart.append(ours - _log_searched(sample.with_law(law), sample.prior, 10**6))
    # what is not linear in the attitude of an epoch, and what little other integers weigh
    np.testing.assert_allclose(apart, apart[0], rtol=0, atol=0.01 * len(sure))
