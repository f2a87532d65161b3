"""Detection, identification and adaptation on whole sensors [1]_.

Verdicts detect. The flight is estimated without the worst suspect, and once more without another;
the first that is consistent is kept, with what it is without. A whole instrument that is left out
keeps its verdict: that the others agree does not tell which of them is right. Otherwise the flight
stays as it is.

References
----------
.. [1] Teunissen: Distributional theory for the DIA method, Journal of Geodesy 92, 2018.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, NoSolutionError
from fgnav.messages import note
from fgnav.types.estimate import Estimate, Rejected, Verdict
from fgnav.types.flight import Fixes, Flight
from fgnav.types.instruments import Samples

_TRIALS = 2  # each takes as long as the flight
_MARGIN_S = 1.0  # blocks are a second long: what spoils one may reach into the next
_THROUGHOUT = 0.5  # share of a record
_WEIGHTLESS = 1e3  # on a standard deviation
# Kinds of records by the name of their measurement.
INSTRUMENTS = {
    "baseline": "baseline",
    "line of sight": "photodetector",
    "barometric height": "barometer",
    "magnetic field": "magnetometer",
}
_SET_UP = ("lever arm", "velocity latency")
_OBSERVED = {"velocity": "doppler_hz", "array phases": "phase_cycles", "phase": "phase_cycles"}


class Exclusion(NamedTuple):
    """A flight without what may contradict the rest of it, and the verdicts that stay."""

    flight: Flight
    rejected: tuple[Rejected, ...]
    verdicts: tuple[Verdict, ...]


def without_contradictions(
    flight: Flight, estimate: Estimate, again: Callable[[Flight], Estimate]
) -> Estimate:
    """Return the estimate of a flight without a suspect if that is consistent, else as it is.

    Parameters
    ----------
    flight : Flight
    estimate : Estimate
        Of all of it, with its verdicts.
    again : callable
        The same method.
    """
    # Of no sensor's measurements.
    if all(verdict.sensor in _SET_UP for verdict in estimate.verdicts):
        return estimate
    for exclusion in islice(exclusions(flight, estimate.verdicts), _TRIALS):
        try:
            trial = again(exclusion.flight)
        except NoSolutionError:
            continue
        is_as_open = set(trial.unobservable) <= set(estimate.unobservable)
        if trial.consistent and trial.converged and is_as_open and _is_determined(trial):
            notes = tuple(
                note(
                    "W308", what=rejection.what, from_s=rejection.from_s, until_s=rejection.until_s
                )
                for rejection in exclusion.rejected
            )
            return replace(
                trial,
                verdicts=exclusion.verdicts,
                rejections=(*trial.rejections, *exclusion.rejected),
                notes=(*notes, *trial.notes),
            )
    return estimate


def _is_determined(estimate: Estimate) -> bool:
    """Return True if attitudes are known to better than a radian: others fit any measurements."""
    sigma_deg = estimate.sigma_deg
    return sigma_deg is not None and bool(np.median(sigma_deg.max(axis=1)) < np.degrees(1.0))


def exclusions(flight: Flight, verdicts: tuple[Verdict, ...]) -> Iterator[Exclusion]:
    """Yield flights without a suspect: instruments first, then GNSS of the spans that contradict.

    Instruments that have no verdict come last, for one that is wrong may pull the estimate away
    from all others.
    """
    worst = sorted(verdicts, key=lambda verdict: -verdict.ratio / verdict.limit)
    sensors = list(dict.fromkeys(verdict.sensor for verdict in worst))
    sensors.sort(key=lambda name: name not in INSTRUMENTS)
    for sensor in sensors:
        of_sensor = [verdict for verdict in verdicts if verdict.sensor == sensor]
        spans = np.array(
            [[verdict.from_s - _MARGIN_S, verdict.until_s + _MARGIN_S] for verdict in of_sensor]
        )
        changed = _flight_excluding(flight, sensor, spans)
        if changed is not None:
            is_gone = sensor in INSTRUMENTS and not _records(changed, INSTRUMENTS[sensor])
            yield Exclusion(
                changed, tuple(map(_rejected, of_sensor)), tuple(of_sensor) if is_gone else ()
            )
    for name, kind in INSTRUMENTS.items():
        times = [record.t_s for record in _records(flight, kind).values() if len(record.t_s)]
        if times and name not in sensors:
            reason = "without it the other measurements are consistent: left out"
            span = min(float(t_s[0]) for t_s in times), max(float(t_s[-1]) for t_s in times)
            rejected = Rejected(
                what=name, link=name, from_s=span[0], until_s=span[1], reason=reason
            )
            verdict = replace(worst[0], sensor=name, from_s=span[0], until_s=span[1])
            yield Exclusion(_flight_without(flight, kind), (rejected,), (verdict,))


def _flight_excluding(flight: Flight, sensor: str, spans: FloatArray) -> Flight | None:
    """Return a flight without a sensor's measurements in spans, (g, 2); None if none can be.

    An instrument of whose record most is concerned is left out whole; other sensors stay.
    """
    kind = INSTRUMENTS.get(sensor)
    if kind is None and flight.fixes and sensor in ("position", "velocity"):
        kind = "fixes"
    if kind is not None:
        records = _records(flight, kind)
        rows = {name: _inside(record.t_s, spans) for name, record in records.items()}
        if np.concatenate(list(rows.values())).mean() > _THROUGHOUT:
            return _flight_without(flight, kind) if sensor in INSTRUMENTS else None
        if sensor == "velocity":  # positions stay
            return replace(
                flight, fixes=tuple(_without_velocity(fixes, spans) for fixes in flight.fixes)
            )
        left = {name: record[~rows[name]] for name, record in records.items()}
        return flight.with_records({**flight.records, **left})
    observed, observations = _OBSERVED.get(sensor), flight.observations
    if observed is None or observations is None:
        return None
    inside = _inside(observations.t_s, spans)
    if inside.mean() > _THROUGHOUT:
        return None
    values = getattr(observations, observed).copy()
    values[inside] = np.nan
    return replace(flight, observations=replace(observations, **{observed: values}))


def _records(flight: Flight, kind: str) -> dict[str, Samples]:
    return {name: record for name, record in flight.records.items() if name.split()[0] == kind}


def _flight_without(flight: Flight, kind: str) -> Flight:
    gone = _records(flight, kind)
    return flight.with_records({n: record for n, record in flight.records.items() if n not in gone})


def _without_velocity(fixes: Fixes, spans: FloatArray) -> Fixes:
    """Return fixes whose velocities have no weight in spans."""
    sigma = fixes.velocity_sigma_mps
    if sigma is None:
        return fixes
    weightless = np.where(_inside(fixes.t_s, spans), _WEIGHTLESS, 1.0)
    return replace(fixes, velocity_sigma_mps=sigma * weightless[:, None])


def _inside(t_s: FloatArray, spans: FloatArray) -> BoolArray:
    return np.asarray(((t_s[:, None] >= spans[:, 0]) & (t_s[:, None] <= spans[:, 1])).any(axis=1))


def _rejected(verdict: Verdict) -> Rejected:
    return Rejected(
        what=verdict.sensor,
        link=verdict.sensor,
        from_s=verdict.from_s,
        until_s=verdict.until_s,
        reason=f"innovations {np.sqrt(verdict.ratio):.2g} x their sigma: left out",
    )
