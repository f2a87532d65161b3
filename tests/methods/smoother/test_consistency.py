import dataclasses

import gtsam
import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.methods.smoother.batch import solve_batch
from fgnav.methods.smoother.consistency import consistency
from fgnav.methods.smoother.directions import Directions
from fgnav.methods.smoother.estimates import origin_motion
from fgnav.methods.smoother.observability import undetermined
from fgnav.methods.smoother.residuals import residuals
from fgnav.methods.smoother.window import solve_forward
from fgnav.rotations import exp, transpose

from .flights import turning

LANDMARK = np.array([3000.0, 500.0, 100.0])
STEP = 1e-5


@pytest.fixture(scope="module")
def keyframes():
    """Every kind of measurement, the antenna off the accelerometer."""
    case = turning(np.random.default_rng(0), span_s=12.0)
    rng, R_bn, n = np.random.default_rng(1), transpose(case.truth.R_nb), len(case.truth.t_s)
    keyframes = case.keyframes
    arm = np.array([0.3, -0.2, 0.1])

    def seen(v_n, sigma_rad, rows):
        """Known as well as stated: about one axis, a new one each time, four times better."""
        u = np.einsum("nij,nj->ni", R_bn, v_n / np.linalg.norm(v_n, axis=1, keepdims=True))
        turn = exp(rng.standard_normal((n, 3)))
        root = turn * (sigma_rad * np.array([1.0, 0.25, 0.25]))
        u += np.einsum("nij,nj->ni", root, rng.standard_normal((n, 3)))
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        return Directions.of("some", u, root @ transpose(root))[rows].at(rows, n)

    sight = seen(LANDMARK - case.truth.p_n_m, 2e-3, np.arange(n // 2, n))
    position = keyframes.position
    # What foretells a sine a tenth of a second ahead: less is enough with data on both sides.
    preintegrate = dataclasses.replace(
        keyframes.preintegrate, angular_acceleration_density=np.full(3, 0.03)
    )
    return dataclasses.replace(
        keyframes,
        gravity=seen(keyframes.gravity_n_mps2, 0.05, np.arange(n)),
        sight=sight,
        landmark_n_m=LANDMARK,
        preintegrate=preintegrate,
        position=dataclasses.replace(
            position, value=position.value + case.truth.R_nb @ arm, arm_b_m=arm
        ),
    )


@pytest.fixture(scope="module")
def solution(keyframes):
    return solve_batch(keyframes)


def moved(solution, k, by):
    """The solution with all poses and velocities a step along one of nine dimensions away."""
    step = np.zeros(9)
    step[k] = by
    poses = [
        gtsam.Pose3(gtsam.Rot3(R), p).retract(step[:6])
        for R, p in zip(solution.R_nb, solution.p_n_m, strict=True)
    ]
    return dataclasses.replace(
        solution,
        R_nb=np.array([pose.rotation().matrix() for pose in poses]),
        p_n_m=np.array([pose.translation() for pose in poses]),
        v_n_mps=solution.v_n_mps + step[6:],
    )


def test_every_jacobian_equals_finite_differences(keyframes, solution):
    found = residuals(keyframes, solution)
    assert [part.what for part in found] == [
        "array phases",
        "position",
        "velocity",
        "gravity",
        "line of sight",
    ]
    for k in range(9):
        ahead, behind = (residuals(keyframes, moved(solution, k, by)) for by in (STEP, -STEP))
        for part, a, b in zip(found, ahead, behind, strict=True):
            numeric = (a.value - b.value) / (2 * STEP)
            scale = np.abs(part.jacobian).max()
            assert_allclose(part.jacobian[:, :, k] / scale, numeric / scale, atol=1e-6)


@pytest.mark.parametrize("solve", [solve_batch, lambda keyframes: solve_forward(keyframes, 2.0)])
def test_right_measurements_have_normalised_innovations_of_one(keyframes, solve):
    found = consistency(keyframes, solve(keyframes))
    for part in found:
        assert abs(part.nis - 1) < 3.5 * np.sqrt(2 / part.freedom) + 0.05, part
        assert part.beyond_99 < 0.06, part
        assert part.count > 0.9 * (60 if part.what == "line of sight" else 120)


def test_noise_that_is_stated_too_small_shows_in_its_kind(keyframes):
    velocity = keyframes.velocity
    wrong = dataclasses.replace(
        keyframes, velocity=dataclasses.replace(velocity, covariance=velocity.covariance / 4)
    )
    found = {part.what: part for part in consistency(wrong, solve_batch(wrong))}
    assert found["velocity"].nis > 2.5
    assert found["velocity"].beyond_99 > 0.1
    assert found["position"].nis < 1.3


def test_a_determined_flight_has_nothing_open(keyframes, solution):
    names, _ = undetermined(keyframes, solution)
    assert names == ()


def test_open_states_are_named(keyframes, solution):
    covariance = solution.covariance.copy()
    down_b = solution.R_nb[:, 2]
    covariance[:, :3, :3] += 9.0 * down_b[:, :, None] * down_b[:, None, :]
    covariance[:, 3:6, 3:6] += 1e8 * np.eye(3)
    covariance[:, 6:9, 6:9] += 1e6 * np.eye(3)
    covariance[:, 9, 9] = keyframes.slot_sigma[0] ** 2
    opened = dataclasses.replace(solution, covariance=covariance)
    names, note = undetermined(keyframes, opened)
    assert names == ("heading", "position", "velocity")
    assert "accelerometer bias along x_b" in note
    covariance[:, :3, :3] = solution.covariance[:, :3, :3] + 9.0 * np.diag([1.0, 0, 0])
    assert undetermined(keyframes, opened)[0][0] == "roll"


def test_the_origin_moves_with_the_state_and_its_covariance_by_the_right_derivatives(solution):
    arm, earth, told = np.array([0.4, 0.3, -0.2]), np.array([5e-5, 0, -5e-5]), np.ones(3)
    told = np.tile(told, (len(solution.R_nb), 1))
    one = dataclasses.replace(solution, covariance=np.tile(np.eye(15), (len(told), 1, 1)))
    found = origin_motion(one, told, arm, earth)
    p, v = np.zeros((2, len(told), 3, 3))
    for k in range(15):
        ends = []
        for by in (STEP, -STEP):
            at = moved(one, k, by) if k < 9 else one
            slot = at.slot.copy()
            if k >= 9:
                slot[:, k - 9] += by
            ends.append(origin_motion(dataclasses.replace(at, slot=slot), told, arm, earth))
        d = (ends[0].p_n_m - ends[1].p_n_m) / (2 * STEP)
        p += d[:, :, None] * d[:, None, :]
        d = (ends[0].v_n_mps - ends[1].v_n_mps) / (2 * STEP)
        v += d[:, :, None] * d[:, None, :]
    assert_allclose(found.position_covariance_m2, p, atol=1e-6)
    assert_allclose(found.velocity_covariance_m2ps2, v, atol=1e-6)


def test_without_a_gyroscope_it_says_nothing(keyframes):
    assert not keyframes.preintegrate.told_radps(keyframes.t_s).any()
