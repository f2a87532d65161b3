"""The source paper's restitution of commanded angles, by its method and by others.

Ramps that reach 5 to 45 degrees in 10 s and sines of 1 rad/s with the same amplitudes (its section
4.5), all three angles at once, seen by its eight antennas and six satellites, an accelerometer, and
in the last part a photodetector, whose landmark the nose then passes. What its networks are given
as range is told in several ways; see ``READINGS``.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import cache
from math import nan
from multiprocessing import get_context

import numpy as np

from fgnav.checks import BadInputError, FloatArray, NoSolutionError
from fgnav.evaluation.ablation import without
from fgnav.evaluation.scores import errors_against
from fgnav.geometry.earth import geodetic
from fgnav.gnss.difference import double_differences
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.integers.resolvers.registry import resolver_named, resolver_names
from fgnav.integers.validation import phase_links
from fgnav.methods.closed_form import ClosedForm
from fgnav.methods.maximum_likelihood import MaximumLikelihood
from fgnav.methods.rtk import Rtk
from fgnav.methods.smoother import Smoother
from fgnav.seeker import line_of_sight
from fgnav.types.estimate import Estimator
from fgnav.types.flight import Flight
from fgnav.types.integers import Resolver
from fgnav_models.runtime.ambiguity import AmbiguityNetwork, classification, regression
from fgnav_sim.motion import Arc, Motion, Rate, Sine
from fgnav_sim.scenario import (
    GnssTable,
    ImuTable,
    OcclusionTable,
    Place,
    Scenario,
    SeekerTable,
)
from fgnav_sim.simulate import simulate

MOTIONS = ("ramp", "sine")
AMPLITUDES_DEG = tuple(range(5, 50, 5))
BY_RIGHT_INTEGERS = "closed form, constrained"  # the paper's method at its best
LEARNED = "network"  # the resolver by learned trust, where it is installed
_DURATION_S = 10.0
_DAY = datetime(2020, 6, 25)  # GPS time has no time zone; that of the networks' training
_DAY_S = 86_400.0
_LIT_S, _AIMED_S = 7.0, 8.5  # from when the landmark is lit, and when the nose points at it
_LANDMARK_M = 2000.0  # away
_SIGHT = ("line-of-sight",)
_RATIO_MIN = 3.0  # of RTK's ratio test
_SURE = 0.99
_DECIMALS = 6  # of seconds, by which epochs are the same


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """What is taken for the range that the paper's networks are given."""

    name: str
    # code_m, phase_m: noise of one link
    code_m: float
    phase_m: float

    @property
    def title(self) -> str:
        """Say it in words."""
        return f"{self.name}: range noise {self.code_m:g} m, phase noise {self.phase_m:g} m"


READINGS = (
    Reading(name="range like a phase of 0.5 mm", code_m=0.0005, phase_m=0.0005),
    Reading(name="range like a phase of 1 mm", code_m=0.001, phase_m=0.001),
    Reading(name="range like a phase of 3 mm", code_m=0.003, phase_m=0.003),
    Reading(name="range by code", code_m=0.3, phase_m=0.003),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One flight: how its range is read, how it turns, and which noise it has."""

    reading: Reading
    motion: str
    amplitude_deg: int
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What one method made of one flight."""

    case: Case
    method: str
    # roll, pitch, yaw, over the epochs that have an answer; NaN where none has
    rmse_deg: tuple[float, float, float] = (nan, nan, nan)
    available: float = 0.0  # share of the epochs with an answer
    # fixed, wrong: share of the integers that were accepted, and share of these that are wrong; NaN
    # where there is no answer
    fixed: float = nan
    wrong: float = nan
    spoilt: float = nan  # share of the epochs with an answer that hold a wrong integer; likewise
    # RMSE over the other epochs, mean of roll, pitch and yaw; NaN where there is none
    clean_deg: float = nan
    seen_deg: float = nan  # likewise over the epochs at which the landmark is seen
    failure: str = ""  # why there is no answer; empty where there is


def cases(seeds: int) -> list[Case]:
    """Return all flights of so many seeds.

    Raises
    ------
    BadInputError
        If there is no seed.
    """
    if seeds < 1:
        raise BadInputError(f"--seeds: must be 1 or more, got {seeds}")
    return [
        Case(reading=reading, motion=motion, amplitude_deg=amplitude_deg, seed=seed)
        for reading in READINGS
        for motion in MOTIONS
        for amplitude_deg in AMPLITUDES_DEG
        for seed in range(1, seeds + 1)
    ]


def flight_of(case: Case) -> Flight:
    """Return the simulated flight of a case, at a time of the day that the seed tells."""
    rising = Rate(rate_degps=case.amplitude_deg / _DURATION_S)
    angle = rising if case.motion == "ramp" else Sine(amplitude_deg=case.amplitude_deg)
    since_s = float(np.random.default_rng(case.seed).uniform(0.0, _DAY_S - _DURATION_S))
    motion = Motion(path=Arc(), roll=angle, pitch=angle, yaw=angle)
    scenario = Scenario(
        name=f"{case.motion} {case.amplitude_deg}",
        start=_DAY + timedelta(seconds=round(since_s)),
        duration_s=_DURATION_S,
        motion=motion,
        gnss=GnssTable(
            choose=6,
            receiver_mask_deg=10.0,
            code_noise_m=case.reading.code_m,
            phase_noise_m=case.reading.phase_m,
            elevation_weights="uniform",
        ),
        imu=ImuTable(),
        seeker=_photodetector(motion),
    )
    # The same draws in every reading: they differ in size alone.
    drawn = [case.seed, MOTIONS.index(case.motion), case.amplitude_deg]
    return simulate(scenario, np.random.default_rng(drawn))


def _photodetector(motion: Motion) -> SeekerTable:
    """Return a photodetector and a landmark that it sees in the last part of a flight."""
    state = motion(np.array([_AIMED_S]))
    place = geodetic(Place().frame.to_e(state.p_n_m + _LANDMARK_M * state.R_nb[:, :, 0]))[0]
    latitude_deg, longitude_deg = np.degrees(place[:2]).tolist()
    return SeekerTable(
        landmark=Place(
            latitude_deg=latitude_deg, longitude_deg=longitude_deg, height_m=float(place[2])
        ),
        occlusions=(OcclusionTable(quadrant=1, until_s=_LIT_S),),
    )


@cache
def estimators() -> tuple[tuple[Estimator, bool], ...]:
    """Return the methods of the tables, named by what they are and whose integers they take.

    Each with whether it is given the photodetector. Closed forms have the array alone but for those
    whose name says more. Those with the integers of the resolver ``network`` are there where it is
    installed.
    """
    constrained = resolver_named("constrained")
    sure = AmbiguityNetwork(probability_min=_SURE)
    of_paper: dict[str, Resolver] = {
        "regression": regression(),
        "classification": classification(),
        f"classification, sure to {_SURE:g}": sure,
        "rounding": resolver_named("rounding"),
        "RTK": Lambda(joint=False, ratio_min=_RATIO_MIN),
        "constrained": constrained,
    }
    others: dict[str, Resolver] = {"constrained": constrained}
    if LEARNED in resolver_names():
        others[LEARNED] = resolver_named(LEARNED)
    best, title = ClosedForm(resolver=constrained), BY_RIGHT_INTEGERS
    by_array = [
        ClosedForm(resolver=r, gravity=None, name=f"closed form, {name}")
        for name, r in of_paper.items()
    ]
    return (
        *((one, False) for one in by_array),
        (replace(best, name=f"{title}, and gravity"), False),
        (replace(best, name=f"{title}, and line of sight", gravity=None), True),
        (replace(best, name=f"{title}, weighted", gravity=None, weights="covariance"), False),
        (replace(best, name=f"{title}, all pairs"), True),
        (replace(best, name=f"{title}, all pairs, weighted", weights="covariance"), True),
        (
            replace(best, name="closed form, classification, all pairs", resolver=classification()),
            True,
        ),
        (Rtk(ratio_min=_RATIO_MIN, name="RTK"), False),
        *(
            (MaximumLikelihood(resolver=r, name=f"maximum likelihood, {name}"), False)
            for name, r in others.items()
        ),
        *(
            (Smoother(resolver=r, name=f"smoother, {name}"), False)
            for name, r in {"classification": classification(), **others}.items()
        ),
        (Smoother(resolver=constrained, name="smoother, constrained, and line of sight"), True),
    )


def judged(case: Case) -> list[Run]:
    """Return what every method makes of a case; methods with one resolver share its integers."""
    flight = flight_of(case)
    by_sight = {True: flight, False: without(flight, _SIGHT) if flight.seeker else flight}
    seen_s = line_of_sight(flight.seeker).t_s if flight.seeker else np.zeros(0)
    return [_run(case, one, by_sight[sees], seen_s) for one, sees in estimators()]


def restitute(
    todo: Sequence[Case], *, processes: int = 2, watch: Callable[[int], None] | None = None
) -> list[Run]:
    """Return what every method makes of cases, in their order whatever the number of processes.

    Parameters
    ----------
    watch : callable, optional
        Told how many cases are done.

    Raises
    ------
    BadInputError
        If there is no process, or a network cannot be loaded.
    """
    if processes < 1:
        raise BadInputError(f"--processes: must be 1 or more, got {processes}")
    runs: list[Run] = []
    with _mapped(processes) as over:
        for done, some in enumerate(over(todo), start=1):
            runs += some
            if watch is not None:
                watch(done)
    return runs


@contextmanager
def _mapped(processes: int) -> "Iterator[Callable[[Sequence[Case]], Iterator[list[Run]]]]":
    """Give a map of ``judged`` over cases, in order, here or in processes of their own."""
    if processes == 1:
        yield lambda todo: map(judged, todo)
        return
    # Not forked: libraries that run threads do not survive it.
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        try:
            yield lambda todo: pool.map(judged, todo)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _run(case: Case, estimator: Estimator, flight: Flight, seen_s: FloatArray) -> Run:
    """Return the figures of a method on a flight that has truth."""
    nothing = Run(case=case, method=estimator.name)
    try:
        estimate = estimator(flight)
    except NoSolutionError as error:
        return replace(nothing, failure=str(error))
    if flight.truth is None or estimate.integers is None:
        return replace(nothing, failure="no truth, or no integers, to judge by")
    errors = errors_against(flight.truth, estimate)
    differences = double_differences(flight)
    fixed, cycles = estimate.integers.fixed, estimate.integers.cycles
    wrong = fixed & (cycles != resolver_named("truth")(differences, flight).cycles)
    of_wrong_s = differences.t_s[wrong.any(axis=(1, 2))]
    spoilt, seen = (
        np.isin(errors.t_s.round(_DECIMALS), some_s.round(_DECIMALS))
        for some_s in (of_wrong_s, seen_s)
    )
    roll, pitch, yaw = _rmse_deg(errors.euler_rad).tolist()
    return Run(
        case=case,
        method=estimator.name,
        rmse_deg=(roll, pitch, yaw),
        available=estimate.available,
        fixed=float(fixed.sum() / phase_links(differences).sum()),
        wrong=float(wrong.sum() / fixed.sum()) if fixed.any() else nan,
        spoilt=float(spoilt.mean()),
        clean_deg=float(_rmse_deg(errors.euler_rad[~spoilt]).mean()),
        seen_deg=float(_rmse_deg(errors.euler_rad[seen]).mean()),
    )


def _rmse_deg(euler_rad: FloatArray) -> FloatArray:
    """Return the RMS of angles, (n, 3), degrees; NaN of none."""
    if not len(euler_rad):
        return np.full(3, nan)
    return np.asarray(np.degrees(np.sqrt((euler_rad**2).mean(axis=0))))
