"""A network as a source of factors: windows that end at keyframes, outputs, their correlation."""

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray, Unused, positive, unused_of
from fgnav.graph.correlation import inflation, interval_s
from fgnav.graph.custom import NamedFactor
from fgnav.graph.keys import Timeline
from fgnav.graph.sourced import Sourced
from fgnav.graph.types.parameters import Parameter, flight_constant
from fgnav.gravity import GravityDirection
from fgnav.messages import note
from fgnav.neural.measures import SENSORS
from fgnav.neural.network import Answers, Network, load_network
from fgnav.neural.outputs import Counted, factor_of
from fgnav.neural.records import Record, check_rate, concatenate_records, of_flight, of_measurements
from fgnav.neural.windows import Windows, windows
from fgnav.types.flight import Flight

_AT_ONCE = 2000  # keyframes: 50 MB of a second of six channels at 200 Hz, in double precision
_SAME = 1e-6  # of an interval: times of keyframes are rounded
_USED_TWICE = ("magnetometer", "barometer", "position", "velocity")


class Queries(NamedTuple):
    """Inputs of a network at some keyframes."""

    rows: IntArray  # (k, 2): keyframes where the answer begins, -1 but of displacements, and ends
    inputs: tuple[FloatArray, ...]  # (k, window, channels) each, in the manifest's units
    counted: Counted


class NeuralFactor:
    """A network that measures, as a source of factors for smoothers and streams.

    Windows end at keyframes and hold nothing later. An answer leaves, and is counted, where a
    sample is missing or outside of the training domain, or within an interval of another answer
    (``neural.correlation``). A stream needs a ``NeuralFactor`` of its own: it keeps the newest
    samples.

    Parameters
    ----------
    manifest : Path, str or Network
        TOML or JSON, the ONNX file beside it; or a network that is loaded.
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
        manifest: Path | str | Network,
        *,
        records: Mapping[str, Record] | None = None,
        interval_s: float | None = None,
    ) -> None:
        if interval_s is not None:
            positive("neural factor interval_s", interval_s)
        self._given, self._interval_s = dict(records or {}), interval_s
        self._loaded = isinstance(manifest, Network)
        self._network = manifest if isinstance(manifest, Network) else load_network(Path(manifest))
        self._path = self._network.path
        self._so_far: dict[str, Record] = {}
        self._last_s = -np.inf
        for name, record in self._given.items():
            self._check(name, record)

    def __reduce__(self) -> Any:  # noqa: ANN401  # pickle's own form: sessions cannot be copied
        """Return the constructor and arguments of a copy in another process."""
        again = partial(NeuralFactor, records=self._given, interval_s=self._interval_s)
        return again, (self._network if self._loaded else self._path,)

    @property
    def name(self) -> str:
        """Name in reports."""
        return self._network.manifest.name

    @property
    def network(self) -> Network:
        """The network that is asked."""
        return self._network

    @property
    def manifest(self) -> Path:
        """Path of the network's manifest."""
        return self._path

    @property
    def between_s(self) -> float:
        """The shortest time between answers."""
        half_life_s = self._network.manifest.output.half_life_s
        return interval_s(half_life_s) if self._interval_s is None else self._interval_s

    @property
    def constants(self) -> tuple[Parameter, ...]:
        """Errors that last as long as a flight, in 1-sigmas; none of most networks."""
        output = self._network.manifest.output
        if not output.lasting:
            return ()
        axes = tuple(f"axis {i + 1}" for i in range(output.measure.freedom))
        name = f"lasting error of {self.name}"
        return (flight_constant(name, axes, "", 1.0, reported=False),)

    def refusal(self, flight: Flight) -> str | None:
        """Return why a flight cannot be asked: a record is missing, or comes at another rate."""
        try:
            self.records_of(flight)
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
        longest_s = max((spec.window + 1) / spec.rate_hz for spec in self._network.manifest.inputs)
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
        if self._network.manifest.output.measures != "direction":
            return None
        inside, answers, unused = self.answers(flight, t_s)
        return GravityDirection(
            t_s=t_s[inside],
            g_b=answers.value.reshape(-1, 3),
            covariance=answers.covariance.reshape(-1, 3, 3),
            unused=unused,
        )

    def answers(
        self, flight: Flight, t_s: FloatArray
    ) -> tuple[IntArray, Answers, tuple[Unused, ...]]:
        """Return the times, (n,), with an answer, the answers, (k,), and measurements not used.

        Raises
        ------
        BadInputError
            As of a call.
        """
        samples = windows(self._network.manifest.inputs, self.records_of(flight), t_s)
        lost = {reason: int(rows.sum()) for reason, rows in samples.lost.items()}
        inside = self._within_domain(samples, np.flatnonzero(samples.usable), lost)
        return inside, self._network([x[inside] for x in samples.inputs]), self._unused(lost)

    def records_of(self, flight: Flight) -> list[Record]:
        """Return the network's inputs of a flight; errors as of a call."""
        return self._records({**of_flight(flight), **self._given}, flight.name) or []

    def _check(self, sensor: str, record: Record) -> None:
        """Raise where a record given beside the flight is not what the network sees."""
        for index, spec in enumerate(self._network.manifest.inputs):
            if spec.sensor != sensor:
                continue
            where = f"{self._path}: key inputs[{index}]"
            for key, stated, actual in (
                ("unit", spec.unit, record.unit),
                ("frame", spec.frame, record.frame),
                ("range", len(spec.range), record.values.shape[1]),
            ):
                if stated != actual:
                    raise BadInputError(
                        f"{where}.{key}: the network sees {stated} of {sensor!r}, the record "
                        f"has {actual}; convert the record"
                        if key != "range"
                        else f"{where}.range: the network sees {stated} channels of {sensor!r}, "
                        f"the record has {actual}; give it those"
                    )
            check_rate(where, record, spec.rate_hz)

    def _notes(self, flight: Flight) -> tuple[str, ...]:
        """Return notes on measurements that both the network and the graph use."""
        twice = [
            spec.sensor
            for spec in self._network.manifest.inputs
            if spec.sensor in _USED_TWICE
            and spec.sensor not in self._given
            and spec.sensor in of_flight(flight)
        ]
        return tuple(
            note("W406", network=self.name, sensor=sensor) for sensor in dict.fromkeys(twice)
        )

    def _records(self, have: Mapping[str, Record], flight: str | None) -> list[Record] | None:
        records = []
        for index, spec in enumerate(self._network.manifest.inputs):
            where = f"{self._path}: key inputs[{index}]"
            if spec.sensor not in have:
                if flight is None:  # of a stream it may come yet
                    return None
                choices = "" if spec.sensor in SENSORS else f"; known are {', '.join(SENSORS)}"
                raise BadInputError(
                    f"{where}.sensor: flight {flight} has no {spec.sensor!r}{choices}; give it by "
                    "NeuralFactor(..., records=...)"
                )
            check_rate(where, have[spec.sensor], spec.rate_hz)
            records.append(have[spec.sensor])
        return records

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
        lost: dict[str, int] = {}
        factors = [
            factor
            for queries in self._queries(have, timeline, lost, flight)
            for factor in self.factors_of(queries, self._network(queries.inputs))
        ]
        return Sourced(factors=tuple(factors), unused=self._unused(lost), notes=notes)

    def queries(self, flight: Flight, timeline: Timeline) -> list[Queries]:
        """Return the network's inputs at a flight's keyframes; errors as of a call."""
        self._last_s = -np.inf
        have = {**of_flight(flight), **self._given}
        return list(self._queries(have, timeline, {}, flight.name))

    def factors_of(self, queries: Queries, answers: Answers) -> list[NamedFactor]:
        """Return the factors of answers."""
        output = self._network.manifest.output
        return [
            factor_of(self.name, output, (first, last), value, covariance, queries.counted)
            for (first, last), value, covariance in zip(
                queries.rows.tolist(), answers.value, answers.covariance, strict=True
            )
        ]

    def _queries(
        self,
        have: Mapping[str, Record],
        timeline: Timeline,
        lost: dict[str, int],
        flight: str | None,
    ) -> Iterator[Queries]:
        """Yield what the network is asked, so many keyframes at once; count what it is not."""
        records, t_s = self._records(have, flight), timeline.t_s
        output = self._network.manifest.output
        counted = Counted(
            inflation(output.half_life_s, self.between_s), output.lasting, *timeline.constants
        )
        for first in range(timeline.new, len(t_s) if records is not None else 0, _AT_ONCE):
            rows = np.arange(first, min(first + _AT_ONCE, len(t_s)))
            samples = windows(self._network.manifest.inputs, records or [], t_s[rows])
            for reason, mask in samples.lost.items():
                lost[reason] = lost.get(reason, 0) + int(mask.sum())
            chosen, begin = self._chosen(samples, t_s, rows, lost)
            both = np.stack([begin[chosen], rows[chosen]], axis=1)
            yield Queries(both, tuple(x[chosen] for x in samples.inputs), counted)

    def _unused(self, lost: Mapping[str, int]) -> tuple[Unused, ...]:
        return unused_of({(f"{self.name} answer", reason): n for reason, n in lost.items()})

    def _chosen(
        self, windows: Windows, t_s: FloatArray, rows: IntArray, lost: dict[str, int]
    ) -> tuple[IntArray, IntArray]:
        """Select the windows that are answered, and where displacements begin, (k,), or -1."""
        output = self._network.manifest.output
        usable, begin = np.flatnonzero(windows.usable), np.full(len(rows), -1)
        if output.over_s is not None:
            begin[usable] = _beginnings(t_s, t_s[rows[usable]] - output.over_s)
            reason = f"no keyframe stands {output.over_s:g} s before, where the displacement begins"
            lost[reason] = lost.get(reason, 0) + int((begin[usable] < 0).sum())
            usable = usable[begin[usable] >= 0]
        inside = self._within_domain(windows, usable, lost)
        chosen = self._apart(t_s[rows], inside)
        reason = f"within {self.between_s:g} s of another: their errors are alike"
        lost[reason] = lost.get(reason, 0) + len(inside) - len(chosen)
        return chosen, begin

    def _within_domain(self, windows: Windows, usable: IntArray, lost: dict[str, int]) -> IntArray:
        """Return the windows whose figures, which the graph computes, are as in training."""
        domain = self._network.manifest.domain
        if not domain:
            return usable
        figures = self._network([x[usable] for x in windows.inputs]).figures
        within = np.ones(len(usable), dtype=np.bool_)
        for statistic, figure in zip(domain, figures, strict=True):
            inside, reason = (
                statistic.holds(figure),
                f"{statistic.beyond}, the network's training domain",
            )
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
    k = np.searchsorted(t_s, at_s - 1e-3).clip(0, len(t_s) - 1)
    return np.where(np.abs(t_s[k] - at_s) < 1e-3, k, -1)
