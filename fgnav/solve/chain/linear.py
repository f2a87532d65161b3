"""A smoothing problem as a linear chain: what each keyframe adds, and the prior of the first."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.geometry.rotation_kernel import inverse_right_jacobian
from fgnav.geometry.rotations import log
from fgnav.graph.types.problem import SmoothingProblem, pose_prior
from fgnav.graph.types.states import AUX, POSITION, ROTATION, VELOCITY, States
from fgnav.solve.chain import kernel
from fgnav.solve.chain.arcs import LinearPhases, add_phases


class Links(NamedTuple):
    """What enters with n keyframes, see ``kernel``."""

    motion: FloatArray  # (n, D, 2 D + b + 1)
    node: FloatArray  # (n, D + b + a + 1, D + b + a + 1)

    @classmethod
    def empty(cls, n: int, width: int, constants: int, beside: int = 0) -> "Links":
        """Return room for n keyframes with nothing in it."""
        W = width + constants + beside + 1
        motion = np.zeros((n, width, 2 * width + constants + 1))
        return cls(motion=motion, node=np.zeros((n, W, W)))

    def cost(self) -> float:
        """Return the sum of the squares of all residuals."""
        return float(self.node[:, -1, -1].sum() + (self.motion[:, :, -1] ** 2).sum())


class Prior(NamedTuple):
    """What is known before the first keyframe: independent whitened rows."""

    R_nb: FloatArray  # (3, 3)
    p_n_m: FloatArray  # (3,)
    white: FloatArray  # (9, 9), of pose and velocity
    aux_mean: FloatArray  # (D - 9,)
    aux_white: FloatArray  # (D - 9, D - 9 + b)
    constants_mean: FloatArray  # (b,)
    constants_white: FloatArray  # (b, b)

    @classmethod
    def of(cls, problem: SmoothingProblem, row: int = 0) -> "Prior":
        """Return it of the first keyframe, row ``row`` of a problem."""
        R_nb, P = pose_prior(problem, row)
        constants = problem.constants
        return cls(
            R_nb,
            problem.start.p_n_m[row],
            np.linalg.inv(np.linalg.cholesky(P)),
            *problem.motion.prior(constants.width),
            constants.mean,
            np.linalg.inv(np.linalg.cholesky(constants.covariance)),
        )


def linearise(
    problem: SmoothingProblem,
    rows: IntArray,
    at: States,
    before: States,
    links: Links,
    into: IntArray,
    phases: LinearPhases | None = None,
    prior: Prior | None = None,
) -> None:
    """Fill what enters with some keyframes.

    Parameters
    ----------
    problem : SmoothingProblem
    rows : ndarray of int, shape (j,)
        Keyframes of it, increasing.
    at : States
        Where those are linearised, (j,).
    before : States
        Where the keyframes before them are, (j,); of j - 1 if the first of the rows begins the
        chain: then the prior enters with it.
    links : Links
    into : ndarray of int, shape (j,)
        Places of the keyframes in it.
    phases : LinearPhases, optional
        Of these keyframes, if they are made already; else all A are linearised at zero.
    prior : Prior, optional
        Where the first of the rows begins the chain, if it is known already.

    Raises
    ------
    NoSolutionError
        If a residual is not finite.
    """
    D, j = at.width, len(before.R_nb)
    links.node[into] = 0.0
    if len(rows) > j:
        links.motion[into[0]] = 0.0
        prior = prior or Prior.of(problem, int(rows[0]))
        _add_prior(prior, at.at(slice(0, 1)), links.node, into[:1])
    if j:
        after = at if len(rows) == j else at.at(slice(1, None))
        motion = problem.motion.linearise(before, after, rows[-j:] - 1)
        led = into[-j:]
        links.motion[led, :, :D] = motion.before
        links.motion[led, :, D : 2 * D] = motion.after
        links.motion[led, :, 2 * D : -1] = motion.shared
        links.motion[led, :, -1] = -motion.value
    for measurement in problem.measurements:
        first, last = measurement.row.searchsorted((rows[0], rows[-1] + 1))
        which = np.arange(first, last)
        place = rows.searchsorted(measurement.row[first:last])
        if len(which) > 0 and len(rows) <= rows[-1] - rows[0]:  # gaps between the rows
            among = rows[place] == measurement.row[first:last]
            which, place = which[among], place[among]
        if len(which):
            linear = measurement.linearise(at if len(place) == len(rows) else at.at(place), which)
            shared = _beside_arcs(linear.shared, links.node, D)
            of_state = (linear.value, linear.state, shared)
            kernel.add_squares(links.node, into[place], *map(np.ascontiguousarray, of_state))
    if problem.phase is not None:
        phases = phases or LinearPhases(problem.phase.stacked(rows))
        add_phases(problem.phase, phases, rows, at, links.node, into)
    residuals = links.motion[into, :, -1]
    cost = links.node[into, -1, -1] + np.einsum("jm,jm->j", residuals, residuals)
    if not np.isfinite(cost).all():
        t_s = float(problem.t_s[rows[int(np.isfinite(cost).argmin())]])
        raise NoSolutionError(f"residuals are not finite at {t_s:.2f} s")


def _add_prior(prior: Prior, at: States, node: FloatArray, into: IntArray) -> None:
    """Add what is known before the first keyframe.

    Pose about its prior by the tangent of ``gtsam.Pose3`` (the position's rows in ``n``: its
    covariance is the same in all axes), velocity about zero, ``aux`` by the motion, and constants.
    """
    D, b = at.width, len(at.constants)
    value, state = np.zeros(D + b), np.zeros((D + b, D))
    shared = np.zeros((D + b, b))
    turn = log(prior.R_nb.T @ at.R_nb)[0]
    value[ROTATION], state[ROTATION, ROTATION] = turn, inverse_right_jacobian(turn)
    value[POSITION], state[POSITION, POSITION] = at.p_n_m[0] - prior.p_n_m, at.R_nb[0]
    value[VELOCITY], state[VELOCITY, VELOCITY] = at.v_n_mps[0], np.eye(3)
    value[:AUX], state[:AUX] = prior.white @ value[:AUX], prior.white @ state[:AUX]
    white = prior.aux_white
    value[AUX:D] = white @ np.concatenate([at.aux[0] - prior.aux_mean, at.constants])
    state[AUX:D, AUX:], shared[AUX:D] = white[:, : D - AUX], white[:, D - AUX :]
    if b:
        value[D:] = prior.constants_white @ (at.constants - prior.constants_mean)
        shared[D:] = prior.constants_white
    wide = _beside_arcs(shared[None], node, D)
    kernel.add_squares(node, into, value[None], state[None], wide)


def _beside_arcs(shared: FloatArray, node: FloatArray, D: int) -> FloatArray:
    """Return derivatives by the constants, (k, m, b), with columns of zeros for arcs."""
    k, m, b = shared.shape
    if node.shape[1] == D + b + 1:
        return shared
    wide = np.zeros((k, m, node.shape[1] - 1 - D))  # np.pad is slow for so little
    wide[:, :, :b] = shared
    return wide
