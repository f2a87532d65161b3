"""Unit of specific force and axes of the magnetometer, by quantities that no rotation changes.

However a body turns, the mean size of specific force over a span is at least that of its mean in
axes that do not turn: the change of velocity less gravity. Their quotient is one, or 1/9.8 for
samples in g. The angle of specific force and magnetic field is the same in body axes and in n.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from fgnav.checks import FloatArray
from fgnav.diagnostics.contents import Finding
from fgnav.diagnostics.track import velocities
from fgnav.diagnostics.windows import FALSE_ALARM
from fgnav.geometry.earth import Origin
from fgnav.geometry.interpolation import integral, interpolate
from fgnav.types.flight import Fixes, Imu
from fgnav.types.surroundings import Magnetometer

G_MPS2 = 9.80665  # exact, the unit g
_FORCES = "[imu] samples, fx_mps2, fy_mps2, fz_mps2"
_TOLERANCE = 0.2  # of a factor: scale factors and biases are smaller
_NEAR_S, _SPAN_S = 2.5, 1.0  # over which velocities of 0.5 m/s noise show gravity to 7 %
_MEAN_S = 0.5  # of means that hold no vibration
_MIN_SPANS = 10


class MeanForces(NamedTuple):
    """Mean specific forces, (k, 3), frame n, over spans of a track from begin to end, (k,)."""

    begin_s: FloatArray
    end_s: FloatArray
    f_n_mps2: FloatArray

    def within(self, first_s: float, last_s: float) -> "MeanForces | None":
        """Return those of a time; None where there are fewer than ten."""
        inside = (self.begin_s >= first_s) & (self.end_s <= last_s)
        return MeanForces(*(x[inside] for x in self)) if inside.sum() >= _MIN_SPANS else None

    def mean_of(self, t_s: FloatArray, values: FloatArray) -> FloatArray:
        """Return means over the spans, (k,), of values at times, (m,)."""
        total = integral(t_s, values[:, None])[:, 0]
        gained = np.interp(self.end_s, t_s, total) - np.interp(self.begin_s, t_s, total)
        return np.asarray(gained / (self.end_s - self.begin_s))


def mean_forces(fixes: Fixes, origin: Origin) -> MeanForces | None:
    """Return mean specific forces of a track that exceed half of gravity and their noise."""
    v_n_mps, sigma_mps = velocities(fixes)
    if v_n_mps is None:
        return None
    t_s = fixes.t_s
    end = np.searchsorted(t_s, t_s + _SPAN_S - 1e-9)
    begin = np.flatnonzero(end < len(t_s))
    begin = begin[t_s[end[begin]] - t_s[begin] < _NEAR_S]
    end = end[begin]
    span_s = (t_s[end] - t_s[begin])[:, None]
    gravity_n_mps2 = origin.gravity_n_mps2(fixes.p_n_m[begin])
    f_n_mps2 = (v_n_mps[end] - v_n_mps[begin]) / span_s - gravity_n_mps2
    noise_mps2 = np.linalg.norm(sigma_mps[begin], axis=1) * np.sqrt(2) / span_s[:, 0]
    some = np.linalg.norm(f_n_mps2, axis=1) > np.maximum(G_MPS2 / 2, 3 * noise_mps2)
    return MeanForces(t_s[begin][some], t_s[end][some], f_n_mps2[some]).within(-np.inf, np.inf)


def unit_finding(imu: Imu, forces: MeanForces | None) -> Finding | None:
    """Return a unit of specific force that its size excludes.

    By the forces of a track within the record; else by gravity, as if the body were at rest.
    """
    size, rate_hz = np.linalg.norm(imu.f_b_mps2, axis=1), 1.0 / float(np.median(np.diff(imu.t_s)))
    spans = None if forces is None else forces.within(imu.t_s[0], imu.t_s[-1])
    if spans is None:
        expected_mps2, mean_mps2 = np.array([G_MPS2]), np.median(size, keepdims=True)
    else:
        expected_mps2 = np.linalg.norm(spans.f_n_mps2, axis=1)
        mean_mps2 = spans.mean_of(imu.t_s, size)
    ratio = float(np.median(mean_mps2 / expected_mps2))
    text = (
        f"the median of |f| is {np.median(size):.3g} m/s2, {ratio:.3g} of what "
        f"{'gravity requires' if spans is None else 'velocities and gravity require'}: "
    )
    for unit, factor in (("in g", G_MPS2), ("velocity increments", rate_hz)):
        if abs(ratio - 1) > _TOLERANCE and abs(ratio * factor - 1) < _TOLERANCE:
            text += f"specific force is {unit}"
            return Finding("imu unit", text, f"multiply by {factor:.6g}", _FORCES, certain=True)
    block = min(max(1, round(_MEAN_S * rate_hz)), len(size))
    blocks = imu.f_b_mps2[: len(size) // block * block].reshape(-1, block, 3)
    steady_mps2 = np.median(np.linalg.norm(blocks.mean(axis=1), axis=1))
    if abs(steady_mps2 / np.median(expected_mps2) / G_MPS2 - 1) < _TOLERANCE:
        text += "specific force is multiplied by 9.81 twice"
        return Finding("imu unit", text, f"divide by {G_MPS2:g}", _FORCES, certain=True)
    if ratio < (_TOLERANCE if spans is None else 1 - _TOLERANCE):
        text += "gravity is removed, or an axis is missing"
        mend = "specific force is required, (0, 0, -9.81) at rest"
        return Finding("imu gravity", text, mend, _FORCES, certain=spans is not None)
    return None


def magnetometer_finding(
    sensor: Magnetometer, imu: Imu, forces: MeanForces | None
) -> Finding | None:
    """Return a field at a wrong angle to specific force, beyond hard iron and the spread."""
    first_s, last_s = max(sensor.t_s[0], imu.t_s[0]), min(sensor.t_s[-1], imu.t_s[-1])
    spans = None if forces is None else forces.within(first_s, last_s)
    if spans is None:
        return None
    force_mps2 = np.linalg.norm(spans.f_n_mps2, axis=1)
    field_ut = np.linalg.norm(sensor.field_b_ut, axis=1, keepdims=True).clip(1e-12)
    field_b = interpolate(imu.t_s, sensor.t_s, sensor.field_b_ut / field_ut)
    field_n = sensor.field_n_ut / np.linalg.norm(sensor.field_n_ut)
    measured = spans.mean_of(imu.t_s, (imu.f_b_mps2 * field_b).sum(axis=1)) / force_mps2
    nominal = spans.f_n_mps2 @ field_n / force_mps2
    error = np.stack([measured - nominal, measured + nominal])  # as given, reversed
    iron = sensor.hard_iron_ut / float(np.median(field_ut))
    sigma = float(np.hypot(iron, error.std(axis=1).min()))
    fits = np.abs(np.median(error, axis=1)) < -sigma * ndtri(FALSE_ALARM / 2)
    if fits[0]:
        return None
    medians = np.clip([np.median(measured), np.median(nominal)], -1.0, 1.0)
    shown_deg, nominal_deg = np.degrees(np.arccos(medians))
    text = (
        f"the field is at {shown_deg:.0f} deg to specific force, by field_n_ut and the track at "
        f"{nominal_deg:.0f}"
    )
    mend = "reverse fx, fy, fz (specific force at rest is up) or the field's three axes"
    mend = mend if fits[1] else "its axes, or hard_iron_ut, are wrong"
    where = f"{_FORCES}; [magnetometer] samples, field_n_ut"
    return Finding("magnetometer axes", text, mend, where, certain=bool(fits[1]))
