"""Samples of the inertial unit that are lost, and its tags go on: all later ones are early.

A logger that counts samples loses some, and no gap shows it. Of n_k samples of T lost between
keyframes k and k + 1, anywhere between them, tags are early by half of n_k T there on the mean, and
by n_k T after it. By score and information of n (``likelihood.span_constants``; one linear solve)
the likeliest are sought (``spans.lost_counts``), tags put back, and all is linearised anew. About
these many others are as likely: losses at two times against others between them. So tags are put
back by the mean of n, and attitudes and velocities are doubted by ``G cov(n) G'``, G their
derivative by n. Within an interval of samples x_k to x_k+1 a loss errs by ``T (x_k+1 - x_k)`` times
what it is off the middle, of variance 1/12: noise of density
``n_k T^2 |x_k+1 - x_k|^2 / (36 (t_k+1 - t_k))``.
"""

from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.frontend.calibration_request import CalibrationRequest
from fgnav.frontend.prepared import AttitudeDoubt
from fgnav.geometry.interpolation import interpolate
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import ROTATION, VELOCITY
from fgnav.identification.lasting.averaging import Rivals
from fgnav.identification.lasting.error import least_of_use
from fgnav.identification.likelihood.changed_samples import minimum_below
from fgnav.identification.likelihood.record_clock import with_tags
from fgnav.identification.likelihood.span_constants import Error, of_blocks, with_blocks
from fgnav.identification.spans.lost_counts import likeliest_counts, moments_of_counts
from fgnav.identification.tag_steps import TagStep
from fgnav.solve.chain import covariance_at
from fgnav.types.flight import Flight, Imu

LOST = "lost samples"
_BLOCKS = 120  # of a record, at most: a bound of cost
_APART = 4  # of these at first: a loss gains nearly as much at a neighbour
_ANY_S = 0.1  # 1-sigma in the linear problem: a few samples of any unit
_PASSES = 10  # a bound of cost; each linearised at the tags of the one before


class LostSamples(NamedTuple):
    """How many samples were lost before some times, on the mean, and what tags put back gain.

    ``lost``: (m + 1,), at ``t_s``. ``noise``: densities of force and rate between them, (m, 2).
    """

    lost: FloatArray
    interval_s: float
    t_s: FloatArray
    noise: FloatArray
    nats: float = 0.0
    odds: float = 0.0  # nats against so many at any time, which ``nats`` is less
    cost: float = np.inf
    R_nb: FloatArray = np.empty((0, 3, 3))  # attitudes of keyframes with tags put back
    doubt: AttitudeDoubt | None = None
    rivals: Rivals | None = None
    kind: str = LOST
    is_likely: bool = True  # else it is among what is possible
    requests: tuple[CalibrationRequest, ...] = ()

    @property
    def attitude_rad2(self) -> FloatArray:
        """What attitudes are doubted, (n, 3, 3)."""
        return np.zeros((1, 3, 3)) if self.doubt is None else self.doubt.covariance_rad2

    @property
    def steps(self) -> tuple[TagStep, ...]:
        """By what tags are early from which times on, in whole samples."""
        counts = np.diff(np.rint(self.lost))
        return tuple(
            TagStep(float(self.t_s[k]), -float(counts[k] * self.interval_s))
            for k in np.flatnonzero(counts)
        )

    @property
    def sentences(self) -> tuple[str, ...]:
        """What is to be said of them."""
        lost = ", ".join(f"{-one.late_s:.3f} s from {one.after_s:.1f} s on" for one in self.steps)
        return (
            f"The inertial unit's tags go on where samples are lost: they are early by {lost} "
            "(each beside those before); put back, and unsure about these times.",
        )

    def tags_put_back(self, t_s: FloatArray) -> FloatArray:
        """Return tags that are in time, (k,)."""
        early_s = self.interval_s * self.lost
        return np.asarray(t_s + np.interp(t_s, self.t_s - early_s, early_s))

    def tags_as_stated(self, t_s: FloatArray) -> FloatArray:
        """Return what tags that are in time, (k,), were."""
        return np.asarray(t_s - self.interval_s * np.interp(t_s, self.t_s, self.lost))

    def undone(self, flight: Flight) -> Flight:
        """Return a flight whose tags are put back."""
        imu = flight.imu
        if imu is None:
            return flight
        return replace(flight, imu=replace(imu, t_s=self.tags_put_back(imu.t_s)))

    def in_doubt(self, problem: SmoothingProblem) -> SmoothingProblem:
        """Return a problem that knows where samples were lost as well as that shows."""
        middle_s = (problem.t_s[1:] + problem.t_s[:-1]) / 2
        at = np.searchsorted(self.t_s, middle_s).clip(1, len(self.t_s) - 1) - 1
        return replace(problem, motion=problem.motion.with_added_noise(*self.noise[at].T))


class _Record(NamedTuple):
    """A problem, and between which of its keyframes samples may be lost."""

    problem: SmoothingProblem
    edges: IntArray  # (m + 1,)

    @classmethod
    def of(cls, problem: SmoothingProblem) -> "_Record":
        n = len(problem.t_s)
        return cls(problem, np.unique(np.linspace(0, n - 1, min(n, _BLOCKS + 1)).astype(np.int64)))

    @property
    def imu(self) -> Imu:
        return cast("Inertial | GyroFree", self.problem.motion).imu

    @property
    def interval_s(self) -> float:
        return float(np.median(np.diff(self.imu.t_s)))

    @property
    def most(self) -> FloatArray:
        """Samples of each interval, (m,), but one, which is left."""
        spans_s = np.diff(self.problem.t_s[self.edges])
        return np.asarray(np.rint(spans_s / self.interval_s) - 1)

    @property
    def none(self) -> IntArray:
        """No loss anywhere, (m,)."""
        return np.zeros(len(self.edges) - 1, dtype=np.int64)

    @property
    def late_s(self) -> FloatArray:
        """By what a loss in each interval makes tags early in each, (m, m)."""
        m = len(self.edges) - 1
        return self.interval_s * (np.triu(np.ones((m, m)), 1) + np.eye(m) / 2)

    def with_lost(self, counts: FloatArray | IntArray) -> LostSamples:
        """Return so many of each interval, (m,), as lost."""
        t_s, imu, m = self.problem.t_s[self.edges], self.imu, len(counts)
        upto = np.append(0.0, np.cumsum(counts))
        lost = LostSamples(upto, self.interval_s, t_s, np.zeros((m, 2)))
        tags_s, error = lost.tags_put_back(imu.t_s), counts * self.interval_s**2 / np.diff(t_s) / 36
        for i, x in enumerate((imu.f_b_mps2, imu.w_b_radps)):
            if x is not None:
                change = np.diff(interpolate(t_s, tags_s, x), axis=0)
                lost.noise[:, i] = error * (change**2).sum(axis=1)
        return lost

    def put_back(self, lost: LostSamples) -> SmoothingProblem:
        """Return the problem with tags put back."""
        return with_tags(self.problem, lost.tags_put_back(self.imu.t_s))

    def information(
        self, at: SmoothingProblem, solution: Solution
    ) -> tuple[FloatArray, FloatArray] | None:
        """Return score, (m,), and information, (m, m), of losses beside those at a minimum."""
        blocks = of_blocks(at, solution.states, _TAGS, self.edges)
        if blocks is None:
            return None
        A = self.late_s / _ANY_S
        return A @ blocks[0][:, 0], A @ blocks[1][:, :, 0, 0] @ A.T


def lost_samples(problem: SmoothingProblem, stated: Solution) -> LostSamples | None:
    """Return the likeliest losses; None where none gains more than it costs.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum.
    """
    if not isinstance(problem.motion, GyroFree | Inertial) or len(problem.t_s) < 3:
        return None
    record = _Record.of(problem)
    few = record._replace(edges=np.append(record.edges[:-1:_APART], record.edges[-1]))
    information = few.information(problem, stated)
    if information is None or not likeliest_counts(information, few.none, few.most)[0].any():
        return None
    return _sought(record, problem, stated, record.none)


def prolonged(lost: LostSamples, problem: SmoothingProblem) -> LostSamples:
    """Return losses after the last of their times as well, which the record as it was ended at.

    Parameters
    ----------
    lost : LostSamples
    problem : SmoothingProblem
        Of the flight with tags put back.
    """
    if problem.t_s[-1] <= lost.t_s[-1] or not isinstance(problem.motion, GyroFree | Inertial):
        return lost
    record = _Record.of(with_tags(problem, lost.tags_as_stated(problem.motion.imu.t_s)))
    before = np.interp(problem.t_s[record.edges], lost.t_s, lost.lost)
    counts = np.diff(np.rint(before)).astype(np.int64)
    at = record.put_back(record.with_lost(counts))
    solution = minimum_below(at, np.inf)
    longer = None if solution is None else _sought(record, at, solution, counts)
    if longer is None:
        return lost
    return longer._replace(nats=lost.nats, odds=lost.odds, rivals=lost.rivals)


def _sought(
    record: _Record, at: SmoothingProblem, solution: Solution, counts: IntArray
) -> LostSamples | None:
    """Return the likeliest losses, and what attitudes are doubted for all others.

    From the minimum of a problem with some put back on; what they gain is against it.
    """
    begin, least = solution.cost, -np.inf if counts.any() else 0.0
    likeliest = record.with_lost(counts)._replace(nats=least), solution, counts
    for _ in range(_PASSES):
        information = record.information(at, solution)
        if information is None:
            break
        changed, odds = likeliest_counts(information, counts, record.most)
        if (changed == counts).all():
            break
        lost, counts = record.with_lost(changed), changed
        at = record.put_back(lost)
        # Whole numbers are found a few at a time, and doubt of where they are leaves less.
        again = minimum_below(at, least_of_use(record.problem, solution.cost, _PASSES))
        if again is None:
            break
        solution, nats = again, (begin - again.cost) / 2 - odds
        if nats <= likeliest[0].nats:
            break
        likeliest = lost._replace(nats=nats, odds=odds), solution, changed
    return _with_doubt(record, *likeliest) if likeliest[2].any() else None


def _with_doubt(
    record: _Record, likeliest: LostSamples, solution: Solution, counts: IntArray
) -> LostSamples | None:
    """Return the mean of all losses, and what attitudes are doubted for them."""
    at = likeliest.in_doubt(record.put_back(likeliest))
    doubted = minimum_below(at, np.inf, solution.states)
    information = None if doubted is None else record.information(at, doubted)
    if doubted is None or information is None:
        return None
    rng = np.random.default_rng(0)  # the same losses for the same flight
    mean, covariance = moments_of_counts(information, counts, record.most, rng)
    lost = record.with_lost(mean)
    at = lost.in_doubt(record.put_back(lost))
    ended = minimum_below(at, np.inf, doubted.states)
    tags_free = with_blocks(at, _TAGS, record.edges)
    if ended is None or tags_free is None:
        return None
    begin = np.append(ended.states.constants, np.zeros(len(counts)))
    try:
        free = covariance_at(tags_free, ended.states._replace(constants=begin))
    except NoSolutionError:
        return None
    of_tags = slice(at.constants.width, None)
    X, C = free.constant_cross[:, :, of_tags], free.constant_covariance[0, of_tags, of_tags]
    G = np.linalg.solve(C, X.swapaxes(1, 2)).swapaxes(1, 2) @ record.late_s.T
    P_R, P_v = (G[:, of] @ covariance @ G[:, of].swapaxes(1, 2) for of in (ROTATION, VELOCITY))
    return lost._replace(
        nats=likeliest.nats,
        odds=likeliest.odds,
        cost=ended.cost,
        R_nb=ended.states.R_nb,
        doubt=AttitudeDoubt(record.problem.t_s, P_R, P_v),
    )


def _later(by: FloatArray, imu: Imu) -> Imu:
    return replace(imu, t_s=imu.t_s + by[0])


_TAGS = Error("inertial unit", "tags", _ANY_S, _later, size=1)
