"""What every sensor's factor must satisfy."""

import gtsam
import numpy as np

from fgnav.graph import keys
from fgnav.graph.factors.check import random_states as random_states
from fgnav.graph.types.parameters import Parameters
from fgnav.graph.types.sensor import Sensor
from fgnav.graph.types.states import AUX, States

STEP = 1e-6


def differences(measurement: Sensor, at: States, which) -> tuple[np.ndarray, np.ndarray]:
    """Return derivatives by states and constants by central differences."""
    n, D, b = len(which), at.width, len(at.constants)

    def value(step, of_constants):
        return measurement.linearise(at.moved(step, of_constants), which).value

    state, shared = [], []
    for j in range(D):
        step = np.zeros((n, D))
        step[:, j] = STEP
        state.append((value(step, np.zeros(b)) - value(-step, np.zeros(b))) / (2 * STEP))
    for j in range(b):
        step = STEP * np.eye(b)[j]
        none = np.zeros((n, D))
        shared.append((value(none, step) - value(none, -step)) / (2 * STEP))
    m = state[0].shape[1]
    return (
        np.stack(state, axis=2),
        np.stack(shared, axis=2) if shared else np.zeros((n, m, 0)),
    )


def assert_jacobians(measurement: Sensor, at: States) -> None:
    """Hold the Jacobians of all measurements against central differences."""
    which = np.arange(len(measurement.row))
    linearised = measurement.linearise(at, which)
    state, shared = differences(measurement, at, which)
    size = max(np.abs(state).max(), 1.0)
    # Half the digits of a difference over 1e-6 at values of tens of metres.
    np.testing.assert_allclose(linearised.state, state, rtol=0, atol=2e-7 * size)
    np.testing.assert_allclose(linearised.shared, shared, rtol=0, atol=2e-7 * size)


def values_of(at: States, i: int, shared: Parameters, key: int) -> gtsam.Values:
    """Return state i as GTSAM's variables of keyframe ``key``."""
    values = gtsam.Values()
    values.insert(keys.pose(key), gtsam.Pose3(gtsam.Rot3(at.R_nb[i]), at.p_n_m[i]))
    values.insert(keys.velocity(key), at.v_n_mps[i])
    if at.aux.shape[1] == 6:
        bias = gtsam.imuBias.ConstantBias(at.aux[i, :3], at.aux[i, 3:])
        values.insert(keys.imu_bias(key), bias)
    else:
        values.insert(keys.angular_motion(key), at.aux[i])
    for p, (first, part) in enumerate(zip(shared.first, shared.parts, strict=True)):
        values.insert(keys.constant(p), at.constants[first : first + part.size])
    return values


def normal_equations(measurement: Sensor, at: States, i: int, shared: Parameters):
    """Return J'J and J'r of measurement i by its GTSAM form, in the order of ``Linearised``."""
    values = values_of(at, i, shared, 7)
    factor = measurement.factor(i, 7)
    A, minus_r = factor.linearize(values).jacobian()
    first = {keys.pose(7): (0, 6), keys.velocity(7): (6, 3)}
    first[keys.imu_bias(7)] = first[keys.angular_motion(7)] = (AUX, at.aux.shape[1])
    for p, (at_column, part) in enumerate(zip(shared.first, shared.parts, strict=True)):
        first[keys.constant(p)] = (at.width + at_column, part.size)
    J, column = np.zeros((len(A), at.width + shared.width)), 0
    for key in list(factor.keys()):
        begin, size = first[key]
        J[:, begin : begin + size] = A[:, column : column + size]
        column += size
    assert column == A.shape[1]
    return J.T @ J, -J.T @ minus_r, 2 * factor.error(values)


def assert_gtsam_says_the_same(
    measurement: Sensor, at: States, shared: Parameters, *, rtol: float = 1e-9
) -> None:
    """Hold GTSAM's error and linear system of every measurement against the kernel's."""
    which = np.arange(len(measurement.row))
    value, state, by_constants = measurement.linearise(at, which)
    for i in which:
        J = np.concatenate([state[i], by_constants[i]], axis=1)
        H, g, cost = normal_equations(measurement, at, i, shared)
        size = np.abs(J.T @ J).max()
        np.testing.assert_allclose(H, J.T @ J, rtol=0, atol=rtol * size)
        scale = np.sqrt(size) * max(np.linalg.norm(value[i]), 1.0)
        np.testing.assert_allclose(g, J.T @ value[i], rtol=0, atol=rtol * scale)
        np.testing.assert_allclose(cost, value[i] @ value[i], rtol=rtol)


def assert_factor(measurement: Sensor, at: States, shared: Parameters) -> None:
    """Hold a sensor's Jacobians against differences, and its GTSAM factors against the kernel."""
    assert_jacobians(measurement, at)
    assert_gtsam_says_the_same(measurement, at, shared)
