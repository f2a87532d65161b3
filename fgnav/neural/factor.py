"""A network as a source of factors: windows that end at keyframes, outputs, their correlation."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray, Loss, losses_of, positive
from fgnav.graph.correlation import inflation, interval_s
from fgnav.graph.custom import NamedFactor
from fgnav.graph.keys import Timeline
from fgnav.graph.sourced import Sourced
from fgnav.graph.types.constants import FlightConstant, flight_constant
from fgnav.gravity import GravityDirection
from fgnav.messages import note
from fgnav.neural.measures import SENSORS
from fgnav.neural.network import load_network
from fgnav.neural.outputs import Counted, factor_of
from fgnav.neural.records import Record, check_rate, concatenate_records, of_flight, of_measurements
from fgnav.neural.windows import Windows, windows
from fgnav.types.flight import Flight

_AT_ONCE = 2000  # keyframes: 50 MB of a second of six channels at 200 Hz, in double precision
_SAME = 1e-6  # of an interval: times of keyframes are rounded
_USED_TWICE = ("magnetometer", "barometer", "position", "velocity")


class NeuralFactor:
    """A network that measures, as a source of factors for smoothers and streams.

    Windows end at keyframes and hold nothing later. An answer leaves, and is counted, where a
    sample is missing or outside of the training domain, or within an interval of another answer
    (``neural.correlation``). A stream needs a ``NeuralFactor`` of its own: it keeps the newest
    samples.

    Parameters
    ----------
    manifest : Path or str
        TOML or JSON, the ONNX file beside it.
    records : mapping of str to Record, optional
        Of sensors that the flight does not have, or in place of those it has.
    interval_s : float, optional
        Between answers; two half-lives of their errors by default, all of independent ones.

    Raises
    ------
    BadInputError
        If manifest or network break the contract, in one line.

    Examples
    --------
    >>> import fgnav
    >>> try:
    ...     fgnav.NeuralFactor("heading.toml")
    ... except fgnav.BadInputError as error:
    ...     print(error)
    heading.toml: no such file; check the name
    """

    def __init__(
        self,
        manifest: Path | str,
        *,
        records: Mapping[str, Record] | None = None,
        interval_s: float | None = None,
    ) -> None:
        if interval_s is not None:
            positive("neural factor interval_s", interval_s)
        self._path, self._given, self._interval_s = Path(manifest), dict(records or {}), interval_s
        self._network = load_network(self._path)
        self._so_far: dict[str, Record] = {}
        self._last_s = -np.inf
        for name, record in self._given.items():
            self._check(name, record)

    def __reduce__(self) -> Any:  # noqa: ANN401  # pickle's own form: sessions cannot be copied
        """Return how to make another in a process of its own."""
        again = partial(NeuralFactor, records=self._given, interval_s=self._interval_s)
        return again, (self._path,)

    @property
    def name(self) -> str:
        """What reports call it."""
        return self._network.manifest.name

    @property
    def manifest(self) -> Path:
        """Where the network is stated."""
        return self._path

    @property
    def between_s(self) -> float:
        """The shortest time between answers."""
        half_life_s = self._network.manifest.output.half_life_s
        return interval_s(half_life_s) if self._interval_s is None else self._interval_s

    @property
    def constants(self) -> tuple[FlightConstant, ...]:
        """What of its errors lasts as long as a flight, in 1-sigmas; none of most."""
        output = self._network.manifest.output
        if not output.lasting:
            return ()
        axes = tuple(f"axis {i + 1}" for i in range(output.measure.freedom))
        name = f"lasting error of {self.name}"
        return (flight_constant(name, axes, "", 1.0, reported=False),)

    def refusal(self, flight: Flight) -> str | None:
        """Return why a flight cannot be asked: a record is missing, or comes at another rate."""
        try:
            self._records({**of_flight(flight), **self._given}, flight.name)
        except BadInputError as error:
            return str(error)
        return None

    def add(self, sensor: str, record: Record) -> None:
        """Take samples of a sensor that a stream's measurements do not have, as they come."""
        self._check(sensor, record)
        self._given = concatenate_records(self._given, {sensor: record})

    def __call__(self, flight: Any, timeline: Timeline) -> Sourced:  # noqa: ANN401  # or Measurements
        """Return the factors of a flight's keyframes, or of a stream's newest.

        Raises
        ------
        BadInputError
            If a sensor is not there or comes at another rate, or an output breaks the contract.
        """
        if isinstance(flight, Flight):
            have = {**of_flight(flight), **self._given}
            self._last_s = -np.inf
            return self._answered(have, timeline, self._notes(flight), flight.name)
        if timeline.new == 0:
            self._so_far, self._last_s = {}, -np.inf
        self._so_far = concatenate_records(self._so_far, of_measurements(flight))
        longest_s = max((one.window + 1) / one.rate_hz for one in self._network.manifest.inputs)
        kept_s = float(timeline.t_s[-1]) - 2 * longest_s
        self._so_far = {k: v.after(kept_s) for k, v in self._so_far.items()}
        return self._answered({**self._so_far, **self._given}, timeline, ())

    def directions(self, flight: Flight, t_s: FloatArray) -> GravityDirection | None:
        """Return answers at times of a flight, each by itself; None of one that measures no such.

        Raises
        ------
        BadInputError
            As of a call.
        """
        manifest = self._network.manifest
        if manifest.output.measures != "direction":
            return None
        records = self._records({**of_flight(flight), **self._given}, flight.name) or []
        seen = windows(manifest.inputs, records, t_s)
        lost = {reason: int(rows.sum()) for reason, rows in seen.lost.items()}
        inside = self._within_domain(seen, np.flatnonzero(seen.usable), lost)
        answers = self._network([x[inside] for x in seen.inputs])
        return GravityDirection(
            t_s=t_s[inside],
            g_b=answers.value.reshape(-1, 3),
            covariance=answers.covariance.reshape(-1, 3, 3),
            losses=self._losses(lost),
        )

    def _check(self, sensor: str, record: Record) -> None:
        """Raise where a record given beside the flight is not what the network sees."""
        for row, one in enumerate(self._network.manifest.inputs):
            if one.sensor != sensor:
                continue
            where = f"{self._path}: key inputs[{row}]"
            for key, stated, found in (
                ("unit", one.unit, record.unit),
                ("frame", one.frame, record.frame),
                ("range", len(one.range), record.values.shape[1]),
            ):
                if stated != found:
                    raise BadInputError(
                        f"{where}.{key}: the network sees {stated} of {sensor!r}, the record "
                        f"has {found}; convert the record"
                        if key != "range"
                        else f"{where}.range: the network sees {stated} channels of {sensor!r}, "
                        f"the record has {found}; give it those"
                    )
            check_rate(where, record, one.rate_hz)

    def _notes(self, flight: Flight) -> tuple[str, ...]:
        """Return which of the flight's measurements both the network and the graph use."""
        twice = [
            one.sensor
            for one in self._network.manifest.inputs
            if one.sensor in _USED_TWICE
            and one.sensor not in self._given
            and one.sensor in of_flight(flight)
        ]
        return tuple(
            note("W406", network=self.name, sensor=sensor) for sensor in dict.fromkeys(twice)
        )

    def _records(self, have: Mapping[str, Record], flight: str | None) -> list[Record] | None:
        found = []
        for row, one in enumerate(self._network.manifest.inputs):
            where = f"{self._path}: key inputs[{row}]"
            if one.sensor not in have:
                if flight is None:  # of a stream it may come yet
                    return None
                known = "" if one.sensor in SENSORS else f"; known are {', '.join(SENSORS)}"
                raise BadInputError(
                    f"{where}.sensor: flight {flight} has no {one.sensor!r}{known}; give it by "
                    "NeuralFactor(..., records=...)"
                )
            check_rate(where, have[one.sensor], one.rate_hz)
            found.append(have[one.sensor])
        return found

    def _answered(
        self,
        have: Mapping[str, Record],
        timeline: Timeline,
        notes: tuple[str, ...],
        flight: str | None = None,
    ) -> Sourced:
        if len(timeline.constants) != len(self.constants):
            raise BadInputError(
                f"{self._path}: key output.lasting: its factors share a constant; give the source "
                "itself to the smoother or the stream, which has its key"
            )
        records = self._records(have, flight)
        if records is None:
            return Sourced()
        factors: list[NamedFactor] = []
        lost: dict[str, int] = {}
        t_s = timeline.t_s
        for first in range(timeline.new, len(t_s), _AT_ONCE):
            rows = np.arange(first, min(first + _AT_ONCE, len(t_s)))
            seen = windows(self._network.manifest.inputs, records, t_s[rows])
            for reason, which in seen.lost.items():
                lost[reason] = lost.get(reason, 0) + int(which.sum())
            factors += self._factors(seen, timeline, rows, lost)
        return Sourced(factors=tuple(factors), losses=self._losses(lost), notes=notes)

    def _losses(self, lost: Mapping[str, int]) -> tuple[Loss, ...]:
        return losses_of({(f"{self.name} answer", reason): n for reason, n in lost.items()})

    def _factors(
        self, seen: Windows, timeline: Timeline, rows: IntArray, lost: dict[str, int]
    ) -> list[NamedFactor]:
        output, t_s = self._network.manifest.output, timeline.t_s
        usable = np.flatnonzero(seen.usable)
        from_row = np.full(len(rows), -1)
        if output.over_s is not None:
            from_row[usable] = _beginnings(t_s, t_s[rows[usable]] - output.over_s)
            reason = f"no keyframe stands {output.over_s:g} s before, where the displacement begins"
            lost[reason] = lost.get(reason, 0) + int((from_row[usable] < 0).sum())
            usable = usable[from_row[usable] >= 0]
        inside = self._within_domain(seen, usable, lost)
        chosen = self._apart(t_s[rows], inside)
        reason = f"within {self.between_s:g} s of another: their errors are alike"
        lost[reason] = lost.get(reason, 0) + len(inside) - len(chosen)
        answers = self._network([x[chosen] for x in seen.inputs])
        counted = Counted(
            inflation(output.half_life_s, self.between_s), output.lasting, *timeline.constants
        )
        return [
            factor_of(
                self.name,
                output,
                (int(from_row[i]), int(rows[i])),
                answers.value[j],
                answers.covariance[j],
                counted,
            )
            for j, i in enumerate(chosen)
        ]

    def _within_domain(self, seen: Windows, usable: IntArray, lost: dict[str, int]) -> IntArray:
        """Return the windows whose figures, which the graph computes, are as in training."""
        domain = self._network.manifest.domain
        if not domain:
            return usable
        figures = self._network([x[usable] for x in seen.inputs]).figures
        within = np.ones(len(usable), dtype=np.bool_)
        for one, figure in zip(domain, figures, strict=True):
            inside, reason = one.holds(figure), f"{one.beyond}, the network's training domain"
            lost[reason] = lost.get(reason, 0) + int((within & ~inside).sum())
            within &= inside
        return usable[within]

    def _apart(self, t_s: np.ndarray, usable: IntArray) -> IntArray:
        """Return those that are an interval after the last answer, or more, in order of time."""
        chosen = []
        for i in usable:  # of two thousand; each depends on the one before
            if t_s[i] - self._last_s >= self.between_s * (1 - _SAME):
                chosen.append(i)
                self._last_s = float(t_s[i])
        return np.array(chosen, dtype=np.int64)


def _beginnings(t_s: np.ndarray, at_s: np.ndarray) -> IntArray:
    """Return the keyframes at times; -1 where there is none."""
    row = np.searchsorted(t_s, at_s - 1e-3).clip(0, len(t_s) - 1)
    return np.where(np.abs(t_s[row] - at_s) < 1e-3, row, -1)
