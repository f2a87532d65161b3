"""The prior of rates by the evidence of the whole chain, where attitudes alone do not determine it.

A flight with neither an array nor a gyroscope has attitudes from vectors whose errors last for
seconds and are not known. What explains positions, velocities and specific forces best is the
marginal likelihood of all of them (docs/model.md).
"""

from dataclasses import replace

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.frontend.motion import prior_note
from fgnav.frontend.prepared import PreparedFlight
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.process.hyperparameters import RatePrior
from fgnav.solve.chain import log_evidence, solve_batch

_BEGIN = (-1, 2)  # exponents of where the search begins: 0.3 s, 10 deg/s
_STEP = 10**0.5  # between neighbours: log-likelihoods a nat apart are a third of that apart
_LEAST, _LONGEST = -2, 2  # exponents: of lengths 0.1 to 10 s, of rates 0.1 deg/s and up
_ITERATIONS = 40  # of one candidate; those near the likeliest need ten
_MOST = 2000  # keyframes: a minute for all candidates; longer flights keep that of attitudes


def identified_by_evidence(prepared: PreparedFlight) -> PreparedFlight:
    """Return a flight with the rate prior under which its measurements are likeliest.

    Length and variance, the same about all axes, climb from neighbour to neighbour on a grid of
    factors of root ten; where a search starts matters as much, so each candidate is solved. What
    attitudes is a candidate, too.

    Parameters
    ----------
    prepared : PreparedFlight
        Without a gyroscope.
    """
    motion = prepared.problem.motion
    if not isinstance(motion, GyroFree) or len(prepared.problem.t_s) > _MOST:
        return prepared
    stated = (_score(prepared.problem), prepared.problem)
    candidates = {_BEGIN: _candidate(prepared.problem, motion, _BEGIN)}
    here = _BEGIN
    while True:
        around = [(here[0] + a, here[1] + b) for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        for place in around:
            if place not in candidates and min(place) >= _LEAST and place[0] <= _LONGEST:
                candidates[place] = _candidate(prepared.problem, motion, place)
        best = max((here, *(p for p in around if p in candidates)), key=lambda p: candidates[p][0])
        if best == here:
            break
        here = best
    score, problem = max(stated, candidates[here], key=lambda pair: pair[0])
    if problem is prepared.problem or not np.isfinite(score):
        return prepared
    note = prior_note(_prior(here))
    notes = tuple(one for one in prepared.notes if not one.startswith("Rate prior"))
    return replace(prepared, problem=problem, windowed=problem, notes=(*notes, note))


def _prior(place: tuple[int, int]) -> RatePrior:
    """Return the prior at a place of the grid."""
    sigma = np.radians(_STEP ** place[1])
    return RatePrior(
        length_s=_STEP ** place[0], variance_rad2ps2=np.full(3, sigma**2), evidence=np.nan
    )


def _candidate(
    problem: SmoothingProblem, motion: GyroFree, place: tuple[int, int]
) -> tuple[float, SmoothingProblem]:
    """Return the evidence of a place of the grid, and the problem with its prior."""
    prior, n = _prior(place), len(problem.t_s) - 1
    changed = replace(
        problem,
        motion=replace(
            motion,
            poles_per_s=np.tile(prior.poles_per_s, (n, 1, 1)),
            variance_rad2ps2=np.tile(prior.variance_rad2ps2, (n, 1)),
        ),
    )
    return _score(changed), changed


def _score(problem: SmoothingProblem) -> float:
    """Return the log evidence where a search ends; nothing where it has no solution."""
    try:
        solution = solve_batch(problem, most=_ITERATIONS)
        return log_evidence(problem, solution.states)
    except NoSolutionError:
        return -np.inf
