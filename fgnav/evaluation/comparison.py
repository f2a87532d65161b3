"""Several methods on one flight: who is right, by how much, and how much better anyone could be."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, field, replace
from time import perf_counter
from typing import Any, Literal, NamedTuple

from fgnav.checks import BadInputError, NoSolutionError
from fgnav.evaluation.bound import flight_bound
from fgnav.evaluation.integer_counts import count_integers, integers_at, true_attitudes
from fgnav.evaluation.pairwise import Difference, pairwise
from fgnav.evaluation.scores import Angles, Score, baseline_figures, errors_against, score
from fgnav.integers.arcs.reported import reported_arcs
from fgnav.types.differences import DoubleDifferences
from fgnav.types.estimate import Errors, Estimate, Estimator, Rejected
from fgnav.types.flight import TRUTH_SIGMAS, Flight, Truth
from fgnav.types.integers import ArcInteger, Integers
from fgnav.types.summaries import summary, summary_html


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Method:
    """Figures, estimate and errors of one method."""

    name: str
    score: Score
    estimate: Estimate | None = None  # None where the method failed; ``score.failure`` says why
    errors: Errors | None = None  # None also where the flight has no truth
    # of arcs\' integers, each with the chance that it is wrong, and who says so
    arcs: tuple[ArcInteger, ...] = ()

    @property
    def solution(self) -> Estimate:
        """The estimate of a method that has one; NoSolutionError says why another has none."""
        if self.estimate is None:
            raise NoSolutionError(f"{self.name}: {self.score.failure}")
        return self.estimate

    @property
    def rejections(self) -> tuple[Rejected, ...]:
        """Measurements that it mended or did not believe."""
        return () if self.estimate is None else self.estimate.rejections

    def to_dict(self) -> dict[str, Any]:
        """Return every figure in plain types, each rejected measurement with its reason."""
        constants = () if self.estimate is None else self.estimate.calibration
        return asdict(self.score) | {
            "rejections": [asdict(rejected) for rejected in self.rejections],
            "calibration": [constant.to_dict() for constant in constants],
            "arcs": [asdict(arc) for arc in self.arcs],
        }


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Comparison:
    """The outcome of several methods on one flight.

    Attributes
    ----------
    flight : str
    epochs : int
        GNSS epochs, the largest number any method was asked for.
    methods : tuple of Method
        In the order asked.
    bound : Angles
        Cramer-Rao bound of one epoch's carrier phase with right integers, degrees.
    posterior_bound : Angles
        That of all measurements of the flight with the prior of the motion, as a smoother has them;
        of a flight with truth.
    differences : tuple of Difference
        Between each pair of methods, where there is no truth to judge by; else empty.
    double_differences : DoubleDifferences or None
        Of the array's observations; None without an array.
    right_integers : Integers or None
        What the true attitude implies of them; None without truth.
    judged_by : {"truth", "reference"} or None
        A reference is an estimate itself: its errors are in all figures. None without truth.
    counted_sigmas : tuple of str
        What the truth states 1-sigmas of, ``"attitude"``, ``"position"``, ``"velocity"``: NEES
        counts them.

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> comparison = fgnav.compare(flight, [fgnav.Smoother(noise="nominal")])
    >>> comparison.judged_by, [method.name for method in comparison.solved]
    ('truth', ['smoother'])
    >>> comparison["smoother"].score.attitude_rmse_deg < 0.3
    True
    """

    flight: str
    epochs: int
    methods: tuple[Method, ...]
    bound: Angles
    posterior_bound: Angles = field(default_factory=Angles)
    differences: tuple[Difference, ...] = ()
    double_differences: DoubleDifferences | None = None
    right_integers: Integers | None = None
    judged_by: Literal["truth", "reference"] | None = None
    counted_sigmas: tuple[str, ...] = ()

    @property
    def solved(self) -> list[Method]:
        """Methods that have an estimate."""
        return [method for method in self.methods if method.estimate is not None]

    @property
    def failure(self) -> str | None:
        """Why no method has a solution; None where one has."""
        if self.solved:
            return None
        failures = "; ".join(f"{m.name}: {m.score.failure}" for m in self.methods)
        return f"no method has a solution: {failures}"

    @property
    def contradictions(self) -> list[str]:
        """Methods that found inconsistent measurements, with the sensors."""
        return [
            f"{method.name}: {', '.join(dict.fromkeys(v.sensor for v in method.score.verdicts))}"
            for method in self.methods
            if method.score.verdicts
        ]

    def __getitem__(self, name: str) -> Method:
        """Return the method of that name."""
        for method in self.methods:
            if method.name == name:
                return method
        names = ", ".join(method.name for method in self.methods)
        raise BadInputError(f"method {name!r}: not one of {names}")

    def __repr__(self) -> str:
        """Return five lines: which methods, which is best, which failed."""
        return summary(self)

    def _repr_html_(self) -> str:
        """Return the summary for a notebook."""
        return summary_html(self)

    def to_dict(self) -> dict[str, Any]:
        """Return every figure in plain types; None, and null in JSON, where there is none."""
        return {
            "flight": self.flight,
            "epochs": self.epochs,
            "judged_by": self.judged_by,
            "counted_sigmas": self.counted_sigmas,
            "methods": {method.name: method.to_dict() for method in self.methods},
            "bound": {
                "crlb_deg": asdict(self.bound),
                "posterior_deg": asdict(self.posterior_bound),
            },
            "differences": [asdict(difference) for difference in self.differences],
        }


Watch = Callable[[str], AbstractContextManager[object]]


def compare(
    flight: Flight, estimators: Sequence[Estimator], *, watch: Watch = nullcontext
) -> Comparison:
    """Run estimators on one flight and judge them.

    Against truth where the flight has it, at each estimate's own epochs; against each other where
    not. A method that finds no solution is part of the outcome: its score says why.

    Parameters
    ----------
    flight : Flight
    estimators : sequence of Estimator
        Anything with a ``name`` that turns a flight into an estimate. Names must differ. Those with
        an equal ``preparation`` share what their ``prepare(flight)`` returns, to which each applies
        its ``estimate_prepared(flight, prepared)``; it counts in the time of each.
    watch : callable
        From an estimator's name to a context that it runs in, for progress.

    Returns
    -------
    Comparison

    Raises
    ------
    BadInputError
        If there is no estimator, two share a name, or one finds the flight unfit for it.

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> methods = [fgnav.Smoother(noise="nominal"), fgnav.Forward(noise="nominal")]
    >>> smoother, forward = fgnav.compare(flight, methods).methods
    >>> smoother.score.attitude_rmse_deg < forward.score.attitude_rmse_deg
    True
    """
    names = [estimator.name for estimator in estimators]
    if not names:
        raise BadInputError("compare: no estimators; pass one or more")
    for name in names:
        if names.count(name) > 1:
            raise BadInputError(f"compare: two estimators are named {name!r}; give each its own")
    first = replace(flight)
    prepared_by_key: dict[Hashable, _Outcome] = {}
    outcomes = []
    for k, estimator in enumerate(estimators):
        with watch(estimator.name):
            outcomes.append(_run(replace(flight) if k else first, estimator, prepared_by_key))
    estimates = [estimate for estimate, _, _ in outcomes if estimate is not None]
    differences = _differences_of(first)  # which the first method has made, as a rule
    right = _right_integers(flight, differences)
    methods = tuple(
        _judge(flight, name, outcome, differences, right)
        for name, outcome in zip(names, outcomes, strict=True)
    )
    gnss_epochs = 0 if flight.observations is None else len(flight.observations.t_s)
    return Comparison(
        flight=flight.name,
        epochs=max((estimate.n_epochs for estimate in estimates), default=gnss_epochs),
        methods=methods,
        bound=flight_bound(differences, flight.truth, estimates) if differences else Angles(),
        posterior_bound=_posterior_bound(flight, prepared_by_key),
        differences=() if flight.truth else pairwise(estimates),
        double_differences=differences,
        right_integers=right,
        judged_by=_judge_of(flight.truth),
        counted_sigmas=_counted(flight.truth),
    )


def _judge_of(truth: Truth | None) -> Literal["truth", "reference"] | None:
    if truth is None:
        return None
    return "reference" if truth.is_reference else "truth"


def _counted(truth: Truth | None) -> tuple[str, ...]:
    names = ("position", "velocity", "attitude")
    fields = zip(names, TRUTH_SIGMAS, strict=True)
    return tuple(name for name, field in fields if getattr(truth, field, None) is not None)


class _Outcome(NamedTuple):
    """Result of a piece of work, or why it has no solution, and its wall time."""

    value: Any
    seconds: float
    failure: str | None


def _run(
    flight: Flight,
    estimator: Any,  # noqa: ANN401  # may have more than an Estimator
    prepared_by_key: dict[Hashable, _Outcome],
) -> _Outcome:
    """Return the outcome of a method, on a flight of its own.

    Each method gets a flight object of its own, and what it shares with others counts in full, so
    that nobody is faster for coming later. Compiling kernels, half a minute once after an install,
    is in nobody's time.
    """
    key = getattr(estimator, "preparation", None)
    if key is None:
        return _timed(lambda: estimator(flight))
    try:
        hash(key)
    except TypeError:  # settings that do not hash are nobody else's
        key = object()
    if key not in prepared_by_key:
        prepared_by_key[key] = _timed(lambda: estimator.prepare(flight))
    shared = prepared_by_key[key]
    if shared.failure is not None:
        return shared
    outcome = _timed(lambda: estimator.estimate_prepared(flight, shared.value))
    return outcome._replace(seconds=outcome.seconds + shared.seconds)


def _timed(work: Callable[[], Any]) -> _Outcome:
    """Return the outcome of work, its seconds without compilation."""
    from numba.core.event import TimingListener, install_listener  # noqa: PLC0415  # lazy

    compiling = TimingListener()
    started_s = perf_counter()
    with install_listener("numba:compile", compiling):
        try:
            result, failure = work(), None
        except NoSolutionError as error:
            result, failure = None, str(error)
    seconds = perf_counter() - started_s
    return _Outcome(result, seconds - (compiling.duration if compiling.done else 0.0), failure)


def _judge(
    flight: Flight,
    name: str,
    outcome: _Outcome,
    differences: DoubleDifferences | None,
    right: Integers | None,
) -> Method:
    """Return the figures, estimate and errors of a method's outcome."""
    estimate, seconds, failure = outcome
    if estimate is None:
        return Method(name=name, score=Score(seconds=seconds, failure=failure))
    errors = errors_against(flight.truth, estimate) if flight.truth else None
    counts = None
    arcs = estimate.arcs
    if differences is not None and estimate.integers is not None:
        counts = count_integers(differences, estimate.integers, right)
        names = tuple(antenna.name for antenna in flight.antennas)
        arcs = (*reported_arcs(differences, estimate.integers, names), *arcs)
    return Method(
        name=name,
        score=score(estimate, errors, counts, seconds, baseline_figures(flight, estimate)),
        estimate=estimate,
        errors=errors,
        arcs=arcs,
    )


def _posterior_bound(flight: Flight, prepared_by_key: Mapping[Hashable, _Outcome]) -> Angles:
    """Return the bound of the first smoothing problem, one that knows the whole flight if any."""
    if flight.truth is None:
        return Angles()
    from fgnav.assembly.prepared import PreparedFlight  # noqa: PLC0415  # lazy: brings numba

    keys = sorted(prepared_by_key, key=lambda key: bool(getattr(key, "causal", False)))
    for outcome in (prepared_by_key[key] for key in keys):
        if isinstance(outcome.value, PreparedFlight):
            from fgnav.evaluation.posterior_bound import posterior_angles  # noqa: PLC0415  # as above

            try:
                return posterior_angles(flight, outcome.value)
            except NoSolutionError:  # measurements leave a state open: then nothing is bounded
                return Angles()
    return Angles()


def _differences_of(flight: Flight) -> DoubleDifferences | None:
    """Return the flight's double differences; None where it has none to judge integers by."""
    if flight.observations is None or len(flight.antennas) < 2:
        return None
    from fgnav.gnss.difference import double_differences  # noqa: PLC0415  # lazy: brings numba

    try:
        differences: DoubleDifferences = double_differences(flight)
    except NoSolutionError:  # then no method has used any either
        return None
    return differences


def _right_integers(flight: Flight, differences: DoubleDifferences | None) -> Integers | None:
    """Return the integers that the true attitude implies; None without truth."""
    if differences is None or flight.truth is None:
        return None
    return integers_at(differences, *true_attitudes(flight.truth, differences.t_s))
