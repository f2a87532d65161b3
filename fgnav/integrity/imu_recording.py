"""Recording errors of an IMU: held and rounded values."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from fgnav.checks import BoolArray, FloatArray
from fgnav.messages import note
from fgnav.types.flight import Imu

_MINIMUM = 100
_MINIMUM_FRESH = 8  # samples of which every other one gives a cubic
_ROUNDED = 1e-3  # of a step: what digits of a file leave
_ORDER = 4  # of a cubic's error in the spacing of its nodes
SENSORS = (("accelerometer", "f_b_mps2", "mps2"), ("gyroscope", "w_b_radps", "radps"))


class Step(NamedTuple):
    """The smallest change of an axis whose values are all multiples of it."""

    axis: int
    size: float


def with_noise_of_record(imu: Imu) -> tuple[Imu, tuple[str, ...]]:
    """Return a unit whose noise has what its record adds, and a sentence on each sensor's.

    White noise of density N is N^2 / T of a sample, T the time between two. Of samples that are
    held for k of these it is the same, so that its density is k N^2; a cubic between them errs, by
    every other one of them, d, by d / 16 [1]_. Rounding to steps q is q^2 / 12 beside it, for as
    long as an axis repeats itself [2]_. Each is an error that stays for a time h: h times its
    variance is a density.

    References
    ----------
    .. [1] de Boor, A Practical Guide to Splines, 2001, chapter V: h^4.
    .. [2] Widrow and Kollar, Quantization Noise, 2008, chapter 4.
    """
    if len(imu.t_s) < _MINIMUM:
        return imu, ()
    interval_s, noisier, notes = float(np.median(np.diff(imu.t_s))), imu, []
    for name, field, unit in SENSORS:
        x, key = getattr(imu, field), f"{name}_noise_{unit}_per_sqrt_hz"
        stated = getattr(imu, key)
        if x is None or stated is None:
            continue
        variance, causes, repeated = stated**2, [], is_repeated(x)
        if repeated.any():
            t_s, fresh = imu.t_s[~repeated], x[~repeated]
            hold_s = float(np.median(np.diff(t_s)))
            of_sample = stated**2 / interval_s + _between(t_s, fresh)
            variance = hold_s * of_sample
            causes.append(f"samples are held for {hold_s:.2g} s")
        step = coarse_step(x, stated / np.sqrt(interval_s))
        if step is not None:
            changes = np.count_nonzero(np.diff(x, axis=0), axis=0)[step.axis]
            variance += step.size**2 / 12 * (imu.t_s[-1] - imu.t_s[0]) / max(changes, 1)
            causes.append(f"values are recorded in steps of {step.size:.2g}")
        if causes:
            raised: dict[str, Any] = {key: float(np.sqrt(variance))}
            noisier = replace(noisier, **raised)
            of = {"used": np.sqrt(variance), "nominal": stated, "causes": " and ".join(causes)}
            notes.append(note("I104", sensor=name.capitalize(), **of))
    return noisier, tuple(notes)


def between_fresh(imu: Imu, field: str, repeated: BoolArray) -> Imu:
    """Return a record whose held samples of a sensor are on cubics through the fresh ones.

    What is held after the last fresh one is left out.
    """
    fresh, x = np.flatnonzero(~repeated), getattr(imu, field)
    values = CubicSpline(imu.t_s[fresh], x[fresh])(imu.t_s)
    values[fresh] = x[fresh]
    return replace(imu, **{field: values})[: fresh[-1] + 1]


def is_repeated(x: FloatArray, *, causal: bool = False) -> BoolArray:
    """Select samples, (k,), that repeat all axes at even intervals.

    Such a sensor is slower than its record and no later than what it repeats. Where most samples
    repeat the one before, and most runs are as long as the run before: of samples that repeat by
    chance or by coarse steps at most a third are. Causal: by samples up to each.
    """
    same = np.append(False, (np.diff(x, axis=0) == 0).all(axis=1))
    fresh = np.flatnonzero(~same)
    if len(x) < _MINIMUM or len(fresh) < _MINIMUM_FRESH:
        return np.zeros(len(x), dtype=np.bool_)
    runs = np.diff(fresh)  # each ends where the next is fresh
    even, many = np.zeros(len(x)), np.zeros(len(x))
    many[fresh[1:]], even[fresh[2:]] = 1.0, runs[1:] == runs[:-1]
    repeats, even, many = np.cumsum(same), np.cumsum(even), np.cumsum(many)
    k = np.arange(1, len(x) + 1)
    is_held = (repeats > k / 2) & (even > many / 2) & (k >= _MINIMUM)
    return np.asarray(same & (is_held if causal else is_held[-1]))


def coarse_step(x: FloatArray, noise: float) -> Step | None:
    """Return the coarsest step in which an axis is recorded, if its rounding exceeds the noise.

    ``noise``: 1-sigma of a sample.
    """
    steps = [np.diff(np.unique(column)) for column in x.T]
    sizes = [float(one.min()) if len(one) else 0.0 for one in steps]
    axis = int(np.argmax(sizes))
    if sizes[axis] < noise * np.sqrt(12):
        return None
    multiple = steps[axis] / sizes[axis]
    if (np.abs(multiple - np.rint(multiple)) > _ROUNDED).any():
        return None
    return Step(axis, sizes[axis])


def _between(t_s: FloatArray, x: FloatArray) -> float:
    """Return the variance of what a cubic errs by between samples, of the noisiest axis."""
    error = x[1:-1:2] - CubicSpline(t_s[::2], x[::2])(t_s[1:-1:2])
    return float((error**2).mean(axis=0).max() / 4**_ORDER)
