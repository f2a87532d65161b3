"""A flight's chain linearised once, whose noises may be changed: likelihood, score, information.

Each component c multiplies a standard deviation by ``exp(theta_c)``. With whitened smoothed
residuals r, their Jacobian J, the smoothed covariance P, ``M = I - J P J'`` and C the component's
share of the rows' covariance, the marginal likelihood's derivative by theta is
``r' C r - tr(C M)`` [1]_: what is left of the residuals against what should be left of them.

Where a flight rests, white noise of its unit, positions and velocities are components of their own.

References
----------
.. [1] Harville: Maximum likelihood approaches to variance component estimation and to related
   problems, Journal of the American Statistical Association 72, 1977, equation 5.5.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.frontend.sensors.rest import AT_REST
from fgnav.graph.types.measurement import Linearised
from fgnav.graph.types.motion import NoiseParts
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.identification.likelihood import chain_kernel
from fgnav.identification.likelihood.chain_kernel import CHUNK
from fgnav.solve.chain import back_kernel, kernel
from fgnav.solve.chain.linear import Links, linearise


class Covariances(NamedTuple):
    """Of the n states of a chain: each, with the next, with the constants, and of these."""

    diagonal: FloatArray  # (n, D, D)
    cross: FloatArray  # (n - 1, D, D)
    shared: FloatArray  # (n, D, b)
    constants: FloatArray  # (b, b)

    @property
    def given_constants(self) -> tuple[FloatArray, FloatArray]:
        """Own and cross covariances where the constants are known: those of a Markov chain."""
        X = self.shared
        by = np.linalg.solve(self.constants, X.swapaxes(1, 2))
        return self.diagonal - X @ by, self.cross - X[:-1] @ by[1:]


class Score(NamedTuple):
    """The marginal likelihood at noises, and where the linear problem has its minimum."""

    log_likelihood: float
    squares: FloatArray  # (c,), r' C r
    redundancy: FloatArray  # (c,), tr(C M)
    neighbours: FloatArray  # (c, c), information of theta without products of distant residuals
    steps: FloatArray  # (n, D)
    constant_steps: FloatArray  # (b,)
    constant_covariance: FloatArray  # (b, b)
    cost: float  # where it is linearised
    promised: float  # decrease of it by the steps
    covariances: Covariances | None  # None where they were not asked for

    @property
    def gradient(self) -> FloatArray:
        """Derivative of the log likelihood by theta, (c,)."""
        return self.squares - self.redundancy

    @property
    def information(self) -> FloatArray:
        """Information of theta, (c, c), between its bounds.

        Distant residuals' products only add to it, and ``tr(C M C M) <= tr(C M)``: it lies between
        that of neighbours and twice the redundancy. The middle is within 40 % of the curvature.
        """
        return np.asarray((self.neighbours + np.diag(2 * self.redundancy.clip(0))) / 2)


class AtRest(NamedTuple):
    """Keyframes at rest, and measurements whose noise is another component there."""

    row: BoolArray  # (n,)
    names: tuple[str, ...]


class _Sensor(NamedTuple):
    name: str  # of its component
    rows: IntArray
    linear: Linearised
    squares: FloatArray  # (n, W, W), its augmented information by keyframe

    @classmethod
    def of(cls, name: str, rows: IntArray, linear: Linearised, node: FloatArray) -> "_Sensor":
        linear = Linearised(*map(np.ascontiguousarray, linear))
        squares = np.zeros_like(node)
        kernel.add_squares(squares, rows, *linear)
        return cls(name, rows, linear, squares)

    def divided(self, at_rest: BoolArray) -> "tuple[_Sensor, ...]":
        """Return what it measures in motion and at rest, (k,), as two."""
        return tuple(
            _Sensor.of(name, self.rows[of], Linearised(*(x[of] for x in self.linear)), self.squares)
            for name, of in ((self.name, ~at_rest), (self.name + AT_REST, at_rest))
        )


@dataclass(frozen=True, eq=False, slots=True)
class LinearChain:
    """A problem linearised at states.

    Attributes
    ----------
    names : tuple of str
        Components: sensors of the motion, then measurements, each with those at rest.
    """

    names: tuple[str, ...]
    _motion: FloatArray
    _parts: FloatArray
    _rest: FloatArray
    _sensors: tuple[_Sensor, ...]
    _node: FloatArray  # what no component changes
    _whitening: float  # log determinant of that of what is known before, and of the motion
    _counts: FloatArray  # of whitened rows by sensor

    @classmethod
    def of(
        cls,
        problem: SmoothingProblem,
        states: States,
        divided: NoiseParts,
        scaled: tuple[str, ...],
        at_rest: AtRest | None = None,
    ) -> "LinearChain":
        """Linearise a problem.

        Parameters
        ----------
        problem : SmoothingProblem
        states : States
        divided : NoiseParts
            Of the motion.
        scaled : tuple of str
            Names of measurements whose noise is a component.
        at_rest : AtRest, optional
        """
        n, D, b = len(problem.t_s), problem.width, problem.constants.width
        links = Links.empty(n, D, b)
        fixed = tuple(one for one in problem.measurements if one.name not in scaled)
        rest = replace(problem, measurements=fixed)
        for begin in range(0, n, CHUNK):
            rows = np.arange(begin, min(begin + CHUNK, n))
            before = states.at(rows[rows > 0] - 1)
            linearise(rest, rows, states.at(rows), before, links, rows)
        sensors: list[_Sensor] = []
        for one in problem.measurements:
            if one.name in scaled:
                made = one.linearise(states.at(one.row), np.arange(len(one.row)))
                sensor = _Sensor.of(one.name, one.row, made, links.node)
                if at_rest is None or one.name not in at_rest.names:
                    sensors.append(sensor)
                else:
                    sensors += sensor.divided(at_rest.row[one.row])
        _, white = problem.motion.prior(b)
        # Rows that are not whitened have a Jacobian of about one by the next state.
        after = np.linalg.slogdet(links.motion[1:, :, D : 2 * D])[1]
        return cls(
            (*divided.names, *(one.name for one in sensors)),
            links.motion[1:],
            np.ascontiguousarray(divided.parts),
            np.ascontiguousarray(divided.rest),
            tuple(sensors),
            links.node,
            float(np.linalg.slogdet(white[:, : problem.motion.aux])[1] + after.sum()),
            np.array([float(one.linear.state.any(axis=2).sum()) for one in sensors]),
        )

    def residuals(self, name: str, score: Score) -> FloatArray:
        """Return a scaled measurement's smoothed residuals, whitened as stated, (k, m)."""
        _, rows, linear, _ = next(one for one in self._sensors if one.name == name)
        moved = np.einsum("kmd,kd->km", linear.state, score.steps[rows])
        return np.asarray(linear.value + moved + linear.shared @ score.constant_steps)

    def score(self, theta: FloatArray, *, whole: bool = True) -> Score | None:
        """Return likelihood and derivatives at log factors on standard deviations, (c,).

        None where the chain has no solution there; without ``whole`` the likelihood alone.
        """
        n, W = len(self._node), self._node.shape[1]
        D = self._motion.shape[1]
        b, own = W - D - 1, self._parts.shape[1]
        variance = np.exp(2 * theta)
        motion, root = np.zeros((n, *self._motion.shape[1:])), np.empty((n - 1, D, D))
        log_det = chain_kernel.whiten(
            self._motion, self._parts, self._rest, variance[:own], motion[1:], root
        )
        if not np.isfinite(log_det):
            return None
        node = self._node.copy()
        for one, v in zip(self._sensors, variance[own:], strict=True):
            node += one.squares / v
        forward = np.empty_like(node)
        roots, gain = np.zeros((n, D, D)), np.empty((n - 1, D, W))
        forward[0] = node[0]
        if kernel.eliminate(motion, node, forward, roots, gain, False) >= 0:
            return None
        end, covariance = np.empty(D + b), np.empty((D + b, D + b))
        least = back_kernel.newest(forward[-1], covariance, end)
        if not np.isfinite(least):
            return None
        likelihood = -least / 2 - log_det / 2 - float(self._counts @ theta[own:]) + self._whitening
        likelihood -= np.log(np.einsum("nii->ni", roots[:-1])).sum()
        likelihood += float(np.linalg.slogdet(covariance)[1]) / 2
        steps = np.empty((n, D))
        back_kernel.substitute(gain, end, steps)
        cost = float(node[:, -1, -1].sum() + (motion[:, :, -1] ** 2).sum())
        c = len(theta)
        squares, redundancy, information = np.zeros(c), np.zeros(c), np.zeros((c, c))
        covariances = None
        if whole:
            P, cross, shared = roots, np.empty((n - 1, D, D)), np.empty((n, D, b))
            back_kernel.marginals(gain, roots, covariance, P, cross, shared)
            step = (steps, end[D:])
            covariances = Covariances(P, cross, shared, covariance[D:, D:])
            of_motion = np.zeros((own, own))
            chain_kernel.motion_score(
                motion[1:],
                root,
                self._parts,
                variance[:own],
                step,
                covariances,
                (squares[:own], redundancy[:own], of_motion),
            )
            information[:own, :own] = of_motion
            for i, one in enumerate(self._sensors):
                scaled = [part * np.exp(-theta[own + i]) for part in one.linear]
                score = chain_kernel.measurement_score(
                    scaled[0], scaled[1], scaled[2], one.rows, step, (P, shared, covariance[D:, D:])
                )
                squares[own + i], redundancy[own + i] = score[:2]
                information[own + i, own + i] = score[2]
        return Score(
            likelihood,
            squares,
            redundancy,
            4 * information,
            steps,
            end[D:],
            covariance[D:, D:],
            cost,
            cost - float(least),
            covariances,
        )


def motion_score(
    problem: SmoothingProblem, solution: Solution
) -> tuple[tuple[str, ...], FloatArray, FloatArray, FloatArray]:
    """Return noises of the motion, their squares, redundancy, (c,), and information, (c, c).

    At a minimum, of all that the problem knows; noises as stated. A hundred intervals at a time:
    all of an hour would take 1 GB.
    """
    if solution.cross is None:
        raise ValueError("solution: needs covariances of neighbours")
    states, motion, n = solution.states, problem.motion, len(problem.t_s)
    names = motion.noise_parts(slice(0)).names
    c, b = len(names), problem.constants.width
    out = np.zeros(c), np.zeros(c), np.zeros((c, c))
    for begin in range(0, n - 1, CHUNK):
        k = np.arange(begin, min(begin + CHUNK, n - 1))
        of, ends = slice(begin, k[-1] + 1), slice(begin, k[-1] + 2)
        linear = motion.linearise(states.at(k), states.at(k + 1), k)
        sides = linear.before, linear.after, linear.shared, -linear.value[:, :, None]
        _, *divided = motion.noise_parts(of)
        parts, rest = map(np.ascontiguousarray, divided)
        white = np.concatenate(sides, axis=2)
        root = np.empty_like(rest)
        chain_kernel.whiten(white.copy(), parts, rest, np.ones(c), white, root)
        covariances = (
            solution.covariance[ends],
            solution.cross[of],
            solution.constant_cross[ends],
            solution.constant_covariance[-1],
        )
        steps = np.zeros((len(k) + 1, problem.width)), np.zeros(b)
        chain_kernel.motion_score(white, root, parts, np.ones(c), steps, covariances, out)
    return names, *out
