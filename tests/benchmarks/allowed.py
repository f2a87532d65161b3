"""How much better a smoother may be than a filter: errors drawn from the model that both have."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, NoSolutionError
from fgnav.graph.factors.antenna_phase import AntennaPhase
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.states import States
from fgnav.solve.chain import back_kernel
from fgnav.solve.chain.arcs import Border
from fgnav.solve.chain.batch import solve_batch
from fgnav.solve.chain.linear import Links, linearise

_POSE = 6  # first of a state's dimensions: rotation and position
_ROUNDING = 1e-12  # of information in units of its own; noise of what is measured is above


def allowed_peaks(
    problem: SmoothingProblem, during: BoolArray, draws: int, rng: np.random.Generator
) -> FloatArray:
    """Return mean peaks of errors at some keyframes, (2, 2): of the smoother, then the filter.

    Of rotation, rad, and position, m. Measurements and motion err as their own noise says, linear
    at the batch's solution: whitened rows err by unit noise e, and measurements of information
    ``J'J`` by ``J'e``, which has that very covariance. The error that all positions share is in
    neither: flights whose messages are right have none.

    Parameters
    ----------
    problem : SmoothingProblem
    during : ndarray of bool, shape (n,)
        Keyframes to look at.
    draws : int
    rng : Generator
    """
    states = solve_batch(problem).states
    links = _linearised(problem, states)
    root = _roots(links.node[:, :-1, :-1])
    rows = np.flatnonzero(during)
    peaks = []
    for _ in range(draws):
        errors = _errors(links, root, _drawn(problem.phase, rng), rows, rng)
        sizes = np.linalg.norm(errors.reshape(2, len(rows), 2, 3), axis=3)
        peaks.append(sizes.max(axis=1))
    return np.asarray(np.mean(peaks, axis=0))


class _Eliminated(NamedTuple):
    """A chain from its first keyframe to its last; see ``kernel.eliminate``."""

    border: Border
    forward: FloatArray  # (n, W, W)
    gain: FloatArray  # (n - 1, D, W)


def _drawn(phase: AntennaPhase | None, rng: np.random.Generator) -> AntennaPhase | None:
    """Return phases where what leads from arcs to arcs errs by unit noise."""
    if phase is None:
        return None
    blocks = [one._replace(right=rng.standard_normal(len(one.right))) for one in phase.blocks]
    return replace(phase, blocks=blocks)


def _linearised(problem: SmoothingProblem, states: States) -> Links:
    """Return all of a problem, linear at some states."""
    n, beside = len(problem.t_s), Border(problem.phase).width
    links = Links.empty(n, problem.width, problem.constants.width, beside)
    every, before = np.arange(n), states.at(slice(0, n - 1))
    linearise(problem, every, states, before, links, every)
    return links


def _eliminated(links: Links, phase: AntennaPhase | None) -> _Eliminated:
    n, D, W = len(links.node), links.motion.shape[1], links.node.shape[1]
    forward, gain = np.zeros_like(links.node), np.empty((n - 1, D, W))
    root, border = np.empty((n, D, D)), Border(phase)
    for row in range(n):
        border.append(row)
    for by_rows in (False, True):
        forward[0] = links.node[0]
        border.begin(forward[0])
        parts = (links.motion, links.node, forward, root, gain)
        failed = border.eliminate(parts, 0, by_rows=by_rows)
        if failed < 0:
            return _Eliminated(border, forward, gain)
    raise NoSolutionError(f"drawn errors: keyframe {failed} is open")


def _roots(information: FloatArray) -> FloatArray:
    """Return square roots, (n, k, k), of information, of which upper halves are filled.

    What is rounding of it is nothing.
    """
    whole = np.triu(information) + np.triu(information, 1).swapaxes(1, 2)
    size = np.sqrt(np.einsum("nii->ni", whole)).clip(np.finfo(float).tiny)
    value, vectors = np.linalg.eigh(whole / size[:, :, None] / size[:, None, :])
    value[value < _ROUNDING] = 0.0
    return np.asarray(size[:, :, None] * vectors * np.sqrt(value)[:, None])


def _errors(
    links: Links,
    root: FloatArray,
    phase: AntennaPhase | None,
    rows: IntArray,
    rng: np.random.Generator,
) -> FloatArray:
    """Return errors of one draw, (2, m, 6): of states given all there is, and given the past."""
    e = rng.standard_normal(root.shape[:2])
    links.node[:, :-1, -1] = np.einsum("nij,nj->ni", root, e)
    links.node[:, -1, -1] = (e**2).sum(axis=1)
    links.motion[1:, :, -1] = rng.standard_normal((len(links.motion) - 1, links.motion.shape[1]))
    chain = _eliminated(links, phase)
    smoothed = np.empty((len(root), links.motion.shape[1]))
    chain.border.substitute(chain.gain, _newest(chain.forward[-1]), smoothed)
    filtered = np.stack([_newest(chain.forward[k]) for k in rows])
    return np.stack([smoothed[rows, :_POSE], filtered[:, :_POSE]])


def _newest(forward: FloatArray) -> FloatArray:
    """Return state, constants and arcs, (D + b + a,), by the information up to a keyframe."""
    step = np.empty(len(forward) - 1)
    if not np.isfinite(back_kernel.newest(forward, np.empty((len(step), len(step))), step)):
        raise NoSolutionError("drawn errors: a state is open")
    return step
