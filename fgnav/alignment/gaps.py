"""Bridge gaps of a recording: keyframes within them, linear interpolation, and notes."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fgnav.alignment.matching import nearest
from fgnav.checks import BoolArray, FloatArray
from fgnav.geometry.interpolation import interpolate
from fgnav.geometry.rotations import exp, log, transpose
from fgnav.messages import Note, note
from fgnav.types.flight import Imu

GAP = 1.5  # usual intervals; a longer step between samples is a gap
LONGEST_GAP_S = 0.5  # longer ones are bridged with what little is known, and noted
# Between keyframes. With GNSS once a second and a sine of 20 degrees, twice as much puts the
# accelerometer's bias off by 1.5 sigma.
LONGEST_STEP_S = 0.1
_TOLERANCE = 0.5  # steps: a tag that is late is no gap
_LONGEST_TURN_RAD = 0.7  # between keyframes: docs/theory/gyro_free_motion.md, commutator
_SEVERAL = 2.5  # usual intervals without a measurement are worth a sentence
_CORRELATION_S = 2.0  # of what a body does while nobody measures it
LOST_S = 2.0  # from the next attitude: a body without a gyroscope may be anyhow by then
_GRAVITY_MPS2 = 9.8  # felt at least, most of the time
_LISTED = 5  # gaps of a kind that are listed one by one


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Bridged:
    """An inertial record without gaps."""

    imu: Imu  # straight lines across the gaps
    # The same, its noise that of not knowing: the record's own spread, held for two seconds.
    inflated: Imu
    gaps_s: FloatArray  # (g, 2): last sample before and first after each gap

    def overlaps(self, t_s: FloatArray) -> BoolArray:
        """Return the keyframes, (n,), from which the way to the next touches a gap."""
        ended = np.searchsorted(self.gaps_s[:, 1], t_s[:-1], side="right")
        begun = np.searchsorted(self.gaps_s[:, 0], t_s[1:])
        return np.append(begun > ended, False)


def bridged(imu: Imu, *, causal: bool = False) -> Bridged:
    """Return a record whose gaps are filled with straight lines, at its own rate.

    Half of the specific force is not known, either, once the attitude is half a radian off.
    Causal: nothing is filled, since a line ends in a sample to come, and what is not known of
    force and rate is the size of gravity and a radian a second.
    """
    step_s, filled, f_b, w_b = np.diff(imu.t_s), imu, imu.f_b_mps2, imu.w_b_radps
    gap = np.flatnonzero(step_s > LONGEST_GAP_S)
    gaps_s = np.stack([imu.t_s[gap], imu.t_s[gap + 1]], axis=1)
    if len(gap) and not causal:
        regular_s = min(float(np.median(step_s)), LONGEST_GAP_S)
        inside = [np.arange(a + regular_s, b - regular_s / 2, regular_s) for a, b in gaps_s]
        t_s = np.union1d(imu.t_s, np.concatenate(inside))
        rates = None if w_b is None else interpolate(t_s, imu.t_s, w_b)
        filled = replace(imu, t_s=t_s, f_b_mps2=interpolate(t_s, imu.t_s, f_b), w_b_radps=rates)
    force, rate = _GRAVITY_MPS2**2, 1.0  # variances of what is not known
    if not causal:
        force = f_b.var(axis=0).max() + max((f_b**2).sum(axis=1).mean(), force) / 4
    inflated = replace(filled, accelerometer_noise_mps2_per_sqrt_hz=_as_white(force))
    if w_b is not None:
        noise = _as_white(rate)
        if not causal:
            nominal = imu.gyroscope_noise_radps_per_sqrt_hz or 0.0
            noise = max(_as_white(w_b.var(axis=0).max()), nominal)
        inflated = replace(inflated, gyroscope_noise_radps_per_sqrt_hz=noise)
    return Bridged(imu=filled, inflated=inflated, gaps_s=gaps_s)


def keyframe_times(
    epochs_s: FloatArray,
    until_s: float,
    turn_rad: FloatArray | None = None,
    *,
    causal: bool = False,
    usual_s: float | None = None,
) -> FloatArray:
    """Return GNSS epochs, (k,), and times between them where these lie too far apart, (n,).

    Steps are at most 0.1 s and, of a body whose rate is
    a state, so short that it turns by less than 0.7 rad, as it did over the interval before.

    Parameters
    ----------
    epochs_s : ndarray, shape (k,)
    until_s : float
        End of the inertial record.
    turn_rad : ndarray, shape (k - 1,), or None
        How far the body turned from epoch to epoch; NaN where nobody knows.
    causal : bool
        Whether times after an epoch are not to depend on how far the body turns until the next,
        and go on beyond the last.
    usual_s : float, optional
        Between the first two epochs, where these are not among them.
    """
    if len(epochs_s) < 2:
        return epochs_s
    span_s = np.diff(epochs_s)
    usual_s = min(float(span_s[0]) if usual_s is None else usual_s, LONGEST_STEP_S)
    step_s = np.full(len(epochs_s), usual_s)
    if turn_rad is not None:
        rate = np.nan_to_num(turn_rad / span_s)
        before, after = np.append(0.0, rate), np.append(rate, 0.0)
        rate = before if causal else np.maximum(before, after)
        step_s = usual_s / np.ceil(usual_s * rate / _LONGEST_TURN_RAD).clip(1)
    room_s = np.append(span_s, max(until_s - epochs_s[-1], 0.0))
    parts = np.ceil(room_s / step_s - _TOLERANCE).astype(np.int64).clip(1)
    parts[-1] = int(room_s[-1] / step_s[-1] + 1e-6) + 1 if causal else 1
    within = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.asarray(np.repeat(epochs_s, parts) + within * np.repeat(step_s, parts))


def spans(t_s: FloatArray, missing: BoolArray) -> FloatArray:
    """Return the spans, (g, 2), in which something is missing for longer than it usually is.

    From the last time that has it, or else the first, to the next that does, or else the last.
    """
    present_s = t_s[~missing]
    usual_s = float(np.median(np.diff(present_s))) if len(present_s) > 1 else 0.0
    edges = np.diff(np.concatenate([[False], missing, [False]]).astype(np.int8))
    first, after = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    edges_s = np.stack([t_s[(first - 1).clip(0)], t_s[after.clip(max=len(t_s) - 1)]], axis=1)
    return np.asarray(
        edges_s[edges_s[:, 1] - edges_s[:, 0] > max(LONGEST_GAP_S, _SEVERAL * usual_s)]
    )


def gap_notes(what: str, gaps_s: FloatArray, code: str = "W101", **values: str) -> Iterator[Note]:
    """Yield a message on each gap, or on how many more there are."""
    for from_s, until_s in gaps_s[:_LISTED]:
        yield note(code, what=what, from_s=from_s, until_s=until_s, **values)
    more = gaps_s[_LISTED:]
    if len(more):
        longest_s = float((more[:, 1] - more[:, 0]).max())
        yield note("W102", what=what, count=len(more), longest_s=longest_s)


def _as_white(variance: float) -> float:
    """Return the density of white noise that is as good as a process held for two seconds."""
    return float(np.sqrt(2 * _CORRELATION_S * variance))


def time_from_attitude_s(t_s: FloatArray, valid: BoolArray, *, causal: bool = False) -> FloatArray:
    """Compute the time from each keyframe to the nearest attitude, s, (n,); causal: the last."""
    if causal:
        return np.asarray(t_s - t_s[np.maximum.accumulate(np.where(valid, np.arange(len(t_s)), 0))])
    if not valid.any():
        return np.full(len(t_s), np.inf)
    valid_s = t_s[valid]
    return np.abs(t_s - valid_s[nearest(valid_s, t_s)[0]])


def rotation_cubic(
    first: FloatArray,
    last: FloatArray,
    first_radps: FloatArray,
    last_radps: FloatArray,
    span_s: FloatArray | float,
    share: FloatArray,
) -> FloatArray:
    """Return attitudes, (n, 3, 3), on the cubic between two attitudes with their rates.

    That is where a random walk of the rate goes. Both rates' mean is taken out first, so that a
    body may turn over between them.

    Parameters
    ----------
    first, last : ndarray, shape (n, 3, 3)
    first_radps, last_radps : ndarray, shape (n, 3)
        Body axes.
    span_s, share : ndarray, shape (n, 1) or ()
        Time between them, and the share of it that has passed.
    """
    mean = (first_radps + last_radps) / 2
    residual = log(transpose(first @ exp(span_s * mean)) @ last)
    bend = span_s * share * (1 - share) * (first_radps - last_radps) / 2
    rotation = share**2 * (3 - 2 * share) * residual + bend
    return np.asarray(first @ exp(span_s * share * mean) @ exp(rotation))
