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
from fgnav.identification.lasting.error import least_of_use
from fgnav.identification.lasting.rivals import Rivals
from fgnav.identification.likelihood.changed_samples import minimum_below
from fgnav.identification.likelihood.span_constants import Error, of_blocks
from fgnav.identification.tag_steps import TagStep
from fgnav.solve.chain import solve_batch
from fgnav.types.flight import Flight, Imu

LOST = "lost samples"
_BLOCKS = 120  # of a record, at most: a bound of cost
_APART = 4  # of these at first: a loss gains nearly as much at a neighbour
_ANY_S = 0.1  # 1-sigma in the linear problem: a few samples of any unit
_MOST = 60  # losses, and _PASSES: bounds of cost
_PASSES = 10  # each linearised at the tags of the one before


class LostSamples(NamedTuple):
    """Where samples were lost, what tags put back gain, and the noise of not knowing where.

    ``noise``: densities of force and rate by intervals of ``t_s``, (m, 2).
    """

    steps: tuple[TagStep, ...]
    nats: float
    odds: float  # nats against so many at any time, which ``nats`` is less
    cost: float
    t_s: FloatArray
    noise: FloatArray
    R_nb: FloatArray = np.empty((0, 3, 3))  # attitudes of keyframes with tags put back
    rivals: Rivals | None = None
    kind: str = LOST
    is_likely: bool = True  # else it is none
    requests: tuple[CalibrationRequest, ...] = ()
    doubt: AttitudeDoubt | None = None

    @property
    def sentences(self) -> tuple[str, ...]:
        """What is to be said of them."""
        lost = ", ".join(f"{-one.late_s:.3f} s from {one.after_s:.1f} s on" for one in self.steps)
        return (
            f"The inertial unit's tags go on where samples are lost: they are early by {lost} "
            "(each beside those before); put back, and unsure about these times.",
        )

    def undone(self, flight: Flight) -> Flight:
        """Return a flight whose tags have gaps where samples were lost."""
        for one in self.steps:
            flight = one.undone(flight)
        return flight

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
    """Return the likeliest losses after some keyframes."""
    motion = cast("Inertial | GyroFree", problem.motion)
    at, solution, counts = problem, stated, _none(edges)
    likeliest: LostSamples | None = None
    for _ in range(_PASSES):
        losses = _likeliest((at, solution, edges), counts, interval_s)
        if losses is None:
            break
        changed, spread = losses
        if (changed == counts).all() or changed.sum() > _MOST:
            break
        steps = _steps(problem.t_s[edges], changed, interval_s)
        imu = motion.imu
        for one in steps:
            imu = one.put_back(imu)
        at = replace(problem, motion=cast("Motion", replace(motion, imu=imu)))
        # Whole numbers are found a few at a time, and doubt of where they are leaves less.
        again = minimum_below(at, least_of_use(problem, solution.cost, _PASSES))
        if again is None:
            break
        solution, odds = again, _odds(changed, spread)
        nats = (stated.cost - solution.cost) / 2 - odds
        if likeliest is not None and nats <= likeliest.nats:
            break
        noise = _noise((at, edges), changed, spread, interval_s)
        t_s, R_nb = problem.t_s[edges], solution.states.R_nb
        likeliest = LostSamples(steps, nats, odds, solution.cost, t_s, noise, R_nb)
        counts = changed
    if likeliest is None:
        return None
    try:  # what is left, in doubt of where they were lost
        doubted = solve_batch(likeliest.in_doubt(at))
    except NoSolutionError:
        return None
    return likeliest._replace(cost=doubted.cost)


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
    problem, solution, edges = subject
    error = Error("inertial unit", "tags", _ANY_S, _later, size=1)
    blocks = of_blocks(problem, solution.states, error, edges)
    if blocks is None:
        return None
    unit = interval_s / _ANY_S
    # A step from an interval on is in all later ones.
    s = unit * blocks[0][::-1, 0].cumsum()[::-1]
    N = unit**2 * blocks[1][::-1, ::-1, 0, 0].cumsum(axis=0).cumsum(axis=1)[::-1, ::-1]
    counts, own = before.copy(), N.diagonal()
    for _ in range(2 * _MOST):
        g, total = s - N @ (counts - before), counts.sum()
        more = g - own / 2 - np.log(len(counts) * (counts + 1) / (total + 1))
        with np.errstate(divide="ignore"):
            fewer = -g - own / 2 + np.log(len(counts) * counts / max(total, 1))
        more[0] = -np.inf  # a clock that is off all along
        elsewhere = _elsewhere(g, N, counts)
        best = (more.max(), fewer.max(), elsewhere.max())
        if max(best) <= 0.0 or counts.sum() > _MOST:
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


def _noise(
    subject: tuple[SmoothingProblem, IntArray],
    counts: IntArray,
    spread: FloatArray,
    interval_s: float,
) -> FloatArray:
    """Return densities of force and rate by which losses may err, (m, 2)."""
    problem, edges = subject
    t_s, motion = problem.t_s[edges], problem.motion
    noise = np.zeros((len(t_s) - 1, 2))
    imu = cast("Inertial | GyroFree", motion).imu
    samples = (imu.f_b_mps2, imu.w_b_radps)
    for a in np.flatnonzero(counts):
        share = np.exp(spread[a] - logsumexp(spread[a])) * counts[a]
        for i, x in enumerate(samples):
            if x is None:
                continue
            at = interpolate(t_s, imu.t_s, x)
            for b in np.flatnonzero(share > 1e-3 * counts[a]):
                first, last = min(a, b), max(a, b) + (a == b)  # within its own interval, too
                error = interval_s**2 * float(((at[last] - at[first]) ** 2).sum()) / 3
                noise[first:last, i] += share[b] * error / (t_s[last] - t_s[first])
    return noise


def _steps(t_s: FloatArray, counts: IntArray, interval_s: float) -> tuple[TagStep, ...]:
    return tuple(
        TagStep(float(t_s[k]), -float(counts[k] * interval_s)) for k in np.flatnonzero(counts)
    )


def _later(by: FloatArray, imu: Imu) -> Imu:
    return replace(imu, t_s=imu.t_s + by[0])
