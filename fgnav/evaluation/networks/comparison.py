"""Networks on flights with truth: their answers, and a method with and without each of them.

The method runs without any network, with each one, and with its answers at the best constant
standard deviations of the other flights (``calibration``). A flight is the unit of every interval.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from fgnav.checks import BadInputError
from fgnav.evaluation.comparison import Watch
from fgnav.evaluation.flights import (
    FlightOutcome,
    FlightsComparison,
    compare_flights,
    without_nan,
)
from fgnav.evaluation.networks.calibration import Calibration, calibration
from fgnav.evaluation.paired import Paired
from fgnav.neural.factor import NeuralFactor
from fgnav.neural.records import Record
from fgnav.types.flight import Flight

NO_NETWORK = "no network"
WORTH = {  # figures of ``FIGURES`` by which a network is judged in a method, and their names
    "matched_attitude_rmse_deg": "attitude RMS, deg",
    "attitude_nees": "attitude NEES",
    "attitude_nll": "attitude NLL",
    "attitude_energy_score_deg": "attitude energy, deg",
    "position_rmse_m": "position RMS, m",
    "position_nees": "position NEES",
    "velocity_rmse_mps": "velocity RMS, m/s",
    "velocity_nees": "velocity NEES",
}


def constant_of(network: str) -> str:
    """Return what tables call a method that has a network's answers at constant sigmas."""
    return f"{network}, constant"


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class NetworksComparison:
    """What networks answer, and what a method makes of flights with and without them.

    Attributes
    ----------
    calibrations : tuple of Calibration
        Of each network, in the order given.
    flights : FlightsComparison
        Its methods are ``"no network"``, each network by its name, and with constant sigmas.
    """

    calibrations: tuple[Calibration, ...]
    flights: FlightsComparison

    def worth(self, figure: str, network: str, against: str) -> Paired:
        """Return what the method with a network gains, flight by flight, against another one."""
        return self.flights.paired(figure, network, against)

    def __str__(self) -> str:
        """Return the tables."""
        from fgnav.evaluation.networks.report import on_screen  # noqa: PLC0415  # lazy
        from fgnav.evaluation.report.text import text_lines  # noqa: PLC0415

        return "\n".join(text_lines(on_screen(self), 100))

    def to_dict(self) -> dict[str, Any]:
        """Return every figure in plain types; None, and null in JSON, where there is none."""
        networks = {one.name: asdict(one) | {"answered": one.answered} for one in self.calibrations}
        for name, content in networks.items():
            del content["sigmas"]
            content["worth"] = {
                against: {key: asdict(self.worth(key, name, against)) for key in WORTH}
                for against in (NO_NETWORK, constant_of(name))
            }
        return {"networks": without_nan(networks), "flights": self.flights.to_dict()}


def referee(
    networks: Sequence[NeuralFactor | Path | str],
    flights: Sequence[Flight],
    method: Any,  # noqa: ANN401  # an estimator that takes factors
    *,
    records: Sequence[Mapping[str, Record]] | None = None,
    watch: Watch = nullcontext,
) -> NetworksComparison:
    """Judge networks by their answers, and by what they are worth in a method.

    Parameters
    ----------
    networks : sequence of NeuralFactor, Path or str
        Sources, or manifests.
    flights : sequence of Flight
        With truth, two or more, none of which a network was trained on. Their own networks are left
        out.
    method : Estimator
        That takes ``factors``: ``Batch()``, ``Smoother()``, ``Forward()``.
    records : sequence of mapping of str to Record, optional
        Of each flight, for sensors that it does not have.
    watch : callable
        From what is at work to a context that it runs in, for progress.

    Raises
    ------
    BadInputError
        If two networks have one name, a flight has no truth, fewer than two flights can be
        answered, or an answer breaks the contract.
    """
    sources = [one if isinstance(one, NeuralFactor) else NeuralFactor(one) for one in networks]
    names = [one.name for one in sources]
    if len(set(names)) < len(names):
        raise BadInputError(f"networks {', '.join(names)}: have one name twice; rename one")
    flights = [replace(flight, networks=()) for flight in flights]
    given = records or [{}] * len(flights)
    methods: list[list[Any]] = [[replace(method, name=NO_NETWORK, factors=())] for _ in flights]
    calibrations: list[Calibration] = []
    refusals: list[dict[str, str]] = [{} for _ in flights]
    for source in sources:
        with watch(source.name):
            factors = [NeuralFactor(source.network, records=one) for one in given]
            for k, reason in _refusals(factors, flights):
                refusals[k][source.name] = reason
            suited = [k for k in range(len(flights)) if source.name not in refusals[k]]
            if not suited:
                raise BadInputError(refusals[0][source.name])
            found = calibration([factors[k] for k in suited], [flights[k] for k in suited])
        calibrations.append(found)
        for k, sigma in zip(suited, found.sigmas, strict=True):
            constant = NeuralFactor(source.network.with_sigma(sigma), records=given[k])
            methods[k] += [
                replace(method, name=source.name, factors=(factors[k],)),
                replace(method, name=constant_of(source.name), factors=(constant,)),
            ]
    outcomes = [
        _outcome(f"{k + 1} {flight.name}", flight, methods[k], refusals[k], watch)
        for k, flight in enumerate(flights)
    ]
    every = (NO_NETWORK, *(both for name in names for both in (name, constant_of(name))))
    return NetworksComparison(
        calibrations=tuple(calibrations),
        flights=FlightsComparison(methods=every, flights=tuple(outcomes)),
    )


def _refusals(
    factors: Sequence[NeuralFactor], flights: Sequence[Flight]
) -> Iterator[tuple[int, str]]:
    """Yield flights that lack what a network is to see, and why."""
    for k, (factor, flight) in enumerate(zip(factors, flights, strict=True)):
        reason = factor.refusal(flight)
        if reason is not None:
            yield k, reason


def _outcome(
    name: str, flight: Flight, methods: list[Any], refusals: Mapping[str, str], watch: Watch
) -> FlightOutcome:
    """Return what methods make of a flight, and which networks it cannot see it."""
    (outcome,) = compare_flights([(name, flight)], methods, watch=watch).flights
    return replace(outcome, failures={**outcome.failures, **refusals})
