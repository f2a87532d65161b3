"""Flights that lack so much that few can be solved, drawn from a seed.

Each is one of ``flights.right_flight`` without two to four of the things by which it could be.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fgnav.types.flight import Flight

Taken = Callable[[Flight, np.random.Generator], tuple[Flight, str]]
_BY_EPOCH = ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")


def lacking(right: Flight, seed: int) -> tuple[Flight, str]:
    """Return a flight without what is drawn from a seed, and what that is."""
    rng = np.random.default_rng([93, seed])
    flight, texts = right, []
    for k in rng.permutation(len(_LOSSES))[: int(rng.integers(2, 5))].tolist():
        flight, text = _LOSSES[k](flight, rng)
        texts += [text] if text else []
    return flight, "; ".join(texts)


def _antennas(flight, rng):
    if len(flight.antennas) == 1:
        return flight, ""
    keep = sorted(rng.permutation(len(flight.antennas))[: int(rng.integers(1, 3))].tolist())
    seen = flight.observations
    rows = {name: getattr(seen, name)[:, keep] for name in (*_BY_EPOCH, "tag_s")}
    flight = replace(
        flight,
        antennas=tuple(flight.antennas[k] for k in keep),
        observations=replace(seen, **rows),
        truth=replace(flight.truth, integers=None),
    )
    return flight, f"antennas {[k + 1 for k in keep]} alone"


def _observable(flight, rng):
    """Lose one or two of code, phase and Doppler, or velocities."""
    if flight.observations is None:
        fixes = replace(flight.fixes, v_n_mps=None, velocity_sigma_mps=None)
        return replace(flight, fixes=fixes), "no velocities"
    names = rng.permutation(["code_m", "phase_cycles", "doppler_hz", "doppler_hz"])
    lost = set(names[: int(rng.integers(1, 3))].tolist())
    seen = flight.observations
    changes = {name: np.full_like(getattr(seen, name), np.nan) for name in sorted(lost)}
    return replace(flight, observations=replace(seen, **changes)), f"no {sorted(lost)}"


def _satellites(flight, rng):
    seen = flight.observations
    if seen is None:
        return flight, ""
    n = int(rng.integers(1, 5))
    keep = sorted(rng.permutation(len(seen.satellites))[:n].tolist())
    rows = {name: getattr(seen, name)[..., keep] for name in _BY_EPOCH}
    names = {
        name: tuple(getattr(seen, name)[k] for k in keep) for name in ("satellites", "signals")
    }
    truth = replace(flight.truth, integers=None)
    return replace(
        flight, observations=replace(seen, **rows, **names), truth=truth
    ), f"{n} channels"


def _epochs(flight, rng):
    """Keep a few epochs, or the first second or two."""
    series = "fixes" if flight.observations is None else "observations"
    have = getattr(flight, series)
    rows = np.zeros(len(have.t_s), dtype=bool)
    n = min(int(rng.integers(1, 12)), len(rows))
    first = int(rng.integers(len(rows) - n + 1))
    together = bool(rng.integers(2))
    rows[np.arange(first, first + n) if together else rng.permutation(len(rows))[:n]] = True
    text = f"{n} epochs {'in a row' if together else 'here and there'}"
    return replace(flight, **{series: have[rows]}), text


def _inertial(flight, rng):
    imu, kind = flight.imu, int(rng.integers(5))
    if imu is None:
        return flight, ""
    if kind == 0:
        return replace(flight, imu=None), "no unit"
    if kind == 1:
        n = int(rng.integers(1, 30))
        return replace(flight, imu=imu[:n]), f"{n} inertial samples"
    if kind == 2:
        by_s = float(rng.choice([-1.0, 1.0]) * 10 ** rng.uniform(0.0, 2.0))
        return replace(flight, imu=replace(imu, t_s=imu.t_s + by_s)), f"unit {by_s:+.1f} s off"
    if kind == 3:
        every = int(rng.integers(10, 60))
        return replace(flight, imu=imu[::every]), f"every {every}th inertial sample"
    return _without_gyroscope(flight), "no gyroscope"


def _without_gyroscope(flight):
    names = ("noise_radps_per_sqrt_hz", "bias_radps", "bias_walk_radps_per_sqrt_s")
    none = {f"gyroscope_{name}": None for name in names}
    return replace(flight, imu=replace(flight.imu, w_b_radps=None, **none))


def _instruments(flight, _rng):
    return replace(flight, barometer=None, magnetometer=None, seeker=None), "no instruments"


def _shape(flight, rng):
    """Place the antennas on a line, or all at one place."""
    if len(flight.antennas) == 1:
        return flight, ""
    axis, at_one = rng.normal(size=3), bool(rng.integers(2))
    places = (
        replace(one, position_b_m=np.zeros(3) if at_one else k * axis)
        for k, one in enumerate(flight.antennas)
    )
    return replace(flight, antennas=tuple(places)), "antennas at one place" if at_one else "in line"


def _duration(flight, rng):
    """Cut the whole flight."""
    until_s = float(rng.uniform(0.3, 4.0))
    changes = {}
    for name in ("imu", "fixes", "observations"):
        series = getattr(flight, name)
        if series is not None and (series.t_s < until_s).any():
            changes[name] = series[series.t_s < until_s]
    return replace(flight, **changes), f"{until_s:.1f} s"


def _silence(flight, rng):
    """Replace phases by noise, or forces by none."""
    if flight.observations is not None and rng.integers(2):
        shape = flight.observations.phase_cycles.shape
        phase = flight.observations.phase_cycles + rng.uniform(-0.5, 0.5, shape)
        seen = replace(flight.observations, phase_cycles=phase)
        return replace(flight, observations=seen), "phases of noise"
    if flight.imu is None:
        return flight, ""
    size_mps2 = 10 ** rng.uniform(-1.0, 1.0)
    force = size_mps2 * rng.normal(size=flight.imu.f_b_mps2.shape)
    return replace(
        flight, imu=replace(flight.imu, f_b_mps2=force)
    ), f"forces: noise {size_mps2:.1g}"


_LOSSES: tuple[Taken, ...] = (
    _antennas, _observable, _satellites, _epochs, _inertial, _inertial, _instruments, _shape,
    _duration, _silence,
)  # fmt: skip
