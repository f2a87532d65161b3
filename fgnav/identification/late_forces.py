"""Specific forces that are late against the rates of their unit: a filter's delay.

A low pass of the accelerometer alone delays forces, which no clock of the whole unit and no delay
of velocities stands for: their sum shows as a delay, and the forces point where the body pointed
before. The delay is tested as one more constant of the chain on which noise is identified; beside
phases of arcs, which tell forces far better, of the whole problem. It is taken for true where the
flight with forces so early is likelier than as recorded and than with tags of the whole unit moved.
"""

from dataclasses import replace

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.graph.types.constants import flight_constant
from fgnav.identification.likelihood.beside_phases import is_misfit
from fgnav.identification.likelihood.changed_samples import (
    solved_with_changes,
    with_changed_samples,
)
from fgnav.identification.likelihood.record_clock import with_drifts
from fgnav.identification.tested_constants import SIGMAS
from fgnav.identification.time_tags import AtTags, TagSearch
from fgnav.types.flight import Flight, Imu

FORCE_DELAY = "force delay"
# 1-sigma, s: low passes of small units delay by up to 19 ms (InvenSense MPU-6000, register map 4.2,
# DLPF_CFG).
_DELAY_S = 0.02
_ANY_S = 1.0  # beside phases, which tell it to a millisecond: next to nothing is known of it
_STEPS = 3  # at most: noise that stood for the delay is another after the first
_ITERATIONS = 10
_STEP_S = 0.01  # of a difference quotient: forces are linear in it


def with_late_forces(search: TagSearch, at_tags: AtTags) -> tuple[TagSearch, AtTags, float]:
    """Return a search with forces in time, what the flight says then, and by what they are late.

    As they were, and 0, where the chain tells no delay if all else is in time, or none is likelier
    than what was found of the tags.
    """
    first, unchanged = at_tags.doubted or at_tags, (search, at_tags, 0.0)
    by_phases_s = _late_by_phases_s(search, first)
    late_s = _late_s(search, first, SIGMAS) if by_phases_s is None else by_phases_s
    if not late_s > 0.0:  # a filter delays
        return unchanged
    early, rest_s = _early(search, late_s), late_s
    tags = (first.moved,) if at_tags is first else (first.moved, at_tags.moved)
    least = max(search.without_clock(by, tags).likelihood for by in tags)
    if not first.identified.times.are_one_or_the_other:  # else something of time is off
        least += SIGMAS**2 / 2
    if early.without_clock(first.moved, tags, delay=False).likelihood <= least:
        return unchanged
    if by_phases_s is not None:  # to the end: rows of the motion are linear in it
        in_time = early.identified(first.moved)
        return unchanged if in_time is None else (early, in_time, late_s)
    in_time = None
    for _ in range(_STEPS):
        in_time = early.identified(first.moved)
        rest_s = 0.0 if in_time is None else _late_s(early, in_time, 1.0)
        if rest_s == 0.0:
            break
        late_s += rest_s
        early = _early(search, late_s)
    return unchanged if in_time is None or rest_s else (early, in_time, late_s)


def with_forces_early(flight: Flight, by_s: float) -> Flight:
    """Return a flight whose forces are those ahead of a first-order low pass of so much delay.

    Of its samples x that follow ``x_k = x_k-1 + (u_k - x_k-1) / (1 + d / T)``, T apart, u is
    ``x_k + d (x_k - x_k-1) / T``: to first order the forces a time d later, whatever delays them.
    """
    if flight.imu is None or by_s == 0.0:
        return flight
    return replace(flight, imu=_early_unit(flight.imu, by_s))


def sentences(late_s: float) -> tuple[str, ...]:
    """Return what is to be said of late forces."""
    if late_s == 0.0:
        return ()
    return (
        f"The accelerometer is {late_s:.3f} s late against the gyroscope, as of a low pass: its "
        "forces are taken as early as that.",
    )


def _late_by_phases_s(search: TagSearch, at_tags: AtTags) -> float | None:
    """Return by how much forces are late by a whole problem with phases; None without these.

    0 if it is less than four sigmas, leaves more than chance, or biases that drift steadily are
    likelier, which look like a delay where nothing else is free.
    """
    imu = search.flight.imu
    if search.flight.observations is None or imu is None or imu.w_b_radps is None:
        return None
    problem = search.at_tags(at_tags.moved).problem
    if problem.phase is None:
        return None
    constant = flight_constant(FORCE_DELAY, ("delay",), "s", _ANY_S, reported=False)
    late = solved_with_changes(problem, (constant,), (_early_unit,), np.array([_STEP_S]))
    if late is None:
        return 0.0
    late_s = float(late.states.constants[-1])
    sigma_s = float(np.sqrt(late.constant_covariance[0, -1, -1]))
    if late_s <= SIGMAS * sigma_s or is_misfit(problem, late.cost):
        return 0.0
    drifts = with_drifts(problem)
    return late_s if drifts is None or late.cost < drifts.cost else 0.0


def _late_s(search: TagSearch, at_tags: AtTags, sigmas: float) -> float:
    """Return by how much forces are late at the noise identified, all else in time.

    0 without a gyroscope or a chain, or if it is less than so many sigmas.
    """
    imu, identified = search.flight.imu, at_tags.identified
    if imu is None or imu.w_b_radps is None:
        return 0.0
    constant = flight_constant(FORCE_DELAY, ("delay",), "s", _DELAY_S, reported=False)
    try:
        small = search.on_time(at_tags.moved, (constant,))
        column = small.problem.constants.column(FORCE_DELAY)
        problem = with_changed_samples(small.problem, (_early_unit,), np.array([_STEP_S]), column)
        flight = small._replace(problem=problem)
        _, states, score = flight.descended(
            problem.start, flight.logarithms(identified.factors), _ITERATIONS
        )
    except NoSolutionError:
        return 0.0
    late_s = states.constants[column] + score.constant_steps[column]
    sigma_s = np.sqrt(score.constant_covariance[column, column])
    return float(late_s) if abs(late_s) > sigmas * sigma_s else 0.0


def _early_unit(imu: Imu, by_s: float = _STEP_S) -> Imu:
    slope = np.diff(imu.f_b_mps2, axis=0, prepend=imu.f_b_mps2[:1]) / np.median(np.diff(imu.t_s))
    return replace(imu, f_b_mps2=imu.f_b_mps2 + by_s * slope)


def _early(search: TagSearch, by_s: float) -> TagSearch:
    return search._replace(flight=with_forces_early(search.flight, by_s))
