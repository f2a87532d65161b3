import numpy as np
import pytest

from fgnav.attitude import RotationQuadratic, maximum_likelihood
from fgnav.attitude.robust import robust_attitudes
from fgnav.geometry import rotations
from fgnav.types.integers import fixed_ranges_m
from tests.attitude.arrays import sky, synthetic
from tests.integers.arrays import L1_M, PAPER_ANTENNAS_B_M


def case(rng, wrong, antennas_b_m=PAPER_ANTENNAS_B_M, n=60):
    """Attitudes of a slow turn, differences, and ranges of which some links are cycles off."""
    angle = np.linspace(0, 1.0, n)
    R_nb = rotations.from_euler(angle, 0.5 * angle, -angle)
    differences, true = synthetic(R_nb, sky(8, rng), rng, antennas_b_m=antennas_b_m)
    links = np.argwhere(true.fixed[0])
    chosen = links[rng.permutation(len(links))[: round(wrong * len(links))]]
    cycles = np.zeros(true.cycles.shape[1:], dtype=int)
    cycles[tuple(chosen.T)] = rng.integers(1, 4, len(chosen)) * rng.choice([-1, 1], len(chosen))
    return R_nb, differences, fixed_ranges_m(differences, true) + L1_M * cycles, cycles


def degrees_off(R_nb, truth):
    return np.degrees(np.linalg.norm(rotations.log(rotations.transpose(R_nb) @ truth), axis=1))


def start(differences, ranges_m):
    return maximum_likelihood(RotationQuadratic.of_ranges(differences, ranges_m)).R_nb


@pytest.mark.parametrize("wrong", [0.1, 0.2, 0.3])
def test_links_that_are_cycles_off_do_not_pull_the_attitude_away(wrong):
    for seed in range(5):
        R_nb, differences, ranges_m, cycles = case(np.random.default_rng(seed), wrong)
        pulled = start(differences, ranges_m)
        found = robust_attitudes(differences, ranges_m, pulled, np.ones(len(R_nb), dtype=bool))
        assert np.median(degrees_off(pulled, R_nb)) > 2
        assert degrees_off(found, R_nb).max() < 5  # 3 mm of phase on half a metre
        off = (ranges_m - differences.array_m(found)) / L1_M
        known = np.isfinite(ranges_m) & ~differences.is_reference[:, None]
        right = np.rint(off) == cycles
        assert right[known].mean() > 0.99


def test_without_wrong_links_it_is_the_least_squares_attitude_to_a_part_of_its_sigma():
    R_nb, differences, ranges_m, _ = case(np.random.default_rng(7), 0.0)
    least = maximum_likelihood(RotationQuadratic.of_ranges(differences, ranges_m))
    found = robust_attitudes(differences, ranges_m, least.R_nb, np.ones(len(R_nb), dtype=bool))
    sigma = np.degrees(np.sqrt(np.einsum("nii->n", least.covariance_rad2)))
    # It leaves correlations out: worse than least squares, by less than the noise itself.
    assert (degrees_off(found, least.R_nb) < 4 * sigma).all()


def test_epochs_that_are_not_wanted_keep_their_start():
    R_nb, differences, ranges_m, _ = case(np.random.default_rng(3), 0.2)
    pulled, wanted = start(differences, ranges_m), np.arange(len(R_nb)) % 3 == 0
    found = robust_attitudes(differences, ranges_m, pulled, wanted)
    assert (found[~wanted] == pulled[~wanted]).all()
    assert degrees_off(found[wanted], R_nb[wanted]).max() < 5


def test_a_single_baseline_keeps_the_angle_about_itself():
    two = np.array([[0.0, 0, 0], [1.0, 0, 0]])
    R_nb, differences, ranges_m, _ = case(np.random.default_rng(4), 0.15, two)
    found = robust_attitudes(differences, ranges_m, R_nb, np.ones(len(R_nb), dtype=bool))
    assert np.abs(found @ found.swapaxes(1, 2) - np.eye(3)).max() < 1e-12
    along = np.degrees(np.arccos(np.einsum("ni,ni->n", found[:, :, 0], R_nb[:, :, 0]).clip(-1, 1)))
    assert along.max() < 4


def test_an_epoch_without_ranges_stays_where_it_is():
    R_nb, differences, ranges_m, _ = case(np.random.default_rng(5), 0.1)
    ranges_m[10] = np.nan
    alone = np.arange(len(R_nb)) == 10
    found = robust_attitudes(differences, ranges_m, R_nb, alone)
    assert (found[10] == R_nb[10]).all()
