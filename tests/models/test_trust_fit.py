"""The fit of links some of which are worse than stated: against dense algebra and by its laws."""

import numpy as np
import pytest

from fgnav_models.trust_fit import (
    SHARE,
    WORSE_CODE_M,
    WORSE_PHASE_M,
    Links,
    least_squares,
    log_odds,
    mixture,
)

PHASE_M, CODE_M = 0.003, 0.5


def made(rng, *, antennas=5, satellites=6, groups=1, missing=0.0):
    """Return links of noise, and their values."""
    m = satellites * groups
    is_present = rng.random((antennas, m)) >= missing
    is_present[0] = True
    sigma_m = np.array([[PHASE_M], [CODE_M]]) * rng.uniform(1.0, 3.0, m)
    links = Links(
        is_present=is_present,
        group=np.repeat(np.arange(groups), satellites),
        arm=rng.normal(size=(antennas, 1, 3)) + 0.3 * rng.normal(size=(antennas, m, 3)),
        variance_m2=sigma_m**2,
        log_odds=log_odds(sigma_m**2),
    )
    return links, sigma_m[:, None] * rng.normal(size=(2, antennas, m)) * is_present


def dense(links):
    """Return the design of all unknowns, (2 l + 3, 3 + 2 u), and weights.

    Offsets are those of each group's antennas, then of satellites.
    """
    antenna, channel = np.nonzero(links.is_present)
    a, m = links.is_present.shape
    groups = links.group.max() + 1
    of_antenna = np.eye(a * groups)[antenna * groups + links.group[channel]]
    offsets = np.hstack([of_antenna, np.eye(m)[channel]])
    none = np.zeros_like(offsets)
    arm = links.arm[antenna, channel]
    design = np.block([[arm, offsets, none], [arm, none, offsets]])
    weight = 1.0 / links.variance_m2[:, channel].ravel()
    return np.vstack([design, np.eye(3, design.shape[1])]), np.append(weight, np.ones(3))


@pytest.mark.parametrize("missing", [0.0, 0.2])
@pytest.mark.parametrize("groups", [1, 2])
def test_least_squares_leave_what_dense_algebra_leaves(groups, missing):
    links, value_m = made(np.random.default_rng(1), groups=groups, missing=missing)
    design, weight = dense(links)
    y = np.append(value_m[:, links.is_present], np.zeros(3))
    root = np.sqrt(weight)
    x = np.linalg.lstsq(root[:, None] * design, root * y, rcond=1e-12)[0]
    expected = (y - design @ x)[:-3].reshape(2, -1)
    residual_m = least_squares(value_m, links).residual_m[:, links.is_present]
    np.testing.assert_allclose(residual_m, expected, rtol=0, atol=1e-9)


def test_determinant_is_that_of_all_unknowns_but_one_antenna_in_each_group():
    links, value_m = made(np.random.default_rng(2), groups=2, missing=0.1)
    design, weight = dense(links)
    offsets = (design.shape[1] - 3) // 2
    left = np.delete(design, [3, 4, 3 + offsets, 4 + offsets], axis=1)
    expected = np.linalg.slogdet(left.T * weight @ left)[1]
    assert least_squares(value_m, links).log_determinant == pytest.approx(expected, abs=1e-6)


def test_density_is_that_of_the_two_gaussians():
    links, value_m = made(np.random.default_rng(3))
    worse = np.zeros(links.is_present.shape)
    robust, density = mixture(value_m, links, least_squares(value_m, links), worse)

    def log_density(residual_m):
        narrow = links.variance_m2[:, None]
        wide = narrow + np.array([[WORSE_PHASE_M], [WORSE_CODE_M]])[..., None] ** 2
        each = [
            np.exp(-0.5 * residual_m**2 / variance) / np.sqrt(variance)
            for variance in (narrow, wide)
        ]
        own = (1.0 - SHARE) * each[0].prod(axis=0), SHARE * each[1].prod(axis=0)
        return np.log(sum(own)).sum(), own[1] / sum(own)

    at_zero = log_density(np.zeros_like(value_m))[0]
    expected, of_links = log_density(robust.residual_m)
    assert density == pytest.approx(expected - at_zero, rel=1e-9)
    np.testing.assert_allclose(worse, of_links, rtol=1e-9)


def test_a_link_far_off_is_found_and_taken_out_of_the_others_residuals():
    links, value_m = made(np.random.default_rng(4), antennas=8)
    start = least_squares(value_m, links)
    bad = 2, 4
    spoilt_m = value_m.copy()
    spoilt_m[:, *bad] += [0.06, 5.0]
    worse = np.zeros(links.is_present.shape)
    robust, _ = mixture(spoilt_m, links, least_squares(spoilt_m, links), worse)
    assert worse[bad] > 0.99
    off_m = np.abs(robust.residual_m - start.residual_m)[0]
    worse[bad] = off_m[bad] = 0.0
    assert worse.max() < 0.5
    assert off_m.max() < PHASE_M


def test_an_array_in_a_line_leaves_a_turn_open_and_still_has_an_answer():
    links, value_m = made(np.random.default_rng(5))
    axis = np.array([1.0, 0.0, 0.0])
    flat = links._replace(arm=np.cross(axis, links.arm))
    fit = least_squares(value_m, flat)
    assert np.isfinite(fit.log_determinant)
    assert np.isfinite(fit.residual_m).all()
