"""Faults of triads and of times: accelerometer, gyroscope, magnetometer, and any tags.

Sizes are shares of what a triad senses.
"""

from dataclasses import replace

import numpy as np

from tests.robustness.drawn.draws import DURATION_S, Change, choice, sign, span, turn

_DEGREE, _G = 180.0 / np.pi, 9.80665


def _scaled(x, t_s, rng):
    by = choice(rng, (0.5, 0.8, 0.9, 1.1, 1.25, 2.0, _DEGREE, 1 / _DEGREE, _G, 1 / _G, 1e3, 1e-3))
    inside, when = span(t_s, rng)
    out = x.copy()
    out[inside] *= by
    return out, f"x {by:.4g} {when}"


def _axis_scaled(x, t_s, rng):
    axis, by = int(rng.integers(3)), choice(rng, (-1.0, 0.0, 0.5, 0.8, 1.25, 2.0))
    inside, when = span(t_s, rng)
    out = x.copy()
    out[inside, axis] *= by
    return out, f"axis {axis} x {by:g} {when}"


def _axis_stuck(x, t_s, rng):
    axis = int(rng.integers(3))
    inside, when = span(t_s, rng)
    out = x.copy()
    out[inside, axis] = x[np.argmax(inside), axis]
    return out, f"axis {axis} stuck {when}"


def _exchanged(x, t_s, rng):
    order = choice(rng, ((1, 0, 2), (0, 2, 1), (2, 1, 0), (1, 2, 0), (2, 0, 1)))
    inside, when = span(t_s, rng)
    out = x.copy()
    out[inside] = x[inside][:, order]
    return out, f"axes {order} {when}"


def _turned(x, t_s, rng):
    angle_deg = choice(rng, (3.0, 10.0, 30.0, 90.0))
    inside, when = span(t_s, rng)
    out = x.copy()
    out[inside] = x[inside] @ turn(rng, np.radians(angle_deg))
    return out, f"turned by {angle_deg:g} deg {when}"


def _stepped(x, t_s, rng):
    size = 10 ** rng.uniform(-1.5, 0.3) * np.abs(x).max()
    inside, when = span(t_s, rng)
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
    inside, when = span(t_s, rng)
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


def of_triad(sensor: str, field: str) -> tuple[Change, ...]:
    def made(fault) -> Change:
        def change(flight, rng):
            series = getattr(flight, sensor)
            values, text = fault(getattr(series, field), series.t_s, rng)
            changed = replace(series, **{field: values})
            return replace(flight, **{sensor: changed}), f"{field}: {fault.__name__[1:]}, {text}"

        return change

    return tuple(made(one) for one in TRIAD)


def _late(t_s, rng):
    late_s = sign(rng) * 10 ** rng.uniform(-2.5, 0.3)
    return t_s + late_s, f"tags {late_s:+.3g} s"


def _stretched(t_s, rng):
    by = sign(rng) * 10 ** rng.uniform(-3.5, -1.5)
    return t_s[0] + (1 + by) * (t_s - t_s[0]), f"clock {by:+.2g}"


def _jumping(t_s, rng):
    late_s, from_s = 10 ** rng.uniform(-2.0, 0.3), rng.uniform(2.0, 0.7 * DURATION_S)
    return t_s + late_s * (t_s >= from_s), f"tags {late_s:+.3g} s from {from_s:.1f} s"


def jittering(t_s, rng):
    size_s = rng.uniform(0.1, 0.45) * np.median(np.diff(t_s))
    return t_s + rng.uniform(-size_s, size_s, len(t_s)), f"tags ± {size_s:.2g} s"


def of_times(sensor: str) -> tuple[Change, ...]:
    def made(fault) -> Change:
        def change(flight, rng):
            series = getattr(flight, sensor)
            t_s, text = fault(series.t_s, rng)
            return replace(flight, **{sensor: replace(series, t_s=t_s)}), f"{sensor}: {text}"

        return change

    return tuple(made(one) for one in (_late, _stretched, _jumping, jittering))


def samples_lost(flight, rng):
    """Lose samples whose tags are counted on."""
    imu, share = flight.imu, 10 ** rng.uniform(-3.0, -1.0)
    keep = rng.random(len(imu.t_s)) > share
    rest = imu[keep]
    t_s = imu.t_s[: len(rest.t_s)]
    return replace(flight, imu=replace(rest, t_s=t_s)), f"imu: share {share:.2g} lost, tags go on"


def gravity_free(flight, _rng):
    """Give accelerations without gravity, as telephones do."""
    truth, imu = flight.truth, flight.imu
    k = np.searchsorted(truth.t_s, imu.t_s).clip(0, len(truth.t_s) - 1)
    force = imu.f_b_mps2 + np.einsum("kji,j->ki", truth.R_nb[k], [0.0, 0.0, _G])
    return replace(flight, imu=replace(imu, f_b_mps2=force)), "f_b_mps2: without gravity"
