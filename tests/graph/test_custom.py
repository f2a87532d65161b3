import gtsam
import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.graph import jacobian_misfit, keys
from fgnav.graph.custom import (
    NamedFactor,
    check_factor,
    named,
    residual_factor,
    touched_keyframes,
)

V0, V1, X0, B0 = keys.velocity(0), keys.velocity(1), keys.pose(0), keys.imu_bias(0)


def values() -> gtsam.Values:
    found = gtsam.Values()
    found.insert(V0, np.array([1.0, 2.0, 3.0]))
    found.insert(V1, np.array([2.0, 2.0, 3.0]))
    found.insert(X0, gtsam.Pose3(gtsam.Rot3.Ypr(0.3, -0.2, 0.1), np.array([4.0, 5.0, 6.0])))
    found.insert(B0, gtsam.imuBias.ConstantBias(np.full(3, 0.1), np.full(3, 0.2)))
    return found


def by_lm(factor, at):
    graph = gtsam.NonlinearFactorGraph()
    graph.add(factor)
    parameters = gtsam.LevenbergMarquardtParams()
    return gtsam.LevenbergMarquardtOptimizer(graph, at, parameters).optimize()


def by_isam(factor, at):
    graph, parameters = gtsam.NonlinearFactorGraph(), gtsam.ISAM2Params()
    graph.add(factor)
    parameters.setFactorization("QR")
    isam = gtsam.ISAM2(parameters)
    isam.update(graph, at)
    return isam.calculateEstimate()


def by_fixed_lag(factor, at):
    graph, parameters = gtsam.NonlinearFactorGraph(), gtsam.ISAM2Params()
    graph.add(factor)
    parameters.setFactorization("QR")
    smoother = gtsam.IncrementalFixedLagSmoother(2.0, parameters)
    smoother.update(graph, at, {V0: 0.0})
    return smoother.calculateEstimate()


SOLVERS = [by_lm, by_isam, by_fixed_lag]


def only_velocity() -> gtsam.Values:
    found = gtsam.Values()
    found.insert(V0, np.ones(3))
    return found


def test_a_factor_of_ones_own_is_gtsams_where_gtsam_has_it():
    mean, covariance = np.array([0.5, 1.0, -1.0]), np.diag([1.0, 4.0, 9.0]) + 0.3
    own = residual_factor("prior", [V0], lambda v: v - mean, covariance)
    noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
    native = gtsam.PriorFactorVector(V0, mean, noise)
    at = values()
    assert own.factor.error(at) == pytest.approx(native.error(at), rel=1e-12)
    A, b = own.factor.linearize(at).jacobian()
    B, c = native.linearize(at).jacobian()
    np.testing.assert_allclose(A, B, rtol=0, atol=1e-9)
    np.testing.assert_allclose(b, c, rtol=0, atol=1e-12)


def test_differences_follow_the_tangent_of_every_variable():
    arm_b_m, z = np.array([0.3, 0.1, -0.2]), np.array([1.0, 1.0, 1.0])
    own = residual_factor("antenna", [X0], lambda x: x.transformFrom(arm_b_m) - z, 0.1, dimension=3)
    noise = gtsam.noiseModel.Isotropic.Sigma(3, 0.1)
    native = gtsam.GPSFactorArm(X0, z, arm_b_m, noise)
    A = own.factor.linearize(values()).jacobian()[0]
    np.testing.assert_allclose(A, native.linearize(values()).jacobian()[0], rtol=0, atol=1e-7)


def test_a_bias_enters_as_gtsams_own_type():
    own = residual_factor("bias", [B0], lambda b: b.accelerometer(), np.ones(3))
    A, minus_r = own.factor.linearize(values()).jacobian()
    np.testing.assert_allclose(A, np.eye(3, 6), rtol=0, atol=1e-9)
    np.testing.assert_allclose(minus_r, -0.1, rtol=0, atol=1e-12)


def test_a_right_jacobian_agrees_with_differences_and_a_wrong_one_does_not():
    def step(v, w):
        return np.array([w @ w - v @ v])

    right = residual_factor(
        "step", [V0, V1], step, 1.0, dimension=1, jacobian=lambda v, w: (-2 * v[None], 2 * w[None])
    )
    wrong = residual_factor(
        "step", [V0, V1], step, 1.0, dimension=1, jacobian=lambda v, w: (2 * v[None], 2 * w[None])
    )
    assert jacobian_misfit(right, values()) < 1e-8
    assert jacobian_misfit(wrong, values()) > 0.1


def boom(_):
    raise KeyError("no\nsuch row")


def same(v):
    return v


WRONG = [
    (lambda v: v[:2], None, r"residual has shape \(2,\), expected \(3,\)"),
    (lambda v: v[:, None], None, r"residual has shape \(3, 1\), expected \(3,\)"),
    (lambda _: None, None, r"residual has shape \(\), expected \(3,\)"),
    (lambda v: v * np.nan, None, "residual is not finite"),
    (boom, None, "residual raised KeyError: 'no"),
    (same, lambda _: (np.eye(2),), r"jacobian by v0 has shape \(2, 2\), expected \(3, 3\)"),
    (same, lambda _: (np.ones(3),), r"jacobian by v0 has shape \(3,\), expected \(3, 3\)"),
    (same, lambda _: (np.ones((3, 5)),), r"by v0 has shape \(3, 5\), expected \(3, 3\)"),
    (same, lambda _: (np.full((3, 3), np.inf),), "jacobian by v0 is not finite"),
    (same, lambda _: np.eye(3), "returned 3 blocks, expected 1, one for each of v0"),
    (same, lambda _: 7, "jacobian raised TypeError"),
    (same, boom, "jacobian raised KeyError"),
]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(("residual", "jacobian", "text"), WRONG)
def test_what_is_wrong_with_a_factor_arrives_in_one_line(solver, residual, jacobian, text):
    own = residual_factor("wheels", [V0], residual, np.ones(3), jacobian=jacobian)
    with pytest.raises(BadInputError, match=f"^factor 'wheels'.*{text}") as raised:
        solver(own.factor, only_velocity())
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("good", [2, 3, 5])
def test_an_error_while_a_solver_is_under_way_arrives_too(solver, good):
    count = 0

    def residual(v):
        nonlocal count
        count += 1
        return v**3 - 8 if count <= good else v[:2]

    own = residual_factor(
        "late", [V0], residual, np.ones(3), jacobian=lambda v: (np.diag(3 * v**2),)
    )
    at = only_velocity()
    at.update(V0, np.full(3, 5.0))

    def again_and_again():
        for _ in range(good + 1):
            solver(own.factor, at)

    with pytest.raises(BadInputError, match="residual has shape"):
        again_and_again()


def test_a_variable_that_is_not_there_is_named():
    own = residual_factor("wheels", [keys.pose(9)], lambda x: x.translation(), np.ones(3))
    with pytest.raises(BadInputError, match="factor 'wheels': x9 is not among the variables"):
        check_factor(own, values())
    plain = gtsam.PriorFactorVector(keys.velocity(9), np.zeros(3), None)
    with pytest.raises(BadInputError, match="factor 'PriorFactorVector': v9 is not among"):
        check_factor(named(plain), values())


def test_a_plain_factor_on_a_variable_of_another_type_is_refused():
    plain = gtsam.PriorFactorVector(X0, np.zeros(3), None)
    with pytest.raises(BadInputError, match="factor 'PriorFactorVector': Attempting to retrieve"):
        check_factor(named(plain), values())


def test_a_plain_factor_without_a_finite_error_is_refused():
    plain = gtsam.PriorFactorVector(V0, np.full(3, np.nan), gtsam.noiseModel.Unit.Create(3))
    with pytest.raises(BadInputError, match="factor 'PriorFactorVector': its error is not finite"):
        check_factor(named(plain), values())


@pytest.mark.parametrize(
    ("name", "given", "noise", "dimension", "text"),
    [
        ("", [V0], np.ones(3), None, "needs a name and keys"),
        ("w", [], np.ones(3), None, "needs a name and keys"),
        ("w", [V0, V0], np.ones(3), None, "needs a name and keys, each once"),
        ("w", [V0], 1.0, None, "noise must be positive 1-sigmas"),
        ("w", [V0], np.array([1.0, 0.0]), None, r"noise must be .* got shape \(2,\)"),
        ("w", [V0], np.diag([1.0, -1.0]), None, "noise must be"),
        ("w", [V0], np.array([[1.0, 2.0], [0.0, 1.0]]), None, "noise must be"),
        ("w", [V0], np.full((2, 2), np.nan), None, "noise must be"),
        ("w", [V0], np.ones(2), 3, "dimension is 3, its noise has 2"),
    ],
)
def test_a_factor_without_sense_is_refused(name, given, noise, dimension, text):
    with pytest.raises(BadInputError, match=text):
        residual_factor(name, given, lambda v: v, noise, dimension=dimension)


def test_a_factor_keeps_its_name_and_says_which_keyframe_it_needs():
    own = residual_factor("odometry", [V0, V1, keys.constant(7)], lambda *_: [0.0], np.ones(1))
    assert named(own) is own
    assert isinstance(own, NamedFactor)
    assert touched_keyframes(own.factor) == [0, 1]
    plain = gtsam.PriorFactorVector(keys.constant(3), np.zeros(3), None)
    assert named(plain).name == "PriorFactorVector"
    assert touched_keyframes(plain) == []
