"""Stand-ins for sensors and motion: random rows, linear in ``(Log R, p, v, aux, constants)``.

The dense normal equations assembled here share no line with the library.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry.rotation_kernel import inverse_right_jacobian
from fgnav.geometry.rotations import exp, log
from fgnav.graph.types.motion import LinearisedMotion
from fgnav.graph.types.parameters import Parameters, flight_constant
from fgnav.graph.types.problem import Problem, pose_prior
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import States

STEP_S = 0.25


def coordinates(states: States) -> tuple[FloatArray, FloatArray]:
    """Return the vectors that rows are linear in, (n, D), and their derivatives, (n, D, D)."""
    n, D = len(states.R_nb), states.width
    turn = log(states.R_nb)
    J = np.tile(np.eye(D), (n, 1, 1))
    J[:, 3:6, 3:6] = states.R_nb
    for k in range(n):
        J[k, :3, :3] = inverse_right_jacobian(turn[k])
    return np.hstack([turn, states.p_n_m, states.v_n_mps, states.aux]), J


@dataclass(frozen=True, eq=False)
class RandomMotion:
    """``W (after - F before - B constants - u)``."""

    t_s: FloatArray
    F: FloatArray
    B: FloatArray
    u: FloatArray
    W: FloatArray

    @property
    def aux(self) -> int:
        return self.F.shape[1] - 9

    def linearise(self, before: States, after: States, intervals: IntArray) -> LinearisedMotion:
        (x, J), (y, K) = coordinates(before), coordinates(after)
        W, F, B = self.W[intervals], self.F[intervals], self.B[intervals]
        apart = y - np.einsum("jik,jk->ji", F, x) - B @ before.constants - self.u[intervals]
        value = np.einsum("jik,jk->ji", W, apart)
        return LinearisedMotion(value, -W @ F @ J, W @ K, -W @ B)

    def predict(self, before: States, intervals: IntArray) -> States:
        x, _ = coordinates(before)
        F, B = self.F[intervals], self.B[intervals]
        y = np.einsum("jik,jk->ji", F, x) + B @ before.constants + self.u[intervals]
        return States(exp(y[:, :3]), y[:, 3:6], y[:, 6:9], y[:, 9:], before.constants)

    def release(self, before: int) -> None:
        """Nothing of an interval is kept."""

    def prior(self, constants: int) -> tuple[FloatArray, FloatArray]:
        rows = np.hstack([2 * np.eye(self.aux), np.full((self.aux, constants), 0.3)])
        return np.full(self.aux, 0.1), rows

    def log_white(self, intervals: IntArray) -> float:
        return float(np.linalg.slogdet(self.W[intervals])[1].sum())


@dataclass(frozen=True, eq=False)
class RandomSensor:
    """``H x + S constants - z``."""

    row: IntArray
    H: FloatArray
    S: FloatArray
    z: FloatArray
    name: str = "random"

    @property
    def freedom(self) -> IntArray:
        return np.full(len(self.row), self.H.shape[1])

    def linearise(self, at: States, which: IntArray) -> Linearised:
        x, J = coordinates(at)
        H, S = self.H[which], self.S[which]
        value = np.einsum("jik,jk->ji", H, x) + S @ at.constants - self.z[which]
        return Linearised(value, H @ J, S)


def random_problem(n: int, aux: int, b: int, *, seed: int = 1, turn_rad: float = 0.1) -> Any:
    """Return a problem of n keyframes; residuals are noise of sigma 1, rotations ``turn_rad``."""
    rng, D = np.random.default_rng(seed), 9 + aux
    parts = (flight_constant("c", ("a",) * b, "m", 2.0),) if b else ()
    c = 0.5 * rng.normal(size=b)
    x = np.cumsum(0.3 * rng.normal(size=(n, D)), axis=0)
    x[:, :3] *= turn_rad / 0.3 / np.sqrt(n)
    F = np.eye(D) + 0.1 * rng.normal(size=(n - 1, D, D))
    B = 0.2 * rng.normal(size=(n - 1, D, b))
    W = 5 * np.eye(D) + rng.normal(size=(n - 1, D, D))
    noise = np.linalg.solve(W, 0.2 * rng.normal(size=(n - 1, D, 1)))[..., 0]
    u = x[1:] - np.einsum("jik,jk->ji", F, x[:-1]) - B @ c - noise
    t_s = STEP_S * np.arange(n)
    sensors = []
    for every, rows in ((1, 4), (3, 3)):
        row = np.arange(0, n, every)
        H, S = rng.normal(size=(len(row), rows, D)), rng.normal(size=(len(row), rows, b))
        z = np.einsum("jik,jk->ji", H, x[row]) + S @ c + 0.2 * rng.normal(size=(len(row), rows))
        sensors.append(RandomSensor(row, H, S, z))
    start = States(np.tile(np.eye(3), (n, 1, 1)), x[:, 3:6] + 0.1, 0 * x[:, 6:9], x[:, 9:], 0 * c)
    return Problem(
        t_s=t_s,
        start=start,
        motion=RandomMotion(t_s, F, B, u, W),  # type: ignore[arg-type]
        sensors=tuple(sensors),  # type: ignore[arg-type]
        constants=Parameters(parts),
        attitude_known=np.zeros(n, bool),
    )


def dense(problem: Any, states: States, upto: int | None = None) -> tuple[Any, Any, float]:
    """Return Hessian, gradient and cost of all data of the first ``upto`` keyframes.

    Variables are those keyframes' tangents one after another, then the constants.
    """
    n, D, b = upto or len(problem.t_s), states.width, len(states.constants)
    size = n * D + b
    rows: list[FloatArray] = []
    values: list[FloatArray] = []

    def add(value: FloatArray, blocks: list[tuple[int, FloatArray]]) -> None:
        J = np.zeros((len(value), size))
        for first, block in blocks:
            J[:, first : first + block.shape[1]] = block
        rows.append(J)
        values.append(value)

    x, K = coordinates(states.at(slice(0, 1)))
    x0, _ = coordinates(problem.start.at(slice(0, 1)))
    assert np.array_equal(problem.start.R_nb[0], np.eye(3))
    x0[:, 6:9] = 0.0
    sigma = np.sqrt(np.diag(pose_prior(problem)[1]))
    add((x - x0)[0, :9] / sigma, [(0, K[0, :9] / sigma[:, None])])
    mean, white = problem.motion.prior(b)
    aux = D - 9
    add(
        white @ np.r_[states.aux[0] - mean, states.constants],
        [(9, white[:, :aux]), (n * D, white[:, aux:])],
    )
    if b:
        root = np.linalg.inv(np.linalg.cholesky(problem.constants.covariance))
        add(root @ (states.constants - problem.constants.mean), [(n * D, root)])
    for k in range(n - 1):
        one, two = states.at(slice(k, k + 1)), states.at(slice(k + 1, k + 2))
        motion = problem.motion.linearise(one, two, np.array([k]))
        blocks = [(k * D, motion.before[0]), (k * D + D, motion.after[0])]
        add(motion.value[0], [*blocks, (n * D, motion.shared[0])])
    for sensor in problem.sensors:
        for i, k in enumerate(sensor.row):
            if k < n:
                at = sensor.linearise(states.at(slice(k, k + 1)), np.array([i]))
                add(at.value[0], [(k * D, at.state[0]), (n * D, at.shared[0])])
    J, r = np.vstack(rows), np.concatenate(values)
    return J.T @ J, J.T @ r, float(r @ r)
