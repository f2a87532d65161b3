"""What every sensor's factor must satisfy."""

import gtsam
import numpy as np

from fgnav.graph import keys
from fgnav.graph.factors.check import jacobian_misfit, values_of
from fgnav.graph.factors.check import random_states as random_states
from fgnav.graph.types.parameters import Parameters
from fgnav.graph.types.sensor import Sensor
from fgnav.graph.types.states import AUX, States


def normal_equations(factor: gtsam.NonlinearFactor, values, k: int, at: States, shared: Parameters):
    """Return J'J and J'r of a factor of keyframe k, in the order of ``Linearised``."""
    A, minus_r = factor.linearize(values).jacobian()
    first = {keys.pose(k): (0, 6), keys.velocity(k): (6, 3)}
    first[keys.imu_bias(k)] = first[keys.angular_motion(k)] = (AUX, at.aux.shape[1])
    for p, (at_column, part) in enumerate(zip(shared.first, shared.parts, strict=True)):
        first[keys.constant(p)] = (at.width + at_column, part.size)
    columns = np.concatenate(
        [first[key][0] + np.arange(first[key][1]) for key in list(factor.keys())]
    )
    J = np.zeros((len(A), at.width + shared.width))
    J[:, columns] = A
    return J.T @ J, -J.T @ minus_r


def assert_factor(measurement: Sensor, at: States, shared: Parameters) -> None:
    """Hold factors against differences, and the arrays of all measurements against the factors."""
    values, which = values_of(at, shared), np.arange(len(measurement.row))
    value, state, by_constants = measurement.linearise(at, which)
    for i in which.tolist():
        factor, r = measurement.factor(i, i), value[i]
        assert jacobian_misfit(factor, values) < 1e-6
        J = np.concatenate([state[i], by_constants[i]], axis=1)
        H, g = normal_equations(factor, values, i, at, shared)
        size = np.abs(J.T @ J).max()
        np.testing.assert_allclose(H, J.T @ J, rtol=0, atol=1e-9 * size)
        scale = np.sqrt(size) * max(np.linalg.norm(r), 1.0)
        np.testing.assert_allclose(g, J.T @ r, rtol=0, atol=1e-9 * scale)
        np.testing.assert_allclose(2 * factor.error(values), r @ r, rtol=1e-9)
