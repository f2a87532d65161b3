"""Faults of instruments: barometer, the field that is stated, detector."""

from dataclasses import replace

import numpy as np

from tests.robustness.drawn.draws import Change, choice, sign, span

_FOOT = 1 / 0.3048


def _height(flight, text, height_m):
    barometer = replace(flight.barometer, height_m=height_m)
    return replace(flight, barometer=barometer), f"barometer: {text}"


def _heights_scaled(flight, rng):
    by = choice(rng, (_FOOT, 1 / _FOOT, -1.0, 100.0, 0.9))
    inside, when = span(flight.barometer.t_s, rng)
    h_m = flight.barometer.height_m
    return _height(flight, f"x {by:.3g} {when}", np.where(inside, by * h_m, h_m))


def _heights_jump(flight, rng):
    size_m = sign(rng) * 10 ** rng.uniform(0.5, 2.0)
    inside, when = span(flight.barometer.t_s, rng)
    return _height(flight, f"{size_m:+.0f} m {when}", flight.barometer.height_m + inside * size_m)


def _heights_drift(flight, rng):
    speed_mps = sign(rng) * 10 ** rng.uniform(-0.5, 1.0)
    h_m = flight.barometer.height_m + speed_mps * flight.barometer.t_s
    return _height(flight, f"drifts by {speed_mps:+.1f} m/s", h_m)


def _heights_stuck(flight, rng):
    inside, when = span(flight.barometer.t_s, rng)
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
    off_deg = sign(rng) * choice(rng, (2.0, 5.0, 15.0, 60.0, 180.0))
    c, s = np.cos(np.radians(off_deg)), np.sin(np.radians(off_deg))
    turned = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ flight.magnetometer.field_n_ut
    magnetometer = replace(flight.magnetometer, field_n_ut=turned)
    return replace(flight, magnetometer=magnetometer), f"declination {off_deg:+.0f} deg"


def _currents(flight, text, currents):
    photodetector = replace(flight.photodetector, currents=currents)
    return replace(flight, photodetector=photodetector), f"detector: {text}"


def _currents_exchanged(flight, rng):
    order = rng.permutation(4)
    inside, when = span(flight.photodetector.t_s, rng)
    out = flight.photodetector.currents.copy()
    out[inside] = out[inside][:, order]
    return _currents(flight, f"quadrants {order.tolist()} {when}", out)


def _quadrant_scaled(flight, rng):
    k, by = int(rng.integers(4)), choice(rng, (0.0, 0.5, 0.8, 1.25, 2.0))
    inside, when = span(flight.photodetector.t_s, rng)
    out = flight.photodetector.currents.copy()
    out[inside, k] *= by
    return _currents(flight, f"quadrant {k + 1} x {by:g} {when}", out)


def _currents_stuck(flight, rng):
    inside, when = span(flight.photodetector.t_s, rng)
    out = flight.photodetector.currents.copy()
    out[inside] = out[np.argmax(inside)]
    return _currents(flight, f"stuck {when}", out)


def _currents_loud(flight, rng):
    size, currents = 10 ** rng.uniform(-3.0, -0.5), flight.photodetector.currents
    inside, when = span(flight.photodetector.t_s, rng)
    noise = size * currents.sum(axis=1, keepdims=True) * rng.normal(size=currents.shape)
    out = np.abs(currents + inside[:, None] * noise)
    return _currents(flight, f"noise {size:.2g} of their sum {when}", out)


def _sunlit(flight, rng):
    """Add even light to all quadrants."""
    size = 10 ** rng.uniform(-1.5, 1.0) * flight.photodetector.currents.sum(axis=1).mean()
    inside, when = span(flight.photodetector.t_s, rng)
    out = flight.photodetector.currents + inside[:, None] * size
    return _currents(flight, f"even light of {size:.2g} {when}", out)


def _landmark_moved(flight, rng):
    size_m = 10 ** rng.uniform(0.7, 2.5)
    axis = rng.normal(size=3)
    place = flight.photodetector.landmark_n_m + size_m * axis / np.linalg.norm(axis)
    photodetector = replace(flight.photodetector, landmark_n_m=place)
    return replace(flight, photodetector=photodetector), f"landmark: off by {size_m:.0f} m"


def _detector_other(flight, rng):
    ahead_m = np.array([10 ** rng.uniform(-1.0, 1.0), 0.0, 0.0])
    f = flight.photodetector.focal_length_m * (1 + sign(rng) * rng.uniform(0.05, 0.5))
    photodetector = replace(
        flight.photodetector,
        focal_length_m=f,
        position_b_m=flight.photodetector.position_b_m + ahead_m,
    )
    return replace(flight, photodetector=photodetector), f"detector: focal length {f:.2g} m"


BAROMETER: tuple[Change, ...] = (
    _heights_scaled, _heights_jump, _heights_drift, _heights_stuck, _heights_outlying,
)  # fmt: skip
MAGNETOMETER: tuple[Change, ...] = (_field_of_elsewhere,)
PHOTODETECTOR: tuple[Change, ...] = (
    _currents_exchanged, _quadrant_scaled, _currents_stuck, _currents_loud, _sunlit,
    _landmark_moved, _detector_other,
)  # fmt: skip
