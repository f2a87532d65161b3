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
from typing import Any, NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, NoSolutionError
from fgnav.types.estimate import Estimate, Rejected, Verdict
from fgnav.types.flight import Flight

_TRIALS = 2  # each takes as long as the flight
_MARGIN_S = 1.0  # blocks are a second long: what spoils one may reach into the next
_THROUGHOUT = 0.5  # share of a record
_WEIGHTLESS = 1e3  # on a standard deviation
# Fields of a flight by the name of their measurement.
INSTRUMENTS = {
    "line of sight": "seeker",
    "barometric height": "barometer",
    "magnetic field": "magnetometer",
}
_SET_UP = ("lever arm", "velocity latency")
_OBSERVED = {"velocity": "doppler_hz", "array phases": "phase_cycles", "phase": "phase_cycles"}
_OF_FIXES = ("p_n_m", "v_n_mps", "position_sigma_m", "velocity_sigma_mps")
_SAMPLES = ("t_s", "height_m", "field_b_ut", "currents", *_OF_FIXES)


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
    if all(one.sensor in _SET_UP for one in estimate.verdicts):  # of no sensor's measurements
        return estimate
    for exclusion in islice(exclusions(flight, estimate.verdicts), _TRIALS):
        try:
            trial = again(exclusion.flight)
        except NoSolutionError:
            continue
        is_as_open = set(trial.unobservable) <= set(estimate.unobservable)
        if trial.consistent and trial.converged and is_as_open and _is_determined(trial):
            notes = tuple(
                f"{one.what}, {one.from_s:.1f} to {one.until_s:.1f} s: left out, because without "
                "it the other measurements are consistent."
                for one in exclusion.rejected
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
    worst = sorted(verdicts, key=lambda one: -one.ratio / one.limit)
    sensors = list(dict.fromkeys(one.sensor for one in worst))
    sensors.sort(key=lambda name: name not in INSTRUMENTS)
    for sensor in sensors:
        own = [one for one in verdicts if one.sensor == sensor]
        spans = np.array([[one.from_s - _MARGIN_S, one.until_s + _MARGIN_S] for one in own])
        changed = _flight_excluding(flight, sensor, spans)
        if changed is not None:
            is_gone = sensor in INSTRUMENTS and getattr(changed, INSTRUMENTS[sensor]) is None
            yield Exclusion(changed, tuple(map(_rejected, own)), tuple(own) if is_gone else ())
    for name, field in INSTRUMENTS.items():
        record = getattr(flight, field)
        if record is not None and name not in sensors and len(record.t_s):
            reason = "without it the other measurements are consistent: left out"
            span = float(record.t_s[0]), float(record.t_s[-1])
            rejected = Rejected(
                what=name, link=name, from_s=span[0], until_s=span[1], reason=reason
            )
            verdict = replace(worst[0], sensor=name, from_s=span[0], until_s=span[1])
            yield Exclusion(_with(flight, {field: None}), (rejected,), (verdict,))


def _flight_excluding(flight: Flight, sensor: str, spans: FloatArray) -> Flight | None:
    """Return a flight without a sensor's measurements in spans, (g, 2); None if none can be.

    An instrument of whose record most is concerned is left out whole; other sensors stay.
    """
    field, fixes = INSTRUMENTS.get(sensor), flight.fixes
    if fixes is not None and fixes.velocity_sigma_mps is not None and sensor == "velocity":
        inside = _inside(fixes.t_s, spans)  # positions stay: velocities without weight instead
        sigma_mps = fixes.velocity_sigma_mps * np.where(inside, _WEIGHTLESS, 1.0)[:, None]
        changed = replace(fixes, velocity_sigma_mps=sigma_mps)
        return None if inside.mean() > _THROUGHOUT else replace(flight, fixes=changed)
    if field is None and fixes is not None and sensor == "position":
        field = "fixes"
    if field is not None:
        record = getattr(flight, field)
        inside = _inside(record.t_s, spans)
        if inside.mean() > _THROUGHOUT:
            return _with(flight, {field: None}) if sensor in INSTRUMENTS else None
        values = {name: getattr(record, name, None) for name in _SAMPLES}
        kept = {name: v[~inside] for name, v in values.items() if v is not None}
        return _with(flight, {field: replace(record, **kept)})
    observed, observations = _OBSERVED.get(sensor), flight.observations
    if observed is None or observations is None:
        return None
    inside = _inside(observations.t_s, spans)
    if inside.mean() > _THROUGHOUT:
        return None
    values = getattr(observations, observed).copy()
    values[inside] = np.nan
    return replace(flight, observations=replace(observations, **{observed: values}))


def _with(flight: Flight, fields: dict[str, Any]) -> Flight:
    return replace(flight, **fields)


def _inside(t_s: FloatArray, spans: FloatArray) -> BoolArray:
    return np.asarray(((t_s[:, None] >= spans[:, 0]) & (t_s[:, None] <= spans[:, 1])).any(axis=1))


def _rejected(one: Verdict) -> Rejected:
    return Rejected(
        what=one.sensor,
        link=one.sensor,
        from_s=one.from_s,
        until_s=one.until_s,
        reason=f"innovations {np.sqrt(one.ratio):.2g} x their sigma: left out",
    )
