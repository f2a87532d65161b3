"""Faults of GNSS: a receiver's fixes, raw observations, antennas."""

from dataclasses import replace

import numpy as np

from tests.robustness.drawn.draws import DURATION_S, Change, choice, span, turn
from tests.robustness.drawn.series import jittering

_KNOT, _FOOT = 3600 / 1852, 1 / 0.3048


def _fixes(flight, text, **changes):
    return replace(flight, fixes=(replace(flight.fixes[0], **changes),)), f"fixes: {text}"


def _places_jump(flight, rng):
    size_m = 10 ** rng.uniform(0.5, 2.0)
    inside, when = span(flight.fixes[0].t_s, rng)
    axis = rng.normal(size=3)
    off_m = size_m * axis / np.linalg.norm(axis)
    p_n_m = flight.fixes[0].p_n_m + inside[:, None] * off_m
    return _fixes(flight, f"places off by {size_m:.0f} m {when}", p_n_m=p_n_m)


def _places_drift(flight, rng):
    speed_mps, from_s = 10 ** rng.uniform(-0.5, 1.0), rng.uniform(0.0, DURATION_S / 2)
    axis = rng.normal(size=3)
    since_s = (flight.fixes[0].t_s - from_s).clip(0.0)[:, None]
    p_n_m = flight.fixes[0].p_n_m + since_s * speed_mps * axis / np.linalg.norm(axis)
    text = f"places drift by {speed_mps:.1f} m/s from {from_s:.1f} s"
    return _fixes(flight, text, p_n_m=p_n_m)


def _velocities_scaled(flight, rng):
    by = choice(rng, (_KNOT, 1 / _KNOT, 3.6, _FOOT, 0.9, 1.1, -1.0, 0.0))
    inside, when = span(flight.fixes[0].t_s, rng)
    v_n_mps = np.where(inside[:, None], by * flight.fixes[0].v_n_mps, flight.fixes[0].v_n_mps)
    return _fixes(flight, f"velocities x {by:.3g} {when}", v_n_mps=v_n_mps)


def _velocities_up(flight, _rng):
    return _fixes(flight, "vertical velocity up", v_n_mps=flight.fixes[0].v_n_mps * [1, 1, -1])


def _velocities_east_north(flight, _rng):
    v_n_mps = flight.fixes[0].v_n_mps[:, [1, 0, 2]] * [1, 1, -1]
    return _fixes(flight, "velocities east, north, up", v_n_mps=v_n_mps)


def _velocities_old(flight, rng):
    rows = int(rng.integers(1, 6))
    k = (np.arange(len(flight.fixes[0].t_s)) - rows).clip(0)
    return _fixes(flight, f"velocities {rows} rows old", v_n_mps=flight.fixes[0].v_n_mps[k])


def _fixes_frozen(flight, rng):
    fixes = flight.fixes[0]
    inside, when = span(fixes.t_s, rng)
    first = np.argmax(inside)
    p_n_m, v_n_mps = fixes.p_n_m.copy(), fixes.v_n_mps.copy()
    p_n_m[inside], v_n_mps[inside] = p_n_m[first], v_n_mps[first]
    return _fixes(flight, f"frozen {when}", p_n_m=p_n_m, v_n_mps=v_n_mps)


def _fixes_loud(flight, rng):
    by = 10 ** rng.uniform(0.3, 2.0)
    inside, when = span(flight.fixes[0].t_s, rng)
    fixes, loud = flight.fixes[0], inside[:, None] * by
    p_n_m = fixes.p_n_m + loud * fixes.position_sigma_m * rng.normal(size=fixes.p_n_m.shape)
    v_n_mps = fixes.v_n_mps + loud * fixes.velocity_sigma_mps * rng.normal(size=fixes.p_n_m.shape)
    return _fixes(flight, f"noise x {by:.2g} {when}", p_n_m=p_n_m, v_n_mps=v_n_mps)


def _fixes_outlying(flight, rng):
    share, size_m = rng.uniform(0.01, 0.15), 10 ** rng.uniform(1.0, 3.0)
    at = rng.random(len(flight.fixes[0].t_s)) < share
    p_n_m = flight.fixes[0].p_n_m + at[:, None] * size_m * rng.normal(size=(len(at), 3))
    return _fixes(flight, f"share {share:.2g} off by {size_m:.0f} m", p_n_m=p_n_m)


def _fixes_jittering(flight, rng):
    """Jitter alone: estimates are in the time of the fixes, which no other says to be off."""
    t_s, text = jittering(flight.fixes[0].t_s, rng)
    return _fixes(flight, text, t_s=t_s)


def _arm_wrong(flight, rng):
    size_m = 10 ** rng.uniform(-1.0, 0.7)
    axis = rng.normal(size=3)
    by = size_m * axis / np.linalg.norm(axis)
    moved = tuple(replace(one, position_b_m=one.position_b_m + by) for one in flight.antennas)
    return replace(flight, antennas=moved), f"antennas: all off by {size_m:.2g} m"


def _seen(flight, text, **changes):
    seen = replace(flight.observations, **changes)
    return replace(flight, observations=seen), f"observations: {text}"


def _satellite(flight, rng):
    return int(rng.integers(len(flight.observations.satellites)))


def _clock_jumps(flight, rng):
    """Jump phases and code, or phases alone, by a millisecond or less."""
    seen, jump_s = flight.observations, choice(rng, (1e-3, 1e-6, 1e-7))
    inside, when = span(seen.t_s, rng)
    code_m = seen.code_m + inside[:, None, None] * 299_792_458.0 * jump_s
    phase = seen.phase_cycles + inside[:, None, None] * 1_575.42e6 * jump_s
    alone = bool(rng.integers(2))
    text = f"{'phases' if alone else 'code and phases'} jump by {jump_s:g} s {when}"
    return _seen(flight, text, phase_cycles=phase, **({} if alone else {"code_m": code_m}))


def _code_off(flight, rng):
    seen, j, size_m = flight.observations, _satellite(flight, rng), 10 ** rng.uniform(1.0, 3.0)
    inside, when = span(seen.t_s, rng)
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
    size = rng.integers(-5, 6, seen.phase_cycles.shape) * choice(rng, (0.5, 1.0))
    phase = seen.phase_cycles + np.cumsum(size * (rng.random(size.shape) < share), axis=0)
    return _seen(flight, f"share {share:.2g} of epochs slip unsaid", phase_cycles=phase)


def _phase_loud(flight, rng):
    seen, size = flight.observations, 10 ** rng.uniform(-1.5, -0.3)
    inside, when = span(seen.t_s, rng)
    noise = inside[:, None, None] * size * rng.normal(size=seen.phase_cycles.shape)
    phase = seen.phase_cycles + noise
    return _seen(flight, f"phases' noise {size:.2g} cycles {when}", phase_cycles=phase)


def _doppler(flight, rng):
    seen, by = flight.observations, choice(rng, (-1.0, 0.0, 0.9, 2.0))
    inside, when = span(seen.t_s, rng)
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
    inside, when = span(seen.t_s, rng)
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
    inside, when = span(seen.t_s, rng)
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
        "5 degrees": turn(rng, np.radians(5.0)),
        "20 degrees": turn(rng, np.radians(20.0)),
        "10 % longer": 1.1 * np.eye(3),
    }
    name = choice(rng, sorted(turns))
    moved = tuple(
        replace(one, position_b_m=turns[name] @ one.position_b_m) for one in flight.antennas
    )
    return replace(flight, antennas=moved), f"antennas: {name}"


FIXES: tuple[Change, ...] = (
    _places_jump, _places_drift, _velocities_scaled, _velocities_up, _velocities_east_north,
    _velocities_old, _fixes_frozen, _fixes_loud, _fixes_outlying, _arm_wrong, _fixes_jittering,
)  # fmt: skip
OBSERVATIONS: tuple[Change, ...] = (
    _clock_jumps, _code_off, _code_drifts, _slips, _phase_loud, _doppler, _doppler_off,
    _phase_stuck, _names_exchanged, _arm_wrong,
)  # fmt: skip
ARRAY: tuple[Change, ...] = (_antennas_exchanged, _antenna_moved, _antennas_turned)
