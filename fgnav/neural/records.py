"""Samples of a network's sensors: of a flight, of a stream so far, or given beside it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, FloatArray, NoSolutionError, freeze, freeze_times
from fgnav.gnss.single_point.solution import code_solution
from fgnav.neural.measures import SENSORS
from fgnav.types.flight import Flight

_RATE_OFF = 0.02  # of the rate: resampled signals have another noise than training saw


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Record:
    """Samples of a sensor.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
        Strictly increasing, on the flight's clock.
    values : ndarray, shape (n, c)
    unit, frame : str
    """

    t_s: FloatArray
    values: FloatArray
    unit: str
    frame: str

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        freeze("record", self, {"values": (freeze_times("record", self), None)})

    def after(self, t_s: float) -> "Record":
        """Return the samples later than a time."""
        later = self.t_s > t_s
        return replace(self, t_s=self.t_s[later], values=self.values[later])

    def followed_by(self, other: "Record") -> "Record":
        """Return these samples and another record's that come after them."""
        new = other.after(self.t_s[-1]) if len(self.t_s) else other
        return replace(
            self,
            t_s=np.concatenate([self.t_s, new.t_s]),
            values=np.concatenate([self.values, new.values]) if len(self.t_s) else new.values,
        )


def of_flight(flight: Flight) -> dict[str, Record]:
    """Return a flight's samples of each sensor that a network may see.

    Velocities are those of the fixes, or else of the reference antenna by Doppler.
    """
    imu, fixes, records = flight.imu, flight.first_fixes, {}
    if imu is not None:
        records["accelerometer"] = _record("accelerometer", imu.t_s, imu.f_b_mps2)
        if imu.w_b_radps is not None:
            records["gyroscope"] = _record("gyroscope", imu.t_s, imu.w_b_radps)
    if flight.magnetometer is not None:
        field = flight.magnetometer
        records["magnetometer"] = _record("magnetometer", field.t_s, field.field_b_ut)
    if flight.barometer is not None:
        heights = flight.barometer
        records["barometer"] = _record("barometer", heights.t_s, heights.height_m[:, None])
    if fixes is not None:
        records["position"] = _record("position", fixes.t_s, fixes.p_n_m)
        if fixes.v_n_mps is not None:
            records["velocity"] = _record("velocity", fixes.t_s, fixes.v_n_mps)
    if "velocity" not in records and flight.observations is not None:
        records |= _by_doppler(flight)
    return records


def _by_doppler(flight: Flight) -> dict[str, Record]:
    """Return the velocities of raw observations, each by what came up to it; none without any."""
    try:
        code = code_solution(flight, causal=True)
    except NoSolutionError:
        return {}
    if code.v_n_mps is None:
        return {}
    finite = np.isfinite(code.v_n_mps).all(axis=1)
    return {"velocity": _record("velocity", code.t_s[finite], code.v_n_mps[finite])}


def of_measurements(now: Any) -> dict[str, Record]:  # noqa: ANN401  # methods.stream.Measurements
    """Return the samples that came with a stream's keyframe, of each such sensor."""
    imu, t_s = now.imu, np.array([now.t_s])
    records = {"accelerometer": _record("accelerometer", imu.t_s, imu.f_b_mps2)}
    if imu.w_b_radps is not None:
        records["gyroscope"] = _record("gyroscope", imu.t_s, imu.w_b_radps)
    if now.field_b_ut is not None:
        records["magnetometer"] = _record("magnetometer", t_s, np.asarray(now.field_b_ut)[None])
    if now.height_m is not None:
        records["barometer"] = _record("barometer", t_s, np.array([[now.height_m]]))
    for name in ("position", "velocity"):
        measured = getattr(now, name)
        if measured is not None:
            records[name] = _record(name, t_s, np.asarray(measured.value)[None])
    return records


def concatenate_records(
    first: Mapping[str, Record], then: Mapping[str, Record]
) -> dict[str, Record]:
    """Return records that go on."""
    return {
        **first,
        **{k: first[k].followed_by(new) if k in first else new for k, new in then.items()},
    }


def check_rate(where: str, record: Record, rate_hz: float) -> None:
    """Raise unless samples come at the rate that a network was trained at.

    Raises
    ------
    BadInputError
        Naming both.
    """
    if len(record.t_s) < 3:
        return
    found_hz = 1 / float(np.median(np.diff(record.t_s)))
    if abs(found_hz / rate_hz - 1) > _RATE_OFF:
        raise BadInputError(
            f"{where}.rate_hz: the network sees samples at {rate_hz:g} Hz, the record has "
            f"{found_hz:.4g} Hz; train a network at that rate, or resample the record"
        )


def _record(sensor: str, t_s: FloatArray, values: FloatArray) -> Record:
    stated = SENSORS[sensor]
    return Record(t_s=t_s, values=values, unit=stated.unit, frame=stated.frame)
