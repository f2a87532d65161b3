"""Contents of a flight, and findings that its tables show without any solution."""

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from fgnav.checks import BoolArray, FloatArray, Unused
from fgnav.integrity.imu_screen import stuck_axis, stuck_run, stuck_unit
from fgnav.types.flight import Flight, Imu
from fgnav.types.observations import Observations

GAP = 1.5  # sample intervals: a longer step is a gap
SAMPLES = "[imu] samples, fx_mps2 to wz_radps"
_SAME_PLACE_M = 1e-3
_COLLINEAR_M = 1e-2  # distance from the common line that carrier phase cannot resolve
_MIN_SATELLITES = 4
_MIN_SAMPLES, _MIN_OF_INSTRUMENT = 100, 20
_MESSAGE_REACH_S = 4 * 3600.0  # validity of a broadcast message
_CONSTELLATIONS = dict(
    zip("GRECJIS", ["GPS", "GLONASS", "Galileo", "BeiDou", "QZSS", "NavIC", "SBAS"], strict=True)
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """Sampling of a sensor; rate from the median interval, gaps longer than 1.5 of these."""

    samples: int
    first_s: float
    last_s: float
    rate_hz: float
    gaps: int
    longest_gap_s: float

    def __str__(self) -> str:
        """Return number, rate and span in a line."""
        span = f"{self.first_s:.3f} to {self.last_s:.3f} s"
        return f"{self.samples} samples, {self.rate_hz:.4g} Hz, {span}"


@dataclass(frozen=True, slots=True)
class Finding:
    """A mistake: name, text with evidence, mend, place in the files.

    ``certain``: no estimate of such a flight is worth having.
    """

    name: str
    text: str
    mend: str = ""
    where: str = ""
    certain: bool = False

    def __str__(self) -> str:
        """Return one line."""
        where = f" ({self.where})" if self.where else ""
        return f"{self.name}: {self.text}{'; ' * bool(self.mend)}{self.mend}{where}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """Contents of a flight and mistakes of its set-up.

    Attributes
    ----------
    channels : dict of str to int
        Signals tracked at least once, by constellation and signal: ``{"GPS 1C": 9}``.
    series : dict of str to Series
        By sensor: ``gnss``, ``imu``, ``fixes``, ``photodetector``, ``barometer``, ``magnetometer``,
        ``truth``.
    orbits : tuple of str
        ``broadcast``, ``precise``.
    unchecked : tuple of Finding
        What the data cannot tell right from wrong, with the reason.
    unused : tuple of Unused
        What was in the files and could not be kept.
    """

    flight: str
    antennas: tuple[str, ...]
    channels: dict[str, int] = field(default_factory=dict)
    series: dict[str, Series] = field(default_factory=dict)
    orbits: tuple[str, ...] = ()
    gyroscope: bool = False
    findings: tuple[Finding, ...] = ()
    unchecked: tuple[Finding, ...] = ()
    unused: tuple[Unused, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return everything in plain types."""
        return asdict(self)


def contents(flight: Flight) -> Diagnosis:
    """Return contents of a flight, and findings that need no solution."""
    sensors = {"gnss": flight.observations, **flight.records}
    series = {name: series_of(s.t_s) for name, s in sensors.items() if s is not None and len(s.t_s)}
    findings, channels = [*_array_findings(flight), *_series_findings(series)], {}
    orbits = {"broadcast": flight.broadcast, "precise": flight.precise}
    unused = flight.unused
    if flight.observations is not None and len(flight.observations.t_s):
        is_tracked = np.asarray(flight.observations.tracked.any(axis=(0, 1)))
        channels = _channels(flight.observations, is_tracked)
        findings += _satellite_findings(flight, flight.observations, is_tracked)
        unused += flight.observations.unused
    for source in (flight.broadcast, flight.precise):
        unused += source.unused if source is not None else ()
    return Diagnosis(
        flight=flight.name,
        antennas=tuple(antenna.name for antenna in flight.antennas),
        channels=channels,
        series=series,
        orbits=tuple(name for name, source in orbits.items() if source is not None),
        gyroscope=flight.imu is not None and flight.imu.w_b_radps is not None,
        findings=tuple(findings),
        unused=tuple(dict.fromkeys(unused)),
    )


def series_of(t_s: FloatArray) -> Series:
    """Return the sampling of times, (n,), one or more."""
    steps_s = np.diff(t_s)
    interval_s = float(np.median(steps_s)) if len(steps_s) else 0.0
    gaps_s = steps_s[steps_s > GAP * interval_s]
    return Series(
        samples=len(t_s),
        first_s=float(t_s[0]),
        last_s=float(t_s[-1]),
        rate_hz=1.0 / interval_s if interval_s else 0.0,
        gaps=len(gaps_s),
        longest_gap_s=float(gaps_s.max(initial=0.0)),
    )


def _channels(observations: Observations, is_tracked: BoolArray) -> dict[str, int]:
    """Return the number of channels of each constellation and signal."""
    channels = zip(observations.satellites, observations.signals, is_tracked, strict=True)
    names = [f"{_CONSTELLATIONS.get(s[0], s[0])} {signal}" for s, signal, used in channels if used]
    return {name: names.count(name) for name in dict.fromkeys(names)}


def _array_findings(flight: Flight) -> list[Finding]:
    """Return antennas at one place, and an angle that collinear antennas leave unobservable."""
    names = [antenna.name for antenna in flight.antennas]
    if len(names) < 2:
        return []
    positions_b_m = np.stack([antenna.position_b_m for antenna in flight.antennas])
    distance_m = np.linalg.norm(positions_b_m[:, None] - positions_b_m[None], axis=2)
    findings = []
    for i, j in zip(*np.nonzero(np.triu(distance_m < _SAME_PLACE_M, k=1)), strict=True):
        text = f"{names[i]} and {names[j]} are {1e3 * distance_m[i, j]:.1f} mm apart"
        findings.append(Finding("duplicate antennas", text, "check position_b_m"))
    _, sizes, axes = np.linalg.svd(positions_b_m - positions_b_m.mean(axis=0))
    spread_m = np.append(sizes, np.zeros(3))[:2]
    is_line = spread_m[0] > _SAME_PLACE_M and spread_m[1] < _COLLINEAR_M
    if is_line and flight.observations is not None:
        from fgnav.attitude.array import axis_name  # noqa: PLC0415  # lazy: brings numba

        text = f"all on one line, so phase leaves unobservable: {axis_name(axes[:1])}"
        findings.append(Finding("collinear antennas", text))
    return findings


def _series_findings(series: dict[str, Series]) -> list[Finding]:
    """Return gaps of sensors, and sensors that do not overlap GNSS."""
    findings = []
    main = next((s for name, s in series.items() if name.startswith(("gnss", "fixes"))), None)
    for name, s in series.items():
        if s.gaps and name != "photodetector":  # which is blind most of the time
            text = f"steps longer than {GAP:g} intervals: {s.gaps}, longest {s.longest_gap_s:.3f} s"
            findings.append(Finding(f"{name} gaps", text))
        if main is not None and (s.last_s < main.first_s or s.first_s > main.last_s):
            text = (
                f"{s.first_s:.3f} to {s.last_s:.3f} s, GNSS {main.first_s:.3f} to "
                f"{main.last_s:.3f} s"
            )
            findings.append(Finding(f"{name} at another time", text, "check start and t_s"))
    return findings


def _satellite_findings(
    flight: Flight, observations: Observations, is_tracked: BoolArray
) -> list[Finding]:
    """Return satellites without orbits, and epochs with too few satellites."""
    names, findings = np.array(observations.satellites), []
    satellites = sorted(set(names[is_tracked].tolist()))
    without = sorted(set(satellites) - _satellites_with_orbits(flight, observations.t_s))
    if flight.precise is None:  # messages of GLONASS are not read
        without = [s for s in without if s[0] != "R"]
    for letter in dict.fromkeys(s[0] for s in without):
        shown = " ".join(s for s in without if s[0] == letter)
        text = f"tracked, but without an orbit at that time: {shown}"
        findings.append(Finding(f"no orbits for {_CONSTELLATIONS.get(letter, letter)}", text))
    usable = observations.tracked[:, 0] & ~np.isin(names, without)
    distinct = np.stack([usable[:, names == s].any(axis=1) for s in satellites or [""]], axis=1)
    count = int((distinct.sum(axis=1) < _MIN_SATELLITES).sum())
    if count:
        text = (
            f"{count} of {len(distinct)} epochs have fewer than {_MIN_SATELLITES} satellites "
            "with orbits at the reference antenna"
        )
        findings.append(Finding("few satellites", text))
    return findings


def _satellites_with_orbits(flight: Flight, t_s: FloatArray) -> set[str]:
    names: set[str] = set()
    first_s, last_s = t_s[0] - _MESSAGE_REACH_S, t_s[-1] + _MESSAGE_REACH_S
    if flight.precise is not None:
        orbit_s = flight.precise.t_s
        p_e_m = flight.precise.p_e_m[(orbit_s >= first_s) & (orbit_s <= last_s)]
        is_filled = np.isfinite(p_e_m).all(axis=2).any(axis=0)
        names |= set(np.array(flight.precise.satellites)[is_filled].tolist())
    if flight.broadcast is not None:
        records = flight.broadcast.records
        near = (records["toe_s"] >= first_s) & (records["toe_s"] <= last_s)
        names |= set(records["satellite"][near].tolist())
    return names


def sample_findings(imu: Imu) -> list[Finding]:
    """Return axes that are constant, all or one repeating a sample longer than chance explains."""
    t_s, findings = imu.t_s, []
    if len(t_s) < _MIN_SAMPLES:
        return []
    run = stuck_unit(imu)
    if run is not None:
        return [_stuck("imu stuck", "all axes repeat one sample", t_s, run, "[imu] samples")]
    for sensor, letters, x in (
        ("accelerometer axis", "f{}_mps2", imu.f_b_mps2),
        ("gyroscope axis", "w{}_radps", imu.w_b_radps),
    ):
        if x is None or (x == x[0]).all():  # simulated without noise, at rest
            continue
        for axis, letter in enumerate("xyz"):
            where = f"[imu] samples, {letters.format(letter)}"
            run = stuck_axis(x, axis, np.zeros(len(x), dtype=np.bool_))
            if (x[:, axis] == x[0, axis]).all():
                text = f"axis {letter} is {x[0, axis]:g} in all {len(x)} samples"
                mend = "not connected, or a filler: the flight cannot be used"
                findings.append(Finding(sensor, text, mend, where, certain=True))
            elif run is not None:
                text = f"axis {letter} repeats {x[run[0], axis]:.6g}"
                findings.append(_stuck(sensor, text, t_s, run, where))
    return findings


def instrument_findings(flight: Flight) -> list[Finding]:
    """Return instruments that repeat a sample longer than chance explains."""
    findings, series = [], {}
    if flight.barometer is not None:
        series["barometer"] = (flight.barometer.t_s, flight.barometer.height_m[:, None])
    if flight.photodetector is not None:
        visible = flight.photodetector.currents.min(axis=1) > 0
        series["photodetector"] = (
            flight.photodetector.t_s[visible],
            flight.photodetector.currents[visible],
        )
    if flight.magnetometer is not None:
        series["magnetometer"] = (flight.magnetometer.t_s, flight.magnetometer.field_b_ut)
    for name, (t_s, x) in series.items():
        run = stuck_run(x) if len(t_s) >= _MIN_OF_INSTRUMENT else None
        if run is not None:
            text, where = "one sample is repeated", f"[{name}] samples"
            findings.append(_stuck(f"{name} stuck", text, t_s, run, where))
    return findings


def _stuck(name: str, text: str, t_s: FloatArray, run: tuple[int, int], where: str) -> Finding:
    first_s, last_s = t_s[run[0]], t_s[run[0] + run[1]]
    text += f" {run[1] + 1} times from {first_s:.3f} to {last_s:.3f} s"
    return Finding(name, text, "left out of estimates, or cut these samples out", where)
