"""The sliding window fed epoch by epoch, as measurements come, for as long as they come."""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import islice

import gtsam
import numpy as np

from fgnav.checks import BadInputError, FloatArray, unused_of
from fgnav.graph.build import Layout
from fgnav.graph.custom import NamedFactor, named, touched_keyframes
from fgnav.graph.innovations import custom_innovations
from fgnav.graph.keys import Timeline
from fgnav.graph.sourced import Sourced
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.solution import Solution
from fgnav.methods.observation_stream import ObservationStream
from fgnav.methods.smoother import Forward
from fgnav.methods.smoothing.calibration_report import calibrated_parameters
from fgnav.methods.smoothing.concatenation import no_keyframes
from fgnav.methods.smoothing.custom_sources import custom_constants, with_networks, with_timelines
from fgnav.methods.smoothing.estimates import stated
from fgnav.methods.streaming.keyframe import keyframe_problem
from fgnav.methods.streaming.measurements import Direction, Measured, Measurements, StreamConfig
from fgnav.solve.custom_factors import touches_newest
from fgnav.solve.sliding.window import FixedLag
from fgnav.types.estimate import Consistency, Estimate
from fgnav.types.flight import Flight

__all__ = ["Direction", "Measured", "Measurements", "Stream", "StreamConfig", "StreamSource"]

_METHOD = "smoother"  # what estimates of a stream are called
# What a measurement needs to be stated of it.
_NEEDED = {"sight": "landmark_n_m", "height_m": "barometer", "field_b_ut": "magnetometer"}


StreamSource = Callable[[Measurements, Timeline], Iterable[gtsam.NonlinearFactor | NamedFactor]]


class Stream:
    """A sliding window that runs on: one update per keyframe, memory bounded by the lag.

    Parameters
    ----------
    config : StreamConfig
    lag_s : float
        Keyframes leave when they are known from the measurements up to this long after them.
    factors : tuple of callable
        Sources of custom factors, asked at every update with the measurements and the
        timeline of all keyframes so far; what touches the newest keyframe enters.

    Examples
    --------
    Positions and an accelerometer, as they come:

    >>> import numpy as np
    >>> import fgnav
    >>> from fgnav.methods.streaming.measurements import Measured, Measurements, StreamConfig
    >>> from fgnav.process.hyperparameters import RatePrior
    >>> flight = fgnav.load_flight("demo/flight")
    >>> truth, antenna_b_m = flight.truth, flight.antennas[0].position_b_m
    >>> prior = RatePrior(length_s=0.5, variance_rad2ps2=np.full(3, 0.1), evidence=np.nan)
    >>> config = StreamConfig(origin=flight.origin, antenna_b_m=antenna_b_m, rate_prior=prior)
    >>> stream = fgnav.Stream(config, lag_s=0.2)
    >>> for k in range(5):
    ...     fix = Measured(value=truth.p_n_m[k] + truth.R_nb[k] @ antenna_b_m, covariance=np.eye(3))
    ...     came = Measurements(t_s=truth.t_s[k], imu=flight.imu, position=fix, R_nb=truth.R_nb[k])
    ...     print(stream.update(came).t_s)
    []
    []
    [0.]
    [0.1]
    [0.2]
    >>> print(stream.latest().t_s)
    [0.4]
    """

    def __init__(
        self, config: StreamConfig, lag_s: float = 5.0, *, factors: tuple[StreamSource, ...] = ()
    ) -> None:
        self._config = config
        self._sources = with_networks(factors, config.networks)
        self._asked = custom_constants(self._sources)
        self._times_s: list[float] = []  # of all keyframes; only for sources
        self._latest: Problem | None = None
        self._window = FixedLag(lag_s, block_s=0.0)
        self._last_s = -np.inf
        self._count = 0
        self._kept: deque[tuple[float, FloatArray]] = deque()  # times and rates of keyframes
        self._unused: Counter[tuple[str, str]] = Counter()
        self._judged: deque[NamedFactor] = deque()  # custom factors of keyframes kept

    @staticmethod
    def replay(flight: Flight, method: Forward | None = None) -> Iterator[Estimate]:
        """Yield what ``ObservationStream`` returns of a flight, fed to it epoch by epoch.

        Parameters
        ----------
        flight : Flight
            With raw observations.
        method : Forward, optional
            Joined, the estimates are what ``method(flight)`` returns.

        Returns
        -------
        iterator of Estimate
            Each of the keyframes that have become due.

        Examples
        --------
        >>> import fgnav
        >>> flight = fgnav.load_flight("demo/flight")
        >>> estimates = fgnav.Stream.replay(flight, fgnav.Forward(noise="nominal"))
        >>> solution = (estimate for estimate in estimates if len(estimate.t_s))
        >>> len(next(solution).t_s), len(next(solution).t_s)  # the first wait for a rate prior
        (5, 1)
        """
        return ObservationStream.replay(flight, method)

    @property
    def keyframe(self) -> int:
        """Number of the keyframe that comes next, as in ``graph.pose(k)``."""
        return self._count

    def update(self, measurements: Measurements) -> Estimate:
        """Take a keyframe in; return the keyframes that leave by that, smoothed; often none.

        Parameters
        ----------
        measurements : Measurements
            Of one keyframe, and the inertial samples up to it.

        Returns
        -------
        Estimate
            Of those keyframes.

        Raises
        ------
        BadInputError
            If it does not come after the one before, if it has what the set-up says nothing of, or
            the first has nothing to start from.
        NoSolutionError
            If the measurements so far leave a state open.
        """
        if not measurements.t_s > self._last_s:
            raise BadInputError(
                f"measurements t_s: must come after {self._last_s}, got {measurements.t_s}"
            )
        for name, needed in _NEEDED.items():
            given = getattr(measurements, name) is not None
            if given and getattr(self._config, needed) is None:
                raise BadInputError(f"measurements {name}: the set-up has no {needed}")
        p_n_m = self._window.latest().states.p_n_m[0] if self._count else None
        problem = keyframe_problem(measurements, self._config, self._last_s, p_n_m)
        problem = problem.with_constants(self._asked)
        custom = self._custom(measurements, problem)
        solution = self._window.update(problem, len(problem.t_s) - 1, custom=custom)
        self._latest, self._last_s = problem, measurements.t_s
        self._count += 1
        rates = problem.motion.rates_b_radps(problem.t_s[-1:], np.zeros_like(problem.start.aux[:1]))
        self._kept.append((measurements.t_s, rates[0]))
        estimate = self._leaving(solution)
        for _ in estimate.t_s:
            self._kept.popleft()
        return estimate

    def latest(self) -> Estimate:
        """Return the newest keyframe, known from what has come so far."""
        return self._estimate(self._window.latest(), [self._kept[-1]])

    def flush(self) -> Estimate:
        """Return the keyframes that have not left, known from all that has come."""
        return self._leaving(self._window.flush())

    def _custom(
        self, measurements: Measurements, problem: Problem
    ) -> tuple[gtsam.NonlinearFactor, ...]:
        """Return custom factors that touch the coming keyframe."""
        if not (self._sources or measurements.factors):
            return ()
        layout = Layout.of(problem)
        bounds = (layout, self._window.oldest, self._count)
        factors = []
        for factor in map(named, measurements.factors):
            if not touches_newest(factor, *bounds):
                raise BadInputError(
                    f"factor {factor.name!r}: must touch the keyframe it enters with, {self._count}"
                )
            factors.append(factor)
        times_s = [*self._times_s, measurements.t_s]
        if self._sources:
            timeline = Timeline(t_s=np.array(times_s), gyroscope=layout.gyroscope, new=self._count)
            first = len(problem.constants.parts) - len(self._asked)
            for source, its in with_timelines(self._sources, timeline, first):
                made = source(measurements, its)
                factors += [
                    factor for factor in map(named, made) if touches_newest(factor, *bounds)
                ]
                if isinstance(made, Sourced):
                    self._unused.update(
                        {(entry.what, entry.reason): entry.count for entry in made.unused}
                    )
        self._times_s = times_s
        self._judged.extend(factors)
        return tuple(factor.factor for factor in factors)

    def _leaving(self, solution: Solution | None) -> Estimate:
        """Return the oldest keyframes, which leave."""
        if solution is None or self._latest is None:
            return no_keyframes(_METHOD)
        estimate = self._estimate(solution, [*islice(self._kept, len(solution.covariance))])
        unused = unused_of(self._unused)
        self._unused.clear()
        tests = self._custom_tests(self._latest, solution, estimate.t_s)
        return replace(estimate, unused=unused, consistency=tests)

    def _custom_tests(
        self, problem: Problem, solution: Solution, t_s: FloatArray
    ) -> tuple[Consistency, ...]:
        """Return the tests of custom factors that leave with keyframes.

        Those that reach back to keyframes which left before have nothing to be held against.
        """
        first, leaving = self._count - len(self._kept), []
        end = first + len(t_s)
        while self._judged and touched_keyframes(self._judged[0].factor)[-1] < end:
            leaving.append(self._judged.popleft())
        alone = [tested for tested in leaving if touched_keyframes(tested.factor)[0] >= first]
        series = custom_innovations(alone, Layout.of(problem), t_s, solution, first)
        return tuple(innovations.summary for innovations in series)

    def _estimate(self, solution: Solution, kept: list[tuple[float, FloatArray]]) -> Estimate:
        """Return keyframes by their times and measured rates."""
        if self._latest is None:
            return no_keyframes(_METHOD)
        problem, vectors = self._latest, solution.states.aux[:, 3:6]
        t_s, measured = (np.array(values) for values in zip(*kept, strict=True))
        rates = measured - vectors if problem.gyroscope else vectors
        constants = calibrated_parameters(problem.constants, solution)
        return replace(stated(_METHOD, problem, solution, t_s, rates), calibration=constants)
