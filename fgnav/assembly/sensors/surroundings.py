"""Barometric height and the magnetic field, brought to the keyframes, and what they may be off.

A barometer's drift is no constant, but it is slow: its values at a few times a fraction of its time
constant apart are constants of the flight, as correlated as a Gauss-Markov process is, with
straight lines between them.
"""

from dataclasses import replace

import numpy as np

from fgnav.alignment.gaps import LONGEST_STEP_S
from fgnav.alignment.matching import SAME_S, nearest
from fgnav.checks import FloatArray, Unused, unused_of
from fgnav.geometry.earth import Origin, geodetic
from fgnav.geometry.interpolation import interpolate
from fgnav.graph.factors.barometer import OFFSET, BarometricHeight
from fgnav.graph.factors.directions import Directions
from fgnav.graph.factors.magnetometer import HARD_IRON, MagneticField
from fgnav.graph.types.parameters import Parameter, flight_constant
from fgnav.types.flight import Flight, Imu
from fgnav.types.surroundings import Barometer, Magnetometer

_PER_CONSTANT = 8  # times at which a drift is estimated in each of its time constants
_TIMES_AT_MOST = 12  # dimensions of the border are paid for at every keyframe
_DIGITS = 1e-6  # of an offset: less than that between its times digits do not tell
_LONGEST_S = 2.0  # between samples: across longer ones nothing is interpolated


def heights(
    flight: Flight, imu: Imu, t_s: FloatArray, p_n_m: FloatArray, *, causal: bool = False
) -> tuple[BarometricHeight | None, tuple[Parameter, ...], tuple[Unused, ...]]:
    """Return barometric heights at keyframes, (n,), and what is to be taken off them.

    The ellipsoid is taken as flat about each place.

    Parameters
    ----------
    flight : Flight
    imu : Imu
    t_s : ndarray, shape (n,)
    p_n_m : ndarray, shape (n, 3)
        Approximate places of keyframes: a kilometre off bends a height by 0.1 m.
    causal : bool
        Each keyframe by samples up to it alone. The drift then is noise: how many of its values a
        flight takes depends on how long it will be.
    """
    barometer = flight.barometer
    if barometer is None or not len(barometer.t_s):
        return None, (), ()
    take = _latest if causal else _sampled
    value, unused = take("barometric height", barometer.t_s, barometer.height_m[:, None], t_s)
    if causal and barometer.wander_m:
        noise_m = float(np.hypot(barometer.noise_m, _as_noise_m(barometer)))
        barometer = replace(barometer, wander_m=0.0, noise_m=noise_m)
    of = barometer, imu.position_b_m, flight.origin
    sensor, offset = height_sensor(*of, t_s, p_n_m, value[:, 0])
    return sensor, (offset,), unused


def height_sensor(
    barometer: Barometer,
    accelerometer_b_m: FloatArray,
    origin: Origin,
    t_s: FloatArray,
    p_n_m: FloatArray,
    height_m: FloatArray,
) -> tuple[BarometricHeight, Parameter]:
    """Return a barometer's heights at keyframes, (n,), NaN of none, and their offset.

    Parameters
    ----------
    barometer : Barometer
        Its record is not read.
    accelerometer_b_m : ndarray, shape (3,)
    origin : Origin
    t_s : ndarray, shape (n,)
    p_n_m : ndarray, shape (n, 3)
        As in ``heights``.
    height_m : ndarray, shape (n,)
    """
    times_s = _times(barometer, t_s)
    missed_m2 = _between(barometer, times_s, t_s)
    row = np.flatnonzero(np.isfinite(height_m))
    above_m = geodetic(origin.to_e(p_n_m[row]))[:, 2]
    place = np.interp(t_s[row], times_s, np.arange(len(times_s)))
    node = np.floor(place).astype(np.int64)
    sensor = BarometricHeight(
        row=row,
        down_n_m=p_n_m[row, 2] + above_m - height_m[row],
        sigma_m=float(np.sqrt(barometer.noise_m**2 + missed_m2)),
        arm_b_m=barometer.position_b_m - accelerometer_b_m,
        node=node,
        share=place - node,
    )
    return sensor, _offset(barometer, times_s)


def magnetic_field(
    sensor: Magnetometer | None, t_s: FloatArray, *, causal: bool = False
) -> tuple[MagneticField | None, tuple[Parameter, ...], tuple[Unused, ...]]:
    """Return directions of the magnetic field at keyframes, (n,), and the vehicle's own field."""
    if sensor is None or not len(sensor.t_s):
        return None, (), ()
    take = _latest if causal else _sampled
    value, unused = take("magnetic field", sensor.t_s, sensor.field_b_ut, t_s)
    directions, iron = field_sensor(sensor, value)
    return directions, (iron,), unused


def field_sensor(sensor: Magnetometer, field_b_ut: FloatArray) -> tuple[MagneticField, Parameter]:
    """Return directions by samples at keyframes, (n, 3), NaN rows of none, and the hard iron.

    Parameters
    ----------
    sensor : Magnetometer
        Its record is not read.
    field_b_ut : ndarray, shape (n, 3)
    """
    size_ut = np.linalg.norm(field_b_ut, axis=1)
    size_ut[size_ut == 0] = np.nan
    # A larger one is of another unit, or of another field: its direction is known no better.
    sigma_rad = sensor.noise_ut / np.minimum(size_ut, np.linalg.norm(sensor.field_n_ut))
    seen = Directions.isotropic(field_b_ut / size_ut[:, None], sigma_rad)
    across_b = seen.across_b[seen.row]
    iron = flight_constant(HARD_IRON, ("x_b", "y_b", "z_b"), "uT", sensor.hard_iron_ut)
    return MagneticField(row=seen.row, across_b=across_b, field_n_ut=sensor.field_n_ut), iron


def _sampled(
    what: str, have_s: FloatArray, values: FloatArray, t_s: FloatArray
) -> tuple[FloatArray, tuple[Unused, ...]]:
    """Return samples, (k, d), at the keyframes nearest to them, (n, d), interpolated; NaN else.

    One for each: neighbours of one sample would share its noise.
    """
    spacing_s = float(np.median(np.diff(t_s)))
    row, _ = nearest(t_s, have_s)
    near = np.abs(t_s[row] - have_s) <= spacing_s / 2 + SAME_S
    valid = np.zeros(len(t_s), dtype=np.bool_)
    valid[row[near]] = True
    valid &= (t_s >= have_s[0] - SAME_S) & (t_s <= have_s[-1] + SAME_S)
    if len(have_s) > 1:
        following = np.searchsorted(have_s, t_s - SAME_S).clip(1, len(have_s) - 1)
        is_short = have_s[following] - have_s[following - 1] <= _LONGEST_S
        valid &= is_short | nearest(have_s, t_s)[1]
    interpolated = np.full((len(t_s), values.shape[1]), np.nan)
    interpolated[valid] = interpolate(t_s[valid], have_s, values)
    unmatched = len(have_s) - int(valid.sum())
    reason = "not at a keyframe, or not alone there"
    return interpolated, unused_of({(what, reason): unmatched})


def _latest(
    what: str, have_s: FloatArray, values: FloatArray, t_s: FloatArray
) -> tuple[FloatArray, tuple[Unused, ...]]:
    """Return at each keyframe, (n, d), the newest sample since the one before; NaN of none."""
    sample = np.searchsorted(have_s, t_s + SAME_S) - 1
    fresh = (sample >= 0) & (np.diff(sample, prepend=-1) > 0)
    fresh &= t_s - have_s[sample.clip(0)] <= LONGEST_STEP_S
    newest = np.full((len(t_s), values.shape[1]), np.nan)
    newest[fresh] = values[sample[fresh]]
    unmatched, reason = len(have_s) - int(fresh.sum()), "not the newest at a keyframe"
    return newest, unused_of({(what, reason): unmatched})


def _as_noise_m(barometer: Barometer) -> float:
    """Return white noise of samples, 1-sigma, m, of the drift's density at low frequencies.

    A Gauss-Markov process of variance s^2 and time constant T has the density ``2 s^2 T`` there.
    """
    spacing_s = float(barometer.t_s[1] - barometer.t_s[0]) if len(barometer.t_s) > 1 else 1.0
    density = 2 * barometer.wander_m**2 * barometer.wander_time_s
    return float(np.sqrt(density / max(spacing_s, LONGEST_STEP_S)))


def _times(barometer: Barometer, t_s: FloatArray) -> FloatArray:
    """Return the times at which a drift is estimated; one where there is no drift."""
    span_s = float(t_s[-1] - t_s[0])
    if barometer.wander_m == 0 or span_s == 0:
        return t_s[:1]
    wanted = int(np.ceil(span_s * _PER_CONSTANT / barometer.wander_time_s)) + 1
    return np.linspace(t_s[0], t_s[-1], min(max(wanted, 2), _TIMES_AT_MOST))


def _between(barometer: Barometer, times_s: FloatArray, t_s: FloatArray) -> float:
    """Return white noise, m2 at each keyframe, as dense at low frequencies as what lines miss.

    A Gauss-Markov process with its values D apart known is Brownian between them, ``2 s^2 / T`` the
    variance it gains in a second: of mean variance ``s^2 D / (3 T)``, its mean over D as
    uncertain as that of independent values half an interval apart. Beyond the time constant it is
    ``s^2``, a time constant to either side.
    """
    if barometer.wander_m == 0 or len(times_s) < 2:
        return 0.0
    spacing_s, interval_s = float(np.median(np.diff(t_s))), float(times_s[1] - times_s[0])
    T_s, variance_m2 = barometer.wander_time_s, barometer.wander_m**2
    missed = variance_m2 * interval_s**2 / (6 * T_s)
    return max(
        min(missed, 2 * variance_m2 * T_s) / spacing_s, min(interval_s / T_s / 3, 1.0) * variance_m2
    )


def _offset(barometer: Barometer, times_s: FloatArray) -> Parameter:
    """Return offset and drift at those times, as correlated as they are."""
    interval_s = np.abs(times_s[:, None] - times_s)
    drift_m2 = barometer.wander_m**2 * np.exp(-interval_s / barometer.wander_time_s)
    n = len(times_s)
    rounding_m2 = (_DIGITS * barometer.offset_m) ** 2 * np.eye(n)  # .1 mm of 100 m
    return Parameter(
        name=OFFSET,
        axes=("height",) if n == 1 else tuple(f"at {t:.1f} s" for t in times_s),
        unit="m",
        mean=np.zeros(n),
        covariance=barometer.offset_m**2 + drift_m2 + rounding_m2,
        start=np.zeros(n),
        linear=True,
    )
