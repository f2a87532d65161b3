"""A flight without what contradicts the rest of it, over a span of time or throughout."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.identification.track.forces import NAME as FORCES
from fgnav.types.estimate import Consistency, Rejected
from fgnav.types.flight import Fixes, Flight, Imu, Seeker
from fgnav.types.observations import Observations
from fgnav.types.surroundings import Barometer, Magnetometer

_AROUND_S = 1.0  # blocks are a second long: what spoils one may reach into the next
_LONGEST = 0.5  # of an inertial record: more of it cannot be bridged
# Where in a flight instruments stand, by their measurement's name.
FIELD_OF = {
    "line of sight": "seeker",
    "barometric height": "barometer",
    "magnetic field": "magnetometer",
}
# Observations by the measurement's name.
_OBSERVED = {"velocity": "doppler_hz", "array phases": "phase_cycles", "phase": "phase_cycles"}
_Series = TypeVar("_Series", Barometer, Fixes, Imu, Magnetometer, Seeker)


class Exclusion(NamedTuple):
    """A flight, what it is without, and the same of a longer record of it."""

    flight: Flight
    rejected: tuple[Rejected, ...]
    of: Callable[[Flight], Flight]


def exclusions(flight: Flight, contradictory: tuple[Consistency, ...]) -> Iterator[Exclusion]:
    """Yield flights without one sensor's part of what contradicts the others.

    Instruments come first: one without which all others agree is at fault, for GNSS would show what
    is wrong with the inertial unit. That, whose errors all others show, is left out where any of
    them contradicts. An instrument that contradicts throughout is left out whole, and so are phases
    that contradict each other; other GNSS is not: whatever pulls a solution away from it is tried
    in its place, each instrument once.

    Parameters
    ----------
    flight : Flight
    contradictory : tuple of Consistency
        With contradictions, the worst first.
    """
    instruments = [one for one in contradictory if one.what in FIELD_OF]
    by_forces = tuple(one for one in contradictory if one.what == FORCES)
    inertial = _without_inertial(flight, by_forces or contradictory)
    if by_forces and inertial is not None:
        yield inertial
        inertial = None
    for one in instruments:
        yield of_instrument(flight, one)
    if inertial is not None and len(contradictory) > 1:
        yield inertial
    tried = {one.what for one in contradictory}
    for one in contradictory:
        if one in instruments:
            continue
        changed = _without(flight, one)
        if changed is not flight:
            yield Exclusion(changed, _rejected(one), partial(_without, one=one))
        else:
            yield from _without_instruments(flight, one, tried)
            tried |= FIELD_OF.keys()
    if inertial is not None and len(contradictory) == 1:
        yield inertial


def of_instrument(flight: Flight, one: Consistency) -> Exclusion:
    """Return a flight without what an instrument has in contradictions."""
    return Exclusion(_without(flight, one), _rejected(one), partial(_without, one=one))


def going_on(contradictory: tuple[Consistency, ...], present_s: float) -> tuple[Consistency, ...]:
    """Return contradictions that last till the present as lasting as long again.

    Those that have lasted all along last for good.
    """
    longer = []
    for one in contradictory:
        *before, last = one.contradictions
        if last.until_s >= present_s - _AROUND_S:
            again_s = np.inf if last.throughout else present_s - last.from_s
            last = replace(last, until_s=present_s + again_s)
        longer.append(replace(one, contradictions=(*before, last)))
    return tuple(longer)


def _without_instruments(flight: Flight, one: Consistency, tried: set[str]) -> Iterator[Exclusion]:
    """Yield flights without one instrument that agrees with a solution which GNSS contradicts."""
    for what, field in FIELD_OF.items():
        if what in tried or getattr(flight, field) is None:
            continue
        without = partial(_without_instrument, field=field)
        rejected = tuple(
            Rejected(
                what=what,
                link=what,
                from_s=span.from_s,
                until_s=span.until_s,
                reason=f"{one.what} contradicts it: left out",
            )
            for span in one.contradictions
        )
        yield Exclusion(without(flight), rejected, without)


def _rejected(one: Consistency) -> tuple[Rejected, ...]:
    return tuple(
        Rejected(
            what=one.what,
            link=one.what,
            from_s=span.from_s,
            until_s=span.until_s,
            reason=f"residuals {np.sqrt(span.nis):.2g} x what noise explains: left out",
        )
        for span in one.contradictions
    )


def _spans(one: Consistency) -> FloatArray:
    """Return the spans, (g, 2), with a second around them."""
    return np.array(
        [[span.from_s - _AROUND_S, span.until_s + _AROUND_S] for span in one.contradictions]
    )


def _inside(t_s: FloatArray, spans: FloatArray) -> BoolArray:
    """Return which times, (k,), lie in a span."""
    return np.asarray(((t_s[:, None] >= spans[:, 0]) & (t_s[:, None] <= spans[:, 1])).any(axis=1))


def _without(flight: Flight, one: Consistency) -> Flight:
    """Return a flight without one sensor's contradictions; as it is if nothing would be left."""
    whole, spans = one.contradictions[0].throughout, _spans(one)
    instrument = FIELD_OF.get(one.what)
    if instrument is not None:
        if whole:
            return _without_instrument(flight, instrument)
        left = _outside(getattr(flight, instrument), spans)
        return replace(flight, **{instrument: left})  # type: ignore[arg-type]  # of its own type
    if whole and one.what != "phase":
        return flight
    if one.what in ("position", "velocity") and flight.observations is None:
        return replace(flight, fixes=_outside(flight.fixes, spans))
    field = _OBSERVED.get(one.what)
    if field is None or flight.observations is None:
        return flight
    return _unobserved(flight, flight.observations, field, spans)


def _without_instrument(flight: Flight, field: str) -> Flight:
    return replace(flight, **{field: None})  # type: ignore[arg-type]  # each may be absent


def _without_samples(flight: Flight, spans: FloatArray) -> Flight:
    return replace(flight, imu=_outside(flight.imu, spans))


def _outside(series: _Series | None, spans: FloatArray) -> _Series | None:
    """Return the samples outside of spans."""
    if series is None:
        return None
    keep, k = ~_inside(series.t_s, spans), len(series.t_s)
    arrays = {
        name: value[keep]
        for name in series.__slots__
        if isinstance(value := getattr(series, name), np.ndarray)
        and len(value) == k
        and name not in ("calibration", "position_b_m", "landmark_n_m", "field_n_ut")
    }
    return replace(series, **arrays)  # type: ignore[arg-type]  # arrays of its own


def _unobserved(
    flight: Flight, observations: Observations, field: str, spans: FloatArray
) -> Flight:
    """Return a flight without one kind of observation in spans."""
    values = getattr(observations, field).copy()
    values[_inside(observations.t_s, spans)] = np.nan
    return replace(flight, observations=replace(observations, **{field: values}))


def _without_inertial(flight: Flight, contradictory: tuple[Consistency, ...]) -> Exclusion | None:
    """Return a flight without inertial samples wherever a sensor contradicts."""
    imu = flight.imu
    if imu is None:
        return None
    spans = np.concatenate([_spans(one) for one in contradictory])
    inside = _inside(imu.t_s, spans)
    if inside.mean() > _LONGEST:
        return None
    verb = "contradict" if len(contradictory) > 1 else "contradicts"
    reason = f"{', '.join(one.what for one in contradictory)} {verb} it: left out and bridged"
    without = partial(_without_samples, spans=spans)
    return Exclusion(
        without(flight),
        tuple(
            Rejected(
                what="inertial samples",
                link="imu",
                from_s=float(begin_s),
                until_s=float(end_s),
                reason=reason,
            )
            for begin_s, end_s in _merged(spans)
        ),
        without,
    )


def _merged(spans: FloatArray) -> list[FloatArray]:
    """Return spans, (g, 2), those that overlap as one."""
    merged: list[FloatArray] = []
    for span in spans[np.argsort(spans[:, 0])]:
        if merged and span[0] <= merged[-1][1]:
            merged[-1] = np.array([merged[-1][0], max(span[1], merged[-1][1])])
        else:
            merged.append(span)
    return merged
