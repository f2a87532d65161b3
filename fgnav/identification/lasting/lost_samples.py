"""Samples of the inertial unit that are lost, and its tags go on: all later ones are early.

A logger that counts samples loses some, and no gap shows it. Of n_k samples of T lost after
keyframe k, tags after it are early by n_k T. With score s and information N of tags after each
keyframe that are later (``likelihood.span_constants``; one linear solve), the losses n are

    max  T s'n - T^2 n'N n / 2 - ln(m^S prod(n_k!) / S!),   S = sum(n), n whole, none negative

by single losses, more, fewer or elsewhere, as long as that gains; then tags are put back and all is
linearised anew. The last term is the probability of S losses among m keyframes, in any order. Where
a loss may as well be at another keyframe b than at a, of probability p, what the samples x would
err by is noise between them of density ``p T^2 |x_b - x_a|^2 / (t_b - t_a)``.
"""

from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np
from scipy.special import gammaln, logsumexp

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.frontend.calibration_request import CalibrationRequest
from fgnav.frontend.prepared import AttitudeDoubt
from fgnav.geometry.interpolation import interpolate
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import ROTATION
from fgnav.identification.lasting.error import least_of_use
from fgnav.identification.lasting.rivals import Rivals
from fgnav.identification.likelihood.changed_samples import minimum_below
from fgnav.identification.likelihood.record_clock import with_tags
from fgnav.identification.likelihood.span_constants import Error, of_blocks, with_blocks
from fgnav.identification.tag_steps import TagStep
from fgnav.solve.chain import covariance_at
from fgnav.types.flight import Flight, Imu

LOST = "lost samples"
_BLOCKS = 120  # of a record, at most: a bound of cost
_APART = 4  # of these at first: a loss gains nearly as much at a neighbour
_ANY_S = 0.1  # 1-sigma in the linear problem: a few samples of any unit
_MOST = 1000  # steps, and _PASSES: bounds of cost
_DRAWS = 3000
_PASSES = 10  # each linearised at the tags of the one before


class LostSamples(NamedTuple):
    """How many samples were lost up to each of some times, and what tags put back gain.

    ``lost``: (m + 1,), at ``t_s``; ``noise``: densities of force and rate between these, (m, 2).
    """

    lost: FloatArray
    interval_s: float
    t_s: FloatArray
    noise: FloatArray
    nats: float = 0.0
    odds: float = 0.0  # nats against so many at any time, which ``nats`` is less
    cost: float = 0.0
    R_nb: FloatArray = np.empty((0, 3, 3))  # attitudes of keyframes with tags put back
    doubt: AttitudeDoubt | None = None
    rivals: Rivals | None = None
    kind: str = LOST
    is_likely: bool = True  # else it is none
    requests: tuple[CalibrationRequest, ...] = ()

    @property
    def steps(self):
        counts = np.diff(np.rint(self.lost))
        return tuple(TagStep(float(self.t_s[k]), -float(counts[k] * self.interval_s)) for k in np.flatnonzero(counts))

    @property
    def sentences(self) -> tuple[str, ...]:
        """What is to be said of them."""
        lost = ", ".join(f"{-one.late_s:.3f} s from {one.after_s:.1f} s on" for one in self.steps)
        return (
            f"The inertial unit's tags go on where samples are lost: they are early by {lost} "
            "(each beside those before); put back, and unsure about these times.",
        )

    def _tags(self, t_s):
        early_s = self.t_s - self.interval_s * self.lost
        return t_s + self.interval_s * np.interp(t_s, early_s, self.lost)

    def undone(self, flight: Flight) -> Flight:
        """Return a flight whose tags have gaps where samples were lost."""
        imu = flight.imu
        return flight if imu is None else replace(flight, imu=replace(imu, t_s=self._tags(imu.t_s)))

    def put_back(self, problem):
        return with_tags(problem, self._tags(problem.motion.imu.t_s))

    def in_doubt(self, problem: SmoothingProblem) -> SmoothingProblem:
        """Return a problem that knows where samples were lost as well as that shows."""
        middle_s = (problem.t_s[1:] + problem.t_s[:-1]) / 2
        at = np.searchsorted(self.t_s, middle_s).clip(1, len(self.t_s) - 1) - 1
        return replace(problem, motion=problem.motion.with_added_noise(*self.noise[at].T))


def lost_samples(problem: SmoothingProblem, stated: Solution) -> LostSamples | None:
    """Return the likeliest losses; None where none gains more than it costs.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum.
    """
    motion, n = problem.motion, len(problem.t_s)
    if not isinstance(motion, GyroFree | Inertial) or n < 3:
        return None
    interval_s = float(np.median(np.diff(motion.imu.t_s)))
    edges = np.unique(np.linspace(0, n - 1, min(n, _BLOCKS + 1)).astype(np.int64))
    few = np.append(edges[:-1:_APART], edges[-1])
    at_first = _likeliest((problem, stated, few), _none(few), interval_s)
    if at_first is None or not at_first[0].any():
        return None
    return _sought(problem, stated, edges, interval_s)


def _sought(
    problem: SmoothingProblem, stated: Solution, edges: IntArray, interval_s: float
) -> LostSamples | None:
    """Return the likeliest losses between some keyframes, and what attitudes are doubted."""
    at, solution, counts = problem, stated, _none(edges)
    likeliest: tuple[float, float, Solution, IntArray] | None = None
    for _ in range(_PASSES):
        losses = _likeliest((at, solution, edges), counts, interval_s)
        if losses is None:
            break
        changed, spread = losses
        if (changed == counts).all():
            break
        at = _lost(problem, edges, changed, interval_s).put_back(problem)
        # Whole numbers are found a few at a time, and doubt of where they are leaves less.
        again = minimum_below(at, least_of_use(problem, solution.cost, _PASSES))
        if again is None:
            break
        solution, odds = again, _odds(changed, spread)
        nats = (stated.cost - solution.cost) / 2 - odds
        if likeliest is not None and nats <= likeliest[0]:
            break
        likeliest, counts = (nats, odds, solution, changed), changed
    if likeliest is None:
        return None
    return _in_doubt((problem, edges, interval_s), likeliest)


def _in_doubt(subject, likeliest):
    problem, edges, interval_s = subject
    nats, odds, solution, counts = likeliest
    lost, doubt = _lost(problem, edges, counts, interval_s), None
    at = lost.in_doubt(lost.put_back(problem))
    solution = minimum_below(at, np.inf, solution.states)
    if solution is None:
        return None
    information = _information((at, solution, edges), interval_s)
    if information is None:
        return None
    mean, covariance = _moments(*information, counts, _most(problem.t_s[edges], interval_s))
    lost = _lost(problem, edges, mean, interval_s)
    at = lost.in_doubt(lost.put_back(problem))
    solution = minimum_below(at, np.inf, solution.states)
    if solution is None:
        return None
    extended = with_blocks(at, _error(), edges)
    begin = solution.states
    begin = begin._replace(constants=np.append(begin.constants, np.zeros(len(counts))))
    free = covariance_at(extended, begin)
    first = problem.constants.width
    X = free.constant_cross[:, ROTATION, first:]
    G = np.linalg.solve(free.constant_covariance[0, first:, first:], X.swapaxes(1, 2)).swapaxes(1, 2)
    A = interval_s * _ramps(len(counts))
    C = A.T @ covariance @ A
    doubt = AttitudeDoubt(problem.t_s, G @ C @ G.swapaxes(1, 2))
    return lost._replace(nats=nats, odds=odds, cost=solution.cost, R_nb=solution.states.R_nb, doubt=doubt)


def _lost(problem, edges, counts, interval_s):
    t_s = problem.t_s[edges]
    return LostSamples(np.append(0.0, np.cumsum(counts)), interval_s, t_s, _noise((problem, edges), counts, interval_s))


def _ramps(m):
    return np.triu(np.ones((m, m)), 1) + np.eye(m) / 2


def _error():
    return Error("inertial unit", "tags", _ANY_S, _later, size=1)


def _most(t_s, interval_s):
    return np.maximum(np.floor(np.diff(t_s) / interval_s - 0.5), 0).astype(np.int64)


def _moments(s, N, before, most):
    rng, m = np.random.default_rng(0), len(s)
    counts, own = before.copy(), N.diagonal()
    g = s.copy()
    draws, weights = np.empty((_DRAWS, m)), np.empty(_DRAWS)
    for i in range(_DRAWS):
        draws[i] = counts
        total = counts.sum()
        at = np.flatnonzero(counts)
        full = counts >= most
        more = g - own / 2 - np.log(m * (counts + 1) / (total + 1))
        more[full] = -np.inf
        fewer = -g[at] - own[at] / 2 + np.log(m * counts[at] / max(total, 1))
        move = (g - own / 2 - np.log(counts + 1)) + (np.log(counts[at]) - g[at] - own[at] / 2)[:, None] + N[at]
        move[:, full] = -np.inf
        move[np.arange(len(at)), at] = -np.inf
        every = np.concatenate([more, fewer, move.ravel()]) / 2
        top = every.max()
        rates = np.exp(every - top).cumsum()
        weights[i] = -top - np.log(rates[-1])
        k = int(np.searchsorted(rates, rng.random() * rates[-1]))
        if k < m:
            counts[k] += 1
            g = g - N[k]
        elif k < m + len(at):
            counts[at[k - m]] -= 1
            g = g + N[at[k - m]]
        else:
            a, b = divmod(k - m - len(at), m)
            counts[at[a]] -= 1
            counts[b] += 1
            g = g + N[at[a]] - N[b]
    share = np.exp(weights - weights.max())
    share /= share.sum()
    mean = share @ draws
    off = draws - mean
    return mean, (share[:, None] * off).T @ off


def _odds(counts: IntArray, spread: FloatArray) -> float:
    """Return the nats against so many losses in any order, each at any place that is as likely."""
    total, at = counts.sum(), counts > 0
    orders = gammaln(total + 1) - gammaln(counts + 1).sum()
    places = counts[at] @ logsumexp(spread[at], axis=1)
    return float(total * np.log(len(counts)) - orders - places)


def _none(edges: IntArray) -> IntArray:
    return np.zeros(len(edges) - 1, dtype=np.int64)


def _likeliest(
    subject: tuple[SmoothingProblem, Solution, IntArray], before: IntArray, interval_s: float
) -> tuple[IntArray, FloatArray] | None:
    """Return losses by keyframes, (m,), and what one of a keyframe gains at another, (m, m).

    ``before``: losses that have been put back.
    """
    information = _information(subject, interval_s)
    if information is None:
        return None
    s, N = information
    problem, _, edges = subject
    most = _most(problem.t_s[edges], interval_s)
    counts, own = before.copy(), N.diagonal()
    for _ in range(_MOST):
        g, total = s - N @ (counts - before), counts.sum()
        more = g - own / 2 - np.log(len(counts) * (counts + 1) / (total + 1))
        with np.errstate(divide="ignore"):
            fewer = -g - own / 2 + np.log(len(counts) * counts / max(total, 1))
        more[0] = -np.inf  # a clock that is off all along
        more[counts >= most] = -np.inf
        elsewhere = _elsewhere(g, N, counts)
        elsewhere[:, counts >= most] = -np.inf
        np.fill_diagonal(elsewhere, 0.0)
        best = (more.max(), fewer.max(), elsewhere.max())
        if max(best) <= 0.0:
            break
        if best[2] == max(best):
            a, b = np.unravel_index(int(elsewhere.argmax()), elsewhere.shape)
            counts[a] -= 1
            counts[b] += 1
        elif best[0] == max(best):
            counts[more.argmax()] += 1
        else:
            counts[fewer.argmax()] -= 1
    return counts, _elsewhere(s - N @ (counts - before), N, counts)


def _elsewhere(g: FloatArray, N: FloatArray, counts: IntArray) -> FloatArray:
    """Return what a loss at a keyframe a gains at another, b, (m, m)."""
    own = N.diagonal()
    gain = g - g[:, None] - (own + own[:, None]) / 2 + N
    gain += np.log(np.maximum(counts, 1))[:, None] - np.log(counts + 1)
    np.fill_diagonal(gain, 0.0)
    gain[:, 0] = -np.inf
    return np.where(counts[:, None] > 0, gain, -np.inf)


def _information(subject, interval_s):
    problem, solution, edges = subject
    blocks = of_blocks(problem, solution.states, _error(), edges)
    if blocks is None:
        return None
    A = interval_s / _ANY_S * _ramps(len(edges) - 1)
    return A @ blocks[0][:, 0], A @ blocks[1][:, :, 0, 0] @ A.T


def _noise(subject, counts, interval_s):
    """Return densities of force and rate by which losses may err, (m, 2)."""
    problem, edges = subject
    t_s, motion = problem.t_s[edges], problem.motion
    noise = np.zeros((len(t_s) - 1, 2))
    imu = cast("Inertial | GyroFree", motion).imu
    for i, x in enumerate((imu.f_b_mps2, imu.w_b_radps)):
        if x is not None:
            squares = (np.diff(interpolate(t_s, imu.t_s, x), axis=0) ** 2).sum(axis=1)
            noise[:, i] = counts * interval_s**2 * squares / (36 * np.diff(t_s))
    return noise


def _later(by: FloatArray, imu: Imu) -> Imu:
    return replace(imu, t_s=imu.t_s + by[0])
