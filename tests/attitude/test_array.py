import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.attitude import RotationQuadratic, maximum_likelihood
from fgnav.attitude.array import agreeing
from fgnav.geometry import rotations
from fgnav.types.estimate import open_angle_variance_rad2

from .arrays import PAPER_ANTENNAS_B_M, sky, synthetic

RUNS = 4000
PLANE_B_M = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0.5, 0]])


def solve(R_nb, rng, **options):
    differences, true = synthetic(R_nb, sky(6, rng), rng, **options)
    form = RotationQuadratic.of_double_differences(differences, true)
    return maximum_likelihood(form), form


# A plane with gaps is at times truly ambiguous: the best rotation is another; so no gaps there.
@pytest.mark.parametrize(
    ("antennas", "missing"), [(PAPER_ANTENNAS_B_M, 0.1), (PLANE_B_M, 0.0)], ids=["paper", "plane"]
)
def test_errors_reach_the_bound_and_their_covariance_is_believable(antennas, missing):
    rng = np.random.default_rng(5)
    R_nb = rotations.exp(rng.normal(size=(RUNS, 3)))
    solution, form = solve(R_nb, rng, antennas_b_m=antennas, sine=True, missing=missing)
    assert solution.solved.all()
    error = rotations.log(rotations.transpose(solution.R_nb) @ R_nb)
    bound = np.linalg.inv(form.information_at(R_nb))
    ratio = np.sqrt((error**2).mean(axis=0) / np.einsum("nii->ni", bound).mean(axis=0))
    assert_allclose(ratio, 1, atol=0.06)
    nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(solution.covariance_rad2), error)
    assert abs(nees.mean() - 3) < 0.25  # 4 standard errors of the mean, and curvature at 2 degrees
    freedom = solution.degrees_of_freedom
    assert abs((solution.chi_square - freedom).mean()) < 4 * np.sqrt(2 * freedom.mean() / RUNS)
    assert solution.consistent().mean() > 0.999


def test_a_wrong_integer_fails_the_chi_square_test():
    rng = np.random.default_rng(6)
    R_nb = rotations.exp(rng.normal(size=(50, 3)))
    differences, true = synthetic(R_nb, sky(7, rng), rng)
    cycles = true.cycles.copy()
    cycles[:, 3, 2] += 1
    wrong = type(true)(resolver="wrong", cycles=cycles, fixed=true.fixed, ratio=true.ratio)
    form = RotationQuadratic.of_double_differences(differences, wrong)
    assert not maximum_likelihood(form).consistent().any()


@pytest.mark.parametrize(
    ("baseline", "name"),
    [
        ([1.6, 0, 0], "roll"),
        ([-1.6, 0, 0], "roll"),
        ([0, 1, 0], "pitch"),
        ([0, 0, 1], "yaw"),
        ([1, 1, 0], "rotation about the body axis [0.707, 0.707, 0.000]"),
        ([-1, -1, 0], "rotation about the body axis [0.707, 0.707, 0.000]"),
    ],
)
def test_one_baseline_leaves_one_angle_open_and_names_it(baseline, name):
    rng = np.random.default_rng(7)
    R_nb = rotations.exp(0.5 * rng.normal(size=(20, 3)))
    solution, _ = solve(R_nb, rng, antennas_b_m=np.array([[0, 0, 0], baseline]))
    assert solution.solved.all()
    assert solution.unobservable() == (name,)
    axis = np.array(baseline) / np.linalg.norm(baseline)
    variance = np.einsum("i,nij,j->n", axis, solution.covariance_rad2, axis)
    assert_allclose(variance, open_angle_variance_rad2())
    ahead = solution.R_nb @ axis - R_nb @ axis
    assert np.abs(ahead).max() < np.radians(3)


def test_a_baseline_along_the_body_axis_gives_yaw_and_pitch_with_zero_roll():
    rng = np.random.default_rng(8)
    euler = np.tile([0.0, 0.2, -2.5], (10, 1))
    solution, _ = solve(
        rotations.from_euler(*euler.T), rng, antennas_b_m=np.array([[0, 0, 0], [1.6, 0, 0]])
    )
    assert_allclose(rotations.to_euler(solution.R_nb), euler, atol=np.radians(1))
    assert_allclose(rotations.to_euler(solution.R_nb)[:, 0], 0, atol=1e-9)


def test_nothing_measured_is_not_solved():
    rng = np.random.default_rng(9)
    differences, true = synthetic(np.eye(3)[None], sky(6, rng), rng)
    none = type(true)(
        resolver="none", cycles=true.cycles * 0, fixed=true.fixed & False, ratio=true.ratio
    )
    solution = maximum_likelihood(RotationQuadratic.of_double_differences(differences, none))
    assert not solution.solved.any()
    assert solution.unobservable() == ()


@pytest.mark.parametrize(("louder", "believed"), [(1.0, 1.0), (0.5, 0.5), (2.0, 2.0), (10.0, 3.0)])
def test_noise_is_raised_to_what_residuals_say_and_no_further(louder, believed):
    rng = np.random.default_rng(11)
    R_nb = rotations.exp(rng.normal(size=(400, 3)))
    differences, true = synthetic(R_nb, sky(7, rng), rng, phase_m=0.003 * louder)
    # Stated as 3 mm whatever it is.
    stated = dataclasses.replace(
        differences, phase_variance_m2=np.full(differences.e_n.shape[:2], 0.003**2)
    )
    form = RotationQuadratic.of_double_differences(stated, true)
    raised, solution, notes = agreeing(form)
    factor = np.sqrt(form.information[0, 0, 0] / raised.information[0, 0, 0])
    assert_allclose(factor, believed, rtol=0.05)
    assert bool(notes) == (louder != 1)
    if louder == 2:
        assert solution.consistent().mean() > 0.995


def test_wrong_integers_in_a_third_of_the_epochs_are_not_taken_for_noise():
    rng = np.random.default_rng(12)
    R_nb = rotations.exp(rng.normal(size=(300, 3)))
    differences, true = synthetic(R_nb, sky(7, rng), rng)
    cycles = true.cycles.copy()
    cycles[:100, 3, 2] += 1
    wrong = dataclasses.replace(true, cycles=cycles)
    form = RotationQuadratic.of_double_differences(differences, wrong)
    _, solution, _ = agreeing(form)
    assert not solution.consistent()[:100].any()
    assert solution.consistent()[100:].mean() > 0.99
