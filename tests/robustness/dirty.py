"""Dirty series drawn from a seed: a right flight of 12 s, and one fault of one of its sensors.

Values are well-formed, and wrong: by which sensor, axis, when and by how much is drawn.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from fgnav.geometry import rotations
from fgnav.types.flight import Flight
from fgnav_sim.motion import Motion, Sine
from fgnav_sim.scenario import FixesTable, load_scenario
from fgnav_sim.simulate import simulate

SCENARIOS = Path(__file__).resolve().parents[2] / "sim" / "fgnav_sim" / "scenarios"
DURATION_S, RATE_HZ = 12.0, 50.0
ANTENNAS_B_M = ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.1), (0.3, -0.8, 0.0))
_KNOT, _FOOT, _DEGREE, _G = 1.943844, 3.28084, 57.29578, 9.80665
Change = Callable[[Flight, np.random.Generator], tuple[Flight, str]]


class Dirty(NamedTuple):
    """A flight with a fault, the same without, and what was done."""

    right: Flight
    flight: Flight
    name: str


def dirty(right: Flight, seed: int) -> Dirty:
    """Return a flight with a fault that is drawn from a seed, of a sensor that it has."""
    rng = np.random.default_rng([91, seed])
    faults = [one for sensor, of in FAULTS.items() if _has(right, sensor) for one in of]
    flight, text = faults[int(rng.integers(len(faults)))](right, rng)
    return Dirty(right, flight, text)


def right_flight(kind: str, seed: int) -> Flight:
    """Return a flight of a kind of ``KINDS``, its path, its swings and all its noise drawn."""
    rng = np.random.default_rng([92, seed])
    demo, surroundings, terminal = (
        load_scenario(SCENARIOS / f"{name}.toml") for name in ("demo", "surroundings", "terminal")
    )
    change = msgspec.structs.replace
    swing = {"amplitude_deg": rng.uniform(8.0, 25.0)}
    motion = Motion(
        path=_Weave(rng),  # type: ignore[arg-type]  # a path as any other
        roll=Sine(**swing),
        pitch=Sine(**swing, phase_deg=rng.uniform(0, 180)),
        yaw=Sine(**swing, phase_deg=rng.uniform(0, 180)),
    )
    accelerometer = change(demo.imu, rate_hz=RATE_HZ)
    both = change(surroundings.imu, rate_hz=RATE_HZ)
    base = change(demo, duration_s=DURATION_S, motion=motion, imu=accelerometer)
    one = ((0.3, 0.0, -0.2),)
    gnss = change(demo.gnss, rate_hz=5.0)
    scenario = {
        "array": change(base, antennas_b_m=ANTENNAS_B_M, gnss=gnss),
        "fixes": change(
            base, antennas_b_m=one, gnss=None, fixes=FixesTable(rate_hz=5.0), imu=both
        ),
        "instruments": change(
            base, antennas_b_m=one, gnss=None, fixes=FixesTable(rate_hz=5.0), imu=both,
            barometer=surroundings.barometer, magnetometer=surroundings.magnetometer,
        ),
        "raw": change(base, antennas_b_m=one, gnss=gnss, imu=both),
        "seeker": change(
            terminal, duration_s=DURATION_S, antennas_b_m=ANTENNAS_B_M, gnss=gnss,
            imu=accelerometer, seeker=change(terminal.seeker, range_m=2e4),
        ),
    }[kind]  # fmt: skip
    return simulate(scenario, rng)


class _Weave:
    """A path that weaves in all three directions: in a steady turn no clock can be told."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.speed_mps = rng.uniform(20.0, 100.0)
        self.size_mps2, self.rate_radps = rng.uniform(1.0, 6.0, 3), rng.uniform(0.5, 1.2, 3)
        self.phase_rad = rng.uniform(0.0, 2 * np.pi, 3)

    def __call__(self, t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return displacement, velocity and acceleration, (n, 3) each."""
        at = self.rate_radps * t_s[:, None] + self.phase_rad
        a_n_mps2 = self.size_mps2 * np.sin(at)
        v_n_mps = -self.size_mps2 / self.rate_radps * np.cos(at)
        ahead = np.array([self.speed_mps, 0.0, 0.0])
        p_n_m = -a_n_mps2 / self.rate_radps**2
        return p_n_m - p_n_m[0] + ahead * t_s[:, None], v_n_mps + ahead, a_n_mps2


KINDS = ("array", "fixes", "instruments", "raw", "seeker")


def _has(flight: Flight, sensor: str) -> bool:
    if sensor == "gyroscope":
        return flight.imu is not None and flight.imu.w_b_radps is not None
    if sensor == "array":
        return len(flight.antennas) > 1
    return getattr(flight, sensor) is not None


def _span(t_s: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, str]:
    """Return which samples a fault strikes: all, those from some time on, or some seconds."""
    kind, from_s = int(rng.integers(3)), rng.uniform(2.0, 0.7 * DURATION_S)
    until_s = from_s + rng.uniform(1.0, 6.0)
    if kind == 0:
        return np.ones(len(t_s), dtype=bool), "throughout"
    if kind == 1:
        return t_s >= from_s, f"from {from_s:.1f} s"
    return (t_s >= from_s) & (t_s < until_s), f"{from_s:.1f} to {until_s:.1f} s"


def _choice(rng: np.random.Generator, options):
    return options[int(rng.integers(len(options)))]


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _turn(rng: np.random.Generator, angle_rad: float) -> np.ndarray:
    axis = rng.normal(size=3)
    return rotations.exp((axis / np.linalg.norm(axis) * angle_rad)[None])[0]


# Faults of triads: accelerometer, gyroscope, magnetometer. Sizes are factors of what it senses.


def _scaled(x, t_s, rng):
    by = _choice(rng, (0.5, 0.8, 0.9, 1.1, 1.25, 2.0, _DEGREE, 1 / _DEGREE, _G, 1 / _G, 1e3, 1e-3))
    inside, when = _span(t_s, rng)
    out = x.copy()
    out[inside] *= by
    return out, f"x {by:.4g} {when}"


def _axis_scaled(x, t_s, rng):
    axis, by = int(rng.integers(3)), _choice(rng, (-1.0, 0.0, 0.5, 0.8, 1.25, 2.0))
    inside, when = _span(t_s, rng)
    out = x.copy()
    out[inside, axis] *= by
    return out, f"axis {axis} x {by:g} {when}"


def _axis_stuck(x, t_s, rng):
    axis = int(rng.integers(3))
    inside, when = _span(t_s, rng)
    out = x.copy()
    out[inside, axis] = x[np.argmax(inside), axis]
    return out, f"axis {axis} stuck {when}"


def _exchanged(x, t_s, rng):
    order = _choice(rng, ((1, 0, 2), (0, 2, 1), (2, 1, 0), (1, 2, 0), (2, 0, 1)))
    inside, when = _span(t_s, rng)
    out = x.copy()
    out[inside] = x[inside][:, order]
    return out, f"axes {order} {when}"


def _turned(x, t_s, rng):
    angle_deg = _choice(rng, (3.0, 10.0, 30.0, 90.0))
    inside, when = _span(t_s, rng)
    out = x.copy()
    out[inside] = x[inside] @ _turn(rng, np.radians(angle_deg))
    return out, f"turned by {angle_deg:g} deg {when}"


def _stepped(x, t_s, rng):
    size = 10 ** rng.uniform(-1.5, 0.3) * np.abs(x).max()
    inside, when = _span(t_s, rng)
    axis = rng.normal(size=3)
    return x + inside[:, None] * size * axis / np.linalg.norm(axis), f"+ {size:.2g} {when}"


def _drifting(x, t_s, rng):
    size = 10 ** rng.uniform(-1.5, 0.3) * np.abs(x).max()
    axis = int(rng.integers(3))
    out = x.copy()
    out[:, axis] += size * (t_s - t_s[0]) / (t_s[-1] - t_s[0])
    return out, f"axis {axis} drifts to {size:.2g}"


def _clipped(x, _t_s, rng):
    at = rng.uniform(0.3, 0.9) * np.abs(x).max()
    return np.clip(x, -at, at), f"cut at {at:.2g}"


def _coarse(x, _t_s, rng):
    step = 10 ** rng.uniform(-2.0, -0.3) * np.abs(x).max()
    return np.round(x / step) * step, f"in steps of {step:.2g}"


def _loud(x, t_s, rng):
    size = 10 ** rng.uniform(-2.0, 0.0) * np.abs(x).max()
    inside, when = _span(t_s, rng)
    return x + inside[:, None] * size * rng.normal(size=x.shape), f"noise {size:.2g} {when}"


def _odd_samples(x, _t_s, rng):
    share, size = 10 ** rng.uniform(-3.0, -1.0), 10 ** rng.uniform(0.0, 2.0) * np.abs(x).max()
    out, at = x.copy(), rng.random(x.shape) < share
    out[at] += size * rng.choice([-1.0, 1.0], at.sum())
    return out, f"share {share:.2g} off by {size:.2g}"


def _held(x, _t_s, rng):
    every = int(rng.integers(3, 20))
    return x[np.arange(len(x)) // every * every], f"every {every}th sample, held"


def _lagging(x, t_s, rng):
    tau_s = 10 ** rng.uniform(-2.0, -0.3)
    share = 1 - np.exp(-np.median(np.diff(t_s)) / tau_s)
    out = x.copy()
    for k in range(1, len(x)):
        out[k] = out[k - 1] + share * (x[k] - out[k - 1])
    return out, f"low pass of {tau_s:.2g} s"


TRIAD = (
    _scaled, _axis_scaled, _axis_stuck, _exchanged, _turned, _stepped, _drifting, _clipped, _coarse,
    _loud, _odd_samples, _held, _lagging,
)  # fmt: skip


def _of_triad(sensor: str, field: str) -> tuple[Change, ...]:
    def made(fault) -> Change:
        def change(flight, rng):
            series = getattr(flight, sensor)
            values, text = fault(getattr(series, field), series.t_s, rng)
            changed = replace(series, **{field: values})
            return replace(flight, **{sensor: changed}), f"{field}: {fault.__name__[1:]}, {text}"

        return change

    return tuple(made(one) for one in TRIAD)


# Faults of times: any series.


def _late(t_s, rng):
    late_s = _sign(rng) * 10 ** rng.uniform(-2.5, 0.3)
    return t_s + late_s, f"tags {late_s:+.3g} s"


def _stretched(t_s, rng):
    by = _sign(rng) * 10 ** rng.uniform(-3.5, -1.5)
    return t_s[0] + (1 + by) * (t_s - t_s[0]), f"clock {by:+.2g}"


def _jumping(t_s, rng):
    late_s, from_s = 10 ** rng.uniform(-2.0, 0.3), rng.uniform(2.0, 0.7 * DURATION_S)
    return t_s + late_s * (t_s >= from_s), f"tags {late_s:+.3g} s from {from_s:.1f} s"


def _jittering(t_s, rng):
    size_s = rng.uniform(0.1, 0.45) * np.median(np.diff(t_s))
    return t_s + rng.uniform(-size_s, size_s, len(t_s)), f"tags ± {size_s:.2g} s"


def _of_times(sensor: str) -> tuple[Change, ...]:
    def made(fault) -> Change:
        def change(flight, rng):
            series = getattr(flight, sensor)
            t_s, text = fault(series.t_s, rng)
            return replace(flight, **{sensor: replace(series, t_s=t_s)}), f"{sensor}: {text}"

        return change

    return tuple(made(one) for one in (_late, _stretched, _jumping, _jittering))


def _samples_lost(flight, rng):
    """Lose samples whose tags are counted on."""
    imu, share = flight.imu, 10 ** rng.uniform(-3.0, -1.0)
    keep = rng.random(len(imu.t_s)) > share
    rest = imu[keep]
    t_s = imu.t_s[: len(rest.t_s)]
    return replace(flight, imu=replace(rest, t_s=t_s)), f"imu: share {share:.2g} lost, tags go on"


def _gravity_free(flight, _rng):
    """Give accelerations without gravity, as telephones do."""
    truth, imu = flight.truth, flight.imu
    k = np.searchsorted(truth.t_s, imu.t_s).clip(0, len(truth.t_s) - 1)
    force = imu.f_b_mps2 + np.einsum("kji,j->ki", truth.R_nb[k], [0.0, 0.0, _G])
    return replace(flight, imu=replace(imu, f_b_mps2=force)), "f_b_mps2: without gravity"


# Faults of fixes.


def _fixes(flight, text, **changes):
    return replace(flight, fixes=replace(flight.fixes, **changes)), f"fixes: {text}"


def _places_jump(flight, rng):
    size_m = 10 ** rng.uniform(0.5, 2.0)
    inside, when = _span(flight.fixes.t_s, rng)
    axis = rng.normal(size=3)
    off_m = size_m * axis / np.linalg.norm(axis)
    p_n_m = flight.fixes.p_n_m + inside[:, None] * off_m
    return _fixes(flight, f"places off by {size_m:.0f} m {when}", p_n_m=p_n_m)


def _places_drift(flight, rng):
    speed_mps, from_s = 10 ** rng.uniform(-0.5, 1.0), rng.uniform(0.0, DURATION_S / 2)
    axis = rng.normal(size=3)
    since_s = (flight.fixes.t_s - from_s).clip(0.0)[:, None]
    p_n_m = flight.fixes.p_n_m + since_s * speed_mps * axis / np.linalg.norm(axis)
    text = f"places drift by {speed_mps:.1f} m/s from {from_s:.1f} s"
    return _fixes(flight, text, p_n_m=p_n_m)


def _velocities_scaled(flight, rng):
    by = _choice(rng, (_KNOT, 1 / _KNOT, 3.6, _FOOT, 0.9, 1.1, -1.0, 0.0))
    inside, when = _span(flight.fixes.t_s, rng)
    v_n_mps = np.where(inside[:, None], by * flight.fixes.v_n_mps, flight.fixes.v_n_mps)
    return _fixes(flight, f"velocities x {by:.3g} {when}", v_n_mps=v_n_mps)


def _velocities_up(flight, _rng):
    return _fixes(flight, "vertical velocity up", v_n_mps=flight.fixes.v_n_mps * [1, 1, -1])


def _velocities_east_north(flight, _rng):
    v_n_mps = flight.fixes.v_n_mps[:, [1, 0, 2]] * [1, 1, -1]
    return _fixes(flight, "velocities east, north, up", v_n_mps=v_n_mps)


def _velocities_old(flight, rng):
    rows = int(rng.integers(1, 6))
    k = (np.arange(len(flight.fixes.t_s)) - rows).clip(0)
    return _fixes(flight, f"velocities {rows} rows old", v_n_mps=flight.fixes.v_n_mps[k])


def _fixes_frozen(flight, rng):
    fixes = flight.fixes
    inside, when = _span(fixes.t_s, rng)
    first = np.argmax(inside)
    p_n_m, v_n_mps = fixes.p_n_m.copy(), fixes.v_n_mps.copy()
    p_n_m[inside], v_n_mps[inside] = p_n_m[first], v_n_mps[first]
    return _fixes(flight, f"frozen {when}", p_n_m=p_n_m, v_n_mps=v_n_mps)


def _fixes_loud(flight, rng):
    by = 10 ** rng.uniform(0.3, 2.0)
    inside, when = _span(flight.fixes.t_s, rng)
    fixes, loud = flight.fixes, inside[:, None] * by
    p_n_m = fixes.p_n_m + loud * fixes.position_sigma_m * rng.normal(size=fixes.p_n_m.shape)
    v_n_mps = fixes.v_n_mps + loud * fixes.velocity_sigma_mps * rng.normal(size=fixes.p_n_m.shape)
    return _fixes(flight, f"noise x {by:.2g} {when}", p_n_m=p_n_m, v_n_mps=v_n_mps)


def _fixes_outlying(flight, rng):
    share, size_m = rng.uniform(0.01, 0.15), 10 ** rng.uniform(1.0, 3.0)
    at = rng.random(len(flight.fixes.t_s)) < share
    p_n_m = flight.fixes.p_n_m + at[:, None] * size_m * rng.normal(size=(len(at), 3))
    return _fixes(flight, f"share {share:.2g} off by {size_m:.0f} m", p_n_m=p_n_m)


def _fixes_jittering(flight, rng):
    """Jitter alone: estimates are in the time of the fixes, which no other says to be off."""
    t_s, text = _jittering(flight.fixes.t_s, rng)
    return _fixes(flight, text, t_s=t_s)


def _arm_wrong(flight, rng):
    size_m = 10 ** rng.uniform(-1.0, 0.7)
    axis = rng.normal(size=3)
    by = size_m * axis / np.linalg.norm(axis)
    moved = tuple(replace(one, position_b_m=one.position_b_m + by) for one in flight.antennas)
    return replace(flight, antennas=moved), f"antennas: all off by {size_m:.2g} m"


# Faults of raw observations.


def _seen(flight, text, **changes):
    seen = replace(flight.observations, **changes)
    return replace(flight, observations=seen), f"observations: {text}"


def _satellite(flight, rng):
    return int(rng.integers(len(flight.observations.satellites)))


def _clock_jumps(flight, rng):
    """Jump phases and code, or phases alone, by a millisecond or less."""
    seen, jump_s = flight.observations, _choice(rng, (1e-3, 1e-6, 1e-7))
    inside, when = _span(seen.t_s, rng)
    code_m = seen.code_m + inside[:, None, None] * 299_792_458.0 * jump_s
    phase = seen.phase_cycles + inside[:, None, None] * 1_575.42e6 * jump_s
    alone = bool(rng.integers(2))
    text = f"{'phases' if alone else 'code and phases'} jump by {jump_s:g} s {when}"
    return _seen(flight, text, phase_cycles=phase, **({} if alone else {"code_m": code_m}))


def _code_off(flight, rng):
    seen, j, size_m = flight.observations, _satellite(flight, rng), 10 ** rng.uniform(1.0, 3.0)
    inside, when = _span(seen.t_s, rng)
    code_m = seen.code_m.copy()
    code_m[inside, :, j] += size_m
    return _seen(flight, f"code of {seen.satellites[j]} + {size_m:.0f} m {when}", code_m=code_m)


def _code_drifts(flight, rng):
    seen, j, speed_mps = flight.observations, _satellite(flight, rng), rng.uniform(0.5, 10.0)
    code_m, phase = seen.code_m.copy(), seen.phase_cycles.copy()
    code_m[..., j] += speed_mps * seen.t_s[:, None]
    phase[..., j] += speed_mps * seen.t_s[:, None] / 0.1903
    text = f"code and phase of {seen.satellites[j]} drift by {speed_mps:.1f} m/s"
    return _seen(flight, text, code_m=code_m, phase_cycles=phase)


def _slips(flight, rng):
    seen, share = flight.observations, 10 ** rng.uniform(-3.0, -1.5)
    size = rng.integers(-5, 6, seen.phase_cycles.shape) * _choice(rng, (0.5, 1.0))
    phase = seen.phase_cycles + np.cumsum(size * (rng.random(size.shape) < share), axis=0)
    return _seen(flight, f"share {share:.2g} of epochs slip unsaid", phase_cycles=phase)


def _phase_loud(flight, rng):
    seen, size = flight.observations, 10 ** rng.uniform(-1.5, -0.3)
    inside, when = _span(seen.t_s, rng)
    noise = inside[:, None, None] * size * rng.normal(size=seen.phase_cycles.shape)
    phase = seen.phase_cycles + noise
    return _seen(flight, f"phases' noise {size:.2g} cycles {when}", phase_cycles=phase)


def _doppler(flight, rng):
    seen, by = flight.observations, _choice(rng, (-1.0, 0.0, 0.9, 2.0))
    inside, when = _span(seen.t_s, rng)
    doppler_hz = np.where(inside[:, None, None], by * seen.doppler_hz, seen.doppler_hz)
    return _seen(flight, f"Doppler x {by:g} {when}", doppler_hz=doppler_hz)


def _doppler_off(flight, rng):
    seen, j, off_hz = flight.observations, _satellite(flight, rng), rng.uniform(1.0, 50.0)
    doppler_hz = seen.doppler_hz.copy()
    doppler_hz[..., j] += off_hz
    return _seen(
        flight, f"Doppler of {seen.satellites[j]} + {off_hz:.0f} Hz", doppler_hz=doppler_hz
    )


def _phase_stuck(flight, rng):
    seen, j = flight.observations, _satellite(flight, rng)
    inside, when = _span(seen.t_s, rng)
    phase = seen.phase_cycles.copy()
    phase[inside, :, j] = phase[np.argmax(inside), :, j]
    return _seen(flight, f"phase of {seen.satellites[j]} stuck {when}", phase_cycles=phase)


def _names_exchanged(flight, rng):
    seen = flight.observations
    i, j = rng.permutation(len(seen.satellites))[:2].tolist()
    order = list(range(len(seen.satellites)))
    order[i], order[j] = j, i
    changes = {
        name: getattr(seen, name)[..., order]
        for name in ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")
    }
    text = f"{seen.satellites[i]} and {seen.satellites[j]} exchanged"
    return _seen(flight, text, **changes)


def _antennas_exchanged(flight, rng):
    seen = flight.observations
    i, j = rng.permutation(len(flight.antennas))[:2].tolist()
    inside, when = _span(seen.t_s, rng)
    changes = {}
    for name in ("code_m", "phase_cycles", "doppler_hz", "lock_flags"):
        values = getattr(seen, name).copy()
        values[inside, i], values[inside, j] = (
            getattr(seen, name)[inside, j], getattr(seen, name)[inside, i],
        )  # fmt: skip
        changes[name] = values
    return _seen(flight, f"antennas {i + 1} and {j + 1} exchanged {when}", **changes)


def _antenna_moved(flight, rng):
    k, size_m = int(rng.integers(len(flight.antennas))), 10 ** rng.uniform(-2.0, 0.3)
    axis = rng.normal(size=3)
    by = size_m * axis / np.linalg.norm(axis)
    moved = list(flight.antennas)
    moved[k] = replace(moved[k], position_b_m=moved[k].position_b_m + by)
    return replace(flight, antennas=tuple(moved)), f"antennas: {k + 1} off by {size_m:.2g} m"


def _antennas_turned(flight, rng):
    """Give the antennas in axes of another convention, or turned by some degrees."""
    turns = {
        "up and left": np.diag([1.0, -1.0, -1.0]),
        "mirrored": np.diag([1.0, -1.0, 1.0]),
        "x right, y forward": np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]]),
        "5 degrees": _turn(rng, np.radians(5.0)),
        "20 degrees": _turn(rng, np.radians(20.0)),
        "10 % longer": 1.1 * np.eye(3),
    }
    name = _choice(rng, sorted(turns))
    moved = tuple(
        replace(one, position_b_m=turns[name] @ one.position_b_m) for one in flight.antennas
    )
    return replace(flight, antennas=moved), f"antennas: {name}"


# Faults of instruments.


def _height(flight, text, height_m):
    barometer = replace(flight.barometer, height_m=height_m)
    return replace(flight, barometer=barometer), f"barometer: {text}"


def _heights_scaled(flight, rng):
    by = _choice(rng, (_FOOT, 1 / _FOOT, -1.0, 100.0, 0.9))
    inside, when = _span(flight.barometer.t_s, rng)
    h_m = flight.barometer.height_m
    return _height(flight, f"x {by:.3g} {when}", np.where(inside, by * h_m, h_m))


def _heights_jump(flight, rng):
    size_m = _sign(rng) * 10 ** rng.uniform(0.5, 2.0)
    inside, when = _span(flight.barometer.t_s, rng)
    return _height(flight, f"{size_m:+.0f} m {when}", flight.barometer.height_m + inside * size_m)


def _heights_drift(flight, rng):
    speed_mps = _sign(rng) * 10 ** rng.uniform(-0.5, 1.0)
    h_m = flight.barometer.height_m + speed_mps * flight.barometer.t_s
    return _height(flight, f"drifts by {speed_mps:+.1f} m/s", h_m)


def _heights_stuck(flight, rng):
    inside, when = _span(flight.barometer.t_s, rng)
    h_m = flight.barometer.height_m.copy()
    h_m[inside] = h_m[np.argmax(inside)]
    return _height(flight, f"stuck {when}", h_m)


def _heights_outlying(flight, rng):
    share, size_m = rng.uniform(0.01, 0.2), 10 ** rng.uniform(0.7, 3.0)
    off_m = (rng.random(len(flight.barometer.t_s)) < share) * size_m
    text = f"share {share:.2g} off by {size_m:.0f} m"
    return _height(flight, text, flight.barometer.height_m + off_m)


def _field_of_elsewhere(flight, rng):
    """State the field of another declination, as of a chart read the wrong way."""
    off_deg = _sign(rng) * _choice(rng, (2.0, 5.0, 15.0, 60.0, 180.0))
    c, s = np.cos(np.radians(off_deg)), np.sin(np.radians(off_deg))
    turned = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ flight.magnetometer.field_n_ut
    magnetometer = replace(flight.magnetometer, field_n_ut=turned)
    return replace(flight, magnetometer=magnetometer), f"declination {off_deg:+.0f} deg"


def _currents(flight, text, currents):
    seeker = replace(flight.seeker, currents=currents)
    return replace(flight, seeker=seeker), f"detector: {text}"


def _currents_exchanged(flight, rng):
    order = rng.permutation(4)
    inside, when = _span(flight.seeker.t_s, rng)
    out = flight.seeker.currents.copy()
    out[inside] = out[inside][:, order]
    return _currents(flight, f"quadrants {order.tolist()} {when}", out)


def _quadrant_scaled(flight, rng):
    k, by = int(rng.integers(4)), _choice(rng, (0.0, 0.5, 0.8, 1.25, 2.0))
    inside, when = _span(flight.seeker.t_s, rng)
    out = flight.seeker.currents.copy()
    out[inside, k] *= by
    return _currents(flight, f"quadrant {k + 1} x {by:g} {when}", out)


def _currents_stuck(flight, rng):
    inside, when = _span(flight.seeker.t_s, rng)
    out = flight.seeker.currents.copy()
    out[inside] = out[np.argmax(inside)]
    return _currents(flight, f"stuck {when}", out)


def _currents_loud(flight, rng):
    size, currents = 10 ** rng.uniform(-3.0, -0.5), flight.seeker.currents
    inside, when = _span(flight.seeker.t_s, rng)
    noise = size * currents.sum(axis=1, keepdims=True) * rng.normal(size=currents.shape)
    out = np.abs(currents + inside[:, None] * noise)
    return _currents(flight, f"noise {size:.2g} of their sum {when}", out)


def _sunlit(flight, rng):
    """Add even light to all quadrants."""
    size = 10 ** rng.uniform(-1.5, 1.0) * flight.seeker.currents.sum(axis=1).mean()
    inside, when = _span(flight.seeker.t_s, rng)
    out = flight.seeker.currents + inside[:, None] * size
    return _currents(flight, f"even light of {size:.2g} {when}", out)


def _landmark_moved(flight, rng):
    size_m = 10 ** rng.uniform(0.7, 2.5)
    axis = rng.normal(size=3)
    place = flight.seeker.landmark_n_m + size_m * axis / np.linalg.norm(axis)
    seeker = replace(flight.seeker, landmark_n_m=place)
    return replace(flight, seeker=seeker), f"landmark: off by {size_m:.0f} m"


def _detector_other(flight, rng):
    ahead_m = np.array([10 ** rng.uniform(-1.0, 1.0), 0.0, 0.0])
    f = flight.seeker.focal_length_m * (1 + _sign(rng) * rng.uniform(0.05, 0.5))
    seeker = replace(
        flight.seeker, focal_length_m=f, position_b_m=flight.seeker.position_b_m + ahead_m
    )
    return replace(flight, seeker=seeker), f"detector: focal length {f:.2g} m"


FAULTS: dict[str, tuple[Change, ...]] = {
    "imu": (*_of_triad("imu", "f_b_mps2"), *_of_times("imu"), _samples_lost, _gravity_free),
    "gyroscope": _of_triad("imu", "w_b_radps"),
    "fixes": (
        _places_jump, _places_drift, _velocities_scaled, _velocities_up, _velocities_east_north,
        _velocities_old, _fixes_frozen, _fixes_loud, _fixes_outlying, _arm_wrong,
        _fixes_jittering,
    ),
    "observations": (
        _clock_jumps, _code_off, _code_drifts, _slips, _phase_loud, _doppler, _doppler_off,
        _phase_stuck, _names_exchanged, _arm_wrong,
    ),
    "array": (_antennas_exchanged, _antenna_moved, _antennas_turned),
    "barometer": (
        _heights_scaled, _heights_jump, _heights_drift, _heights_stuck, _heights_outlying,
        *_of_times("barometer"),
    ),
    "magnetometer": (
        *_of_triad("magnetometer", "field_b_ut"), *_of_times("magnetometer"), _field_of_elsewhere,
    ),
    "seeker": (
        _currents_exchanged, _quadrant_scaled, _currents_stuck, _currents_loud, _sunlit,
        _landmark_moved, _detector_other, *_of_times("seeker"),
    ),
}  # fmt: skip
