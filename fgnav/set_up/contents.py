"""What a flight holds, and what is wrong with it that shows before anything is estimated."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.frontend.gaps import GAP
from fgnav.set_up.findings import Finding, Series, SetUp
from fgnav.types.flight import Flight
from fgnav.types.observations import Observations

_SAME_PLACE_M = 1e-3
_COLLINEAR_M = 1e-2  # off the common line by less than phase can see
_FEWEST_SATELLITES = 4
_MESSAGE_REACH_S = 4 * 3600.0  # beyond, a broadcast message says little


_CONSTELLATIONS = {
    "G": "GPS",
    "R": "GLONASS",
    "E": "Galileo",
    "C": "BeiDou",
    "J": "QZSS",
    "I": "NavIC",
    "S": "SBAS",
}


def contents(flight: Flight) -> SetUp:
    """Return what a flight holds, with every finding that its data give away without estimating."""
    sensors = {
        "gnss": flight.observations,
        "imu": flight.imu,
        "fixes": flight.fixes,
        "seeker": flight.seeker,
        "barometer": flight.barometer,
        "magnetometer": flight.magnetometer,
        "truth": flight.truth,
    }
    series = {name: _series(s.t_s) for name, s in sensors.items() if s is not None and len(s.t_s)}
    findings = [*_array_findings(flight), *_gap_findings(series)]
    losses = flight.losses
    channels: dict[str, int] = {}
    if flight.observations is not None and len(flight.observations.t_s):
        seen = _seen(flight.observations)
        channels = _channels(flight.observations, seen)
        findings += _satellite_findings(flight, flight.observations, seen)
        losses += flight.observations.losses
    findings += _overlap_findings(series)
    orbits = {"broadcast": flight.broadcast, "precise": flight.precise}
    for source in (flight.broadcast, flight.precise):
        losses += source.losses if source is not None else ()
    return SetUp(
        flight=flight.name,
        antennas=tuple(antenna.name for antenna in flight.antennas),
        channels=channels,
        series=series,
        orbits=tuple(name for name, source in orbits.items() if source is not None),
        gyroscope=flight.imu is not None and flight.imu.w_b_radps is not None,
        findings=tuple(findings),
        losses=tuple(dict.fromkeys(losses)),
    )


def _series(t_s: FloatArray) -> Series:
    steps_s = np.diff(t_s)
    interval_s = float(np.median(steps_s)) if len(steps_s) else 0.0
    gaps = steps_s > GAP * interval_s
    return Series(
        samples=len(t_s),
        first_s=float(t_s[0]),
        last_s=float(t_s[-1]),
        rate_hz=1.0 / interval_s if interval_s else 0.0,
        gaps=int(gaps.sum()),
        longest_gap_s=float(steps_s[gaps].max()) if gaps.any() else 0.0,
    )


def _seen(observations: Observations) -> BoolArray:
    """Return which channels were tracked at least once by some antenna, (m,)."""
    return np.asarray(observations.tracked.any(axis=(0, 1)))


def _channels(observations: Observations, seen: BoolArray) -> dict[str, int]:
    names = [
        f"{_CONSTELLATIONS.get(satellite[0], satellite[0])} {signal}"
        for satellite, signal, here in zip(
            observations.satellites, observations.signals, seen, strict=True
        )
        if here
    ]
    return {name: names.count(name) for name in dict.fromkeys(names)}


def _array_findings(flight: Flight) -> list[Finding]:
    """Return what the places of the antennas leave open."""
    names = [antenna.name for antenna in flight.antennas]
    if not names:
        return []
    if len(names) == 1:
        if flight.observations is None:  # a receiver's fixes have no phase to lose
            return []
        return [
            Finding(
                name="single antenna",
                text="no baseline, so carrier phase says nothing of the attitude",
            )
        ]
    places_b_m = np.stack([antenna.position_b_m for antenna in flight.antennas])
    apart_m = np.linalg.norm(places_b_m[:, None] - places_b_m[None], axis=2)
    findings = [
        Finding(
            name="duplicate antennas",
            text=f"{names[i]} and {names[j]} are {1e3 * apart_m[i, j]:.1f} mm apart; "
            "check position_b_m",
        )
        for i, j in zip(*np.nonzero(np.triu(apart_m < _SAME_PLACE_M, k=1)), strict=True)
    ]
    _, sizes, axes = np.linalg.svd(places_b_m - places_b_m.mean(axis=0))
    spread_m = np.append(sizes, np.zeros(3))[:2]
    if spread_m[0] > _SAME_PLACE_M and spread_m[1] < _COLLINEAR_M:
        from fgnav.attitude.array import axis_name  # noqa: PLC0415  # lazy: brings numba

        findings.append(
            Finding(
                name="collinear antennas",
                text=f"all on one line, so phase leaves unobservable: {axis_name(axes[:1])}",
            )
        )
    return findings


def _gap_findings(series: dict[str, Series]) -> list[Finding]:
    return [
        Finding(
            name=f"{name} gaps",
            text=f"steps longer than {GAP:g} intervals: {s.gaps}, longest {s.longest_gap_s:.3f} s",
        )
        for name, s in series.items()
        if s.gaps and name != "seeker"  # a seeker is blind most of the time
    ]


def _satellite_findings(
    flight: Flight, observations: Observations, seen: BoolArray
) -> list[Finding]:
    """Return what the satellites lack: numbers, and orbits."""
    names = np.array(observations.satellites)
    satellites = sorted(set(names[seen].tolist()))
    findings = []
    without = [s for s in satellites if s not in _known(flight, observations.t_s)]
    if flight.precise is None:  # messages of GLONASS are not read
        without = [s for s in without if s[0] != "R"]
    for letter in dict.fromkeys(s[0] for s in without):
        mine = [s for s in without if s[0] == letter]
        findings.append(
            Finding(
                name=f"no orbits for {_CONSTELLATIONS.get(letter, letter)}",
                text=f"tracked, but without an orbit at that time: {' '.join(mine)}",
            )
        )
    usable = observations.tracked[:, 0] & ~np.isin(names, without)
    distinct = np.stack([usable[:, names == s].any(axis=1) for s in satellites or [""]], axis=1)
    few = int((distinct.sum(axis=1) < _FEWEST_SATELLITES).sum())
    if few:
        findings.append(
            Finding(
                name="few satellites",
                text=f"{few} of {len(distinct)} epochs have fewer than {_FEWEST_SATELLITES} "
                "satellites with orbits at the reference antenna",
            )
        )
    return findings


def _known(flight: Flight, t_s: FloatArray) -> set[str]:
    """Return the satellites with an orbit somewhere near the flight's time."""
    with_orbits: set[str] = set()
    if flight.precise is not None:
        near = _near(flight.precise.t_s, t_s)
        _, placed = np.nonzero(np.isfinite(flight.precise.p_e_m[near]).all(axis=2))
        with_orbits |= {flight.precise.satellites[s] for s in set(placed.tolist())}
    if flight.broadcast is not None:
        records = flight.broadcast.records
        with_orbits |= set(records["satellite"][_near(records["toe_s"], t_s)].tolist())
    return with_orbits


def _near(orbit_s: FloatArray, t_s: FloatArray) -> BoolArray:
    earliest_s, latest_s = t_s[0] - _MESSAGE_REACH_S, t_s[-1] + _MESSAGE_REACH_S
    return np.asarray((orbit_s >= earliest_s) & (orbit_s <= latest_s))


def _overlap_findings(series: dict[str, Series]) -> list[Finding]:
    """Return sensors that do not share the time of the GNSS epochs."""
    main = series.get("gnss") or series.get("fixes")
    if main is None:
        return []
    return [
        Finding(
            name=f"{name} at another time",
            text=f"{s.first_s:.3f} to {s.last_s:.3f} s, GNSS {main.first_s:.3f} to "
            f"{main.last_s:.3f} s; check start and t_s",
        )
        for name, s in series.items()
        if s.last_s < main.first_s or s.first_s > main.last_s
    ]
