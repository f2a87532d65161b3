"""The prior of rates by the evidence of the whole chain, where attitudes alone do not determine it.

A flight with neither an array nor a gyroscope has attitudes from vectors whose errors last for
seconds and are not known. Positions, velocities and specific forces tell it by the marginal
likelihood of all of them; rates are as likely beforehand as those of an array are
(``process.posterior``). A prior that is nearly as likely may have turned the body otherwise: by
their shares of the posterior all of them doubt the attitudes (docs/evidence/limitations.md).
"""

from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np

from fgnav.assembly.motion import prior_note
from fgnav.assembly.prepared import PreparedFlight
from fgnav.checks import FloatArray, NoSolutionError
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.solution import Solution
from fgnav.noise.decimation import decimated
from fgnav.process import matern
from fgnav.process.hyperparameters import LONGEST_S, RatePrior
from fgnav.process.posterior import hyperparameters, log_prior
from fgnav.solve.gauss_newton import gauss_newton

_BEGIN = (-1, 2)  # exponents of where the search begins: 0.3 s, 10 deg/s
_STEP = 10**0.5  # between neighbours: log-likelihoods a nat apart are a third of that apart
_LEAST, _LONGEST = -2, 2  # exponents: of lengths 0.1 to 10 s, of rates 0.1 deg/s and up
_ITERATIONS = 40  # of one candidate; those near the likeliest need ten
_PLAUSIBLE = 7.0  # below the highest log posterior: a thousandth as probable
_MOST = 2000  # keyframes: a minute for all candidates; longer flights keep that of attitudes


class _Candidate(NamedTuple):
    """A rate prior, by the problem that has it, and where that has its minimum."""

    problem: Problem
    log_posterior: float
    solution: Solution | None  # none where a state is open


def identified_by_evidence(prepared: PreparedFlight) -> PreparedFlight:
    """Return a flight with the rate prior under which its measurements are likeliest.

    Length and variance, the same about all axes, climb from neighbour to neighbour on a grid of
    factors of root ten; where a search starts matters as much, so each candidate is solved: on a
    run of keyframes, then those that are plausible there on all of them. What attitudes have
    identified is a candidate, too.

    Parameters
    ----------
    prepared : PreparedFlight
        Without a gyroscope.
    """
    problem = prepared.problem
    motion = problem.motion
    if not isinstance(motion, GyroFree) or len(problem.t_s) > _MOST:
        return prepared
    nominal = _at_its_minimum(problem, motion)
    run, keyframes = decimated(prepared)
    candidates = _climbed(run)
    highest = max(candidate.log_posterior for candidate in candidates.values())
    plausible = [
        node
        for node, candidate in candidates.items()
        if candidate.log_posterior > highest - _PLAUSIBLE
    ]
    if len(keyframes) < len(problem.t_s):
        candidates = {node: _candidate(problem, node) for node in plausible}
    here = max(plausible, key=lambda node: candidates[node].log_posterior)
    best = max(nominal, candidates[here], key=lambda candidate: candidate.log_posterior)
    added = _spread(best, (nominal, *candidates.values()))
    if best is nominal:
        return replace(prepared, attitude_inflation_rad2=added)
    note = prior_note(_prior(here))
    notes = tuple(text for text in prepared.notes if getattr(text, "code", "") != note.code)
    return replace(
        prepared,
        problem=best.problem,
        attitude_inflation_rad2=added,
        notes=(*notes, note),
    )


def _climbed(problem: Problem) -> dict[tuple[int, int], _Candidate]:
    """Return the places of the grid that a climb to the likeliest has met."""
    candidates = {_BEGIN: _candidate(problem, _BEGIN)}
    here = _BEGIN
    while True:
        around = [(here[0] + a, here[1] + b) for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        for node in around:
            if node not in candidates and min(node) >= _LEAST and node[0] <= _LONGEST:
                candidates[node] = _candidate(problem, node)
        near = [here, *(node for node in around if node in candidates)]
        likeliest = max(near, key=lambda node: candidates[node].log_posterior)
        if likeliest == here:
            return candidates
        here = likeliest


def _spread(best: _Candidate, candidates: tuple[_Candidate, ...]) -> FloatArray | None:
    """Return second moments of the candidates' attitudes about those of the likeliest."""
    if best.solution is None:
        return None
    covariance, total = np.zeros((len(best.problem.t_s), 3, 3)), 0.0
    for candidate in candidates:
        if candidate.solution is None or not candidate.solution.converged:
            continue
        share = np.exp(candidate.log_posterior - best.log_posterior)
        turn_b = best.solution.states.steps_to(candidate.solution.states)[:, :3]
        covariance += share * turn_b[:, :, None] * turn_b[:, None, :]
        total += share
    return np.asarray(covariance / max(total, 1.0))


def _prior(node: tuple[int, int]) -> RatePrior:
    """Return the prior at a node of the grid."""
    sigma = np.radians(_STEP ** node[1])
    return RatePrior(
        length_s=_STEP ** node[0], variance_rad2ps2=np.full(3, sigma**2), evidence=np.nan
    )


def _candidate(problem: Problem, node: tuple[int, int]) -> _Candidate:
    """Return a node of the grid, of a problem without a gyroscope."""
    motion = cast("GyroFree", problem.motion)
    prior, n = _prior(node), len(problem.t_s) - 1
    changed = replace(
        motion,
        poles_per_s=np.tile(prior.poles_per_s, (n, 1, 1)),
        variance_rad2ps2=np.tile(prior.variance_rad2ps2, (n, 1)),
    )
    return _at_its_minimum(replace(problem, motion=changed), changed)


def _at_its_minimum(problem: Problem, motion: GyroFree) -> _Candidate:
    """Return the log posterior of a rate prior where its search ends."""
    try:
        solution, log_evidence = gauss_newton(problem, most=_ITERATIONS)
    except NoSolutionError:
        return _Candidate(problem, -np.inf, None)
    length_s, pole_ratio, damping_ratio = matern.shape(np.median(motion.poles_per_s, axis=0))
    prior = RatePrior(
        length_s=length_s,
        pole_ratio=pole_ratio,
        damping_ratio=damping_ratio,
        variance_rad2ps2=np.median(motion.variance_rad2ps2, axis=0),
        evidence=log_evidence,
    )
    record_s = min(float(problem.t_s[-1] - problem.t_s[0]), LONGEST_S)
    beforehand = log_prior(hyperparameters(prior), record_s)[0]
    return _Candidate(problem, prior.evidence + beforehand, solution)
