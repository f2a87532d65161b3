"""Units of inertial samples and of the magnetometer, by magnitudes that no rotation changes.

However a body turns, the mean size of specific force over a span is at least that of its mean in
axes that do not turn: the change of velocity less gravity. A quotient near one is right; one near
1/9.8 is a unit of g. In the same way the angle between specific force and the magnetic field is the
same in body axes and in those of the ground.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from fgnav.checks import FloatArray
from fgnav.diagnostics.contents import Finding
from fgnav.diagnostics.track import velocities
from fgnav.diagnostics.windows import FALSE_ALARM
from fgnav.geometry.earth import Origin
from fgnav.geometry.interpolation import interpolate
from fgnav.types.flight import Fixes, Imu
from fgnav.types.surroundings import Magnetometer

G_MPS2 = 9.80665  # exact, the unit g
FORCES = "[imu] samples, fx_mps2, fy_mps2, fz_mps2"
RATES = "[imu] samples, wx_radps, wy_radps, wz_radps"
_TOLERANCE = 0.2  # of a factor: scale factors and biases are smaller
_NEAR_S, _SPAN_S = 2.5, 1.0  # over which velocities of 0.5 m/s noise show gravity to 7 %
_MIN_SPANS = 10
_MEAN_S = 0.5  # of means that hold no vibration
_RELATED = 0.5  # correlation of rates with the rotation of gravity
_ALIKE = 3.0  # factor to which a slope at such a correlation is known


class MeanForces(NamedTuple):
    """Mean specific forces, (k, 3), frame n, over spans of a track from begin to end, (k,)."""

    begin_s: FloatArray
    end_s: FloatArray
    f_n_mps2: FloatArray

    def within(self, t_s: FloatArray) -> "MeanForces | None":
        """Return those within a record; None where there are fewer than ten."""
        inside = (self.begin_s >= t_s[0]) & (self.end_s <= t_s[-1])
        if inside.sum() < _MIN_SPANS:
            return None
        return MeanForces(self.begin_s[inside], self.end_s[inside], self.f_n_mps2[inside])

    def mean_of(self, t_s: FloatArray, values: FloatArray) -> FloatArray:
        """Return means over the spans, (k,), of values at times, (m,)."""
        steps = (values[1:] + values[:-1]) / 2 * np.diff(t_s)
        total = np.concatenate([[0.0], np.cumsum(steps)])
        gained = np.interp(self.end_s, t_s, total) - np.interp(self.begin_s, t_s, total)
        return np.asarray(gained / (self.end_s - self.begin_s))


def mean_forces(fixes: Fixes, origin: Origin) -> MeanForces | None:
    """Return mean specific forces of a track that exceed half of gravity and their noise.

    None where there are fewer than ten.
    """
    v_n_mps, sigma_mps = velocities(fixes)
    if v_n_mps is None:
        return None
    t_s = fixes.t_s
    end = np.searchsorted(t_s, t_s + _SPAN_S - 1e-9)
    begin = np.flatnonzero(end < len(t_s))
    begin = begin[t_s[end[begin]] - t_s[begin] < _NEAR_S]
    end = end[begin]
    span_s = (t_s[end] - t_s[begin])[:, None]
    f_n_mps2 = (v_n_mps[end] - v_n_mps[begin]) / span_s
    f_n_mps2 = f_n_mps2 - origin.gravity_n_mps2(fixes.p_n_m[begin])
    noise_mps2 = np.linalg.norm(sigma_mps[begin], axis=1) * np.sqrt(2) / span_s[:, 0]
    some = np.linalg.norm(f_n_mps2, axis=1) > np.maximum(G_MPS2 / 2, 3 * noise_mps2)
    if some.sum() < _MIN_SPANS:
        return None
    return MeanForces(t_s[begin][some], t_s[end][some], f_n_mps2[some])


def unit_findings(imu: Imu, forces: MeanForces | None, *, at_rest: bool) -> list[Finding]:
    """Return units of specific force and of rates that magnitudes exclude.

    ``at_rest``: whether to expect gravity where no forces of a track are known.
    """
    if len(imu.t_s) < 2:
        return []
    forces = None if forces is None else forces.within(imu.t_s)
    if forces is None and not at_rest:
        return _rate_findings(imu)
    return [*_force_findings(imu, forces), *_rate_findings(imu)]


def _force_findings(imu: Imu, forces: MeanForces | None) -> list[Finding]:
    """Test the mean size of specific force over that of the track: g, increments, g twice."""
    size = np.linalg.norm(imu.f_b_mps2, axis=1)
    expected_mps2, mean_mps2 = np.full(1, G_MPS2), np.median(size, keepdims=True)
    if forces is not None:
        expected_mps2 = np.linalg.norm(forces.f_n_mps2, axis=1)
        mean_mps2 = forces.mean_of(imu.t_s, size)
    ratio = float(np.median(mean_mps2 / expected_mps2))
    rate_hz = 1.0 / float(np.median(np.diff(imu.t_s)))
    evidence = (
        f"the median of |f| is {np.median(size):.3g} m/s2, {ratio:.3g} of what "
        f"{'gravity' if forces is None else 'velocities and gravity'} require"
    )
    for unit, factor in (("in g", G_MPS2), ("velocity increments", rate_hz)):
        if abs(ratio - 1) > _TOLERANCE and abs(ratio * factor - 1) < _TOLERANCE:
            text = f"{evidence}: specific force is {unit}"
            mend = f"multiply by {factor:.6g}"
            return [Finding(name="imu unit", text=text, mend=mend, where=FORCES, certain=True)]
    steady_mps2 = np.linalg.norm(_means(imu, imu.f_b_mps2), axis=1)  # without vibration
    if abs(np.median(steady_mps2) / np.median(expected_mps2) / G_MPS2 - 1) < _TOLERANCE:
        text = f"{evidence}: specific force is multiplied by 9.81 twice"
        mend = f"divide by {G_MPS2:g}"
        return [Finding(name="imu unit", text=text, mend=mend, where=FORCES, certain=True)]
    if ratio < 1 - _TOLERANCE and (forces is not None or ratio < _TOLERANCE):
        text = f"{evidence}: gravity is removed, or an axis is missing"
        mend = "specific force is required, (0, 0, -9.81) at rest"
        certain = forces is not None
        return [Finding(name="imu gravity", text=text, mend=mend, where=FORCES, certain=certain)]
    return []


def _rate_findings(imu: Imu) -> list[Finding]:
    """Compare the gyroscope with the rotation of specific force in body axes."""
    if imu.w_b_radps is None:
        return []
    f, w = _means(imu, imu.f_b_mps2), _means(imu, imu.w_b_radps)
    step_s = float(np.median(np.diff(imu.t_s)))
    rates = -np.cross(w, f) * _per_mean(imu) * step_s
    rates, seen = (rates[1:] + rates[:-1]) / 2, f[1:] - f[:-1]
    square, product = float((rates**2).sum()), float((rates * seen).sum())
    if len(rates) < 2 * _MIN_SPANS or square == 0 or product <= 0:
        return []
    slope = product / square
    if product / np.sqrt(square * (seen**2).sum()) < _RELATED or 1 / _ALIKE < slope < _ALIKE:
        return []
    for unit, factor in (("in degrees per second", np.pi / 180), ("increments", 1 / step_s)):
        if factor / _ALIKE < slope < _ALIKE * factor:
            text = f"rates are {unit}: gravity rotates {slope:.3g} times as fast as they"
            mend = f"multiply by {factor:.6g}"
            return [Finding(name="gyroscope unit", text=text, mend=mend, where=RATES, certain=True)]
    return []


def _means(imu: Imu, x: FloatArray) -> FloatArray:
    """Return means of samples over half seconds, (m, 3)."""
    block = _per_mean(imu)
    count = len(x) // block
    return np.asarray(x[: count * block].reshape(count, block, 3).mean(axis=1))


def _per_mean(imu: Imu) -> int:
    return max(1, round(_MEAN_S / float(np.median(np.diff(imu.t_s)))))


def magnetometer_findings(
    sensor: Magnetometer, imu: Imu | None, forces: MeanForces | None
) -> list[Finding]:
    """Return a field of a wrong size, else one at a wrong angle to specific force.

    The size is outside of half to twice the Earth's beside three sigma of hard iron; the angle's
    noise is hard iron and the spread over spans.
    """
    size_ut = np.linalg.norm(sensor.field_b_ut, axis=1)
    earth_ut = float(np.linalg.norm(sensor.field_n_ut))
    iron_ut = 3 * np.sqrt(3.0) * sensor.hard_iron_ut
    wrong = (size_ut > 2 * earth_ut + iron_ut) | (size_ut < earth_ut / 2 - iron_ut)
    if len(wrong) >= 20 and wrong.mean() >= 0.05:
        begin_s, end_s = sensor.t_s[wrong][[0, -1]]
        text = (
            f"the field is {np.median(size_ut[wrong]):.3g} uT in {wrong.sum()} of {len(wrong)} "
            f"samples, {begin_s:.3f} to {end_s:.3f} s, the Earth's is {earth_ut:.3g} uT"
        )
        where, mend = "[magnetometer] samples, field_n_ut", "give both in microtesla"
        return [Finding(name="magnetometer unit", text=text, where=where, mend=mend)]
    if imu is None or forces is None or len(sensor.t_s) < 2:
        return []
    ends_s = np.stack([sensor.t_s[[0, -1]], imu.t_s[[0, -1]]])
    spans = forces.within(np.array([ends_s[:, 0].max(), ends_s[:, 1].min()]))
    return [] if spans is None else _angle_findings(sensor, imu, spans)


def _angle_findings(sensor: Magnetometer, imu: Imu, spans: MeanForces) -> list[Finding]:
    force_mps2 = np.linalg.norm(spans.f_n_mps2, axis=1)
    field_b = _unit(interpolate(imu.t_s, sensor.t_s, sensor.field_b_ut))
    measured = spans.mean_of(imu.t_s, (imu.f_b_mps2 * field_b).sum(axis=1)) / force_mps2
    nominal = spans.f_n_mps2 @ _unit(sensor.field_n_ut) / force_mps2
    iron = sensor.hard_iron_ut / float(np.median(np.linalg.norm(sensor.field_b_ut, axis=1)))
    error = np.stack([measured - nominal, measured + nominal])  # as given, reversed
    sigma = float(np.hypot(iron, error.std(axis=1).min()))
    fits = np.abs(np.median(error, axis=1)) < -sigma * ndtri(FALSE_ALARM / 2)
    if fits[0]:
        return []
    medians = np.clip([np.median(measured), np.median(nominal)], -1.0, 1.0)
    shown_deg, nominal_deg = np.degrees(np.arccos(medians))
    mend = "reverse fx, fy, fz (specific force at rest is up) or the field's three axes"
    return [
        Finding(
            name="magnetometer axes",
            where=f"{FORCES}; [magnetometer] samples, field_n_ut",
            text=(
                f"the field is at {shown_deg:.0f} deg to specific force, by field_n_ut and the "
                f"track at {nominal_deg:.0f}"
            ),
            mend=mend if fits[1] else "its axes, or hard_iron_ut, are wrong",
            certain=bool(fits[1]),
        )
    ]


def _unit(vectors: FloatArray) -> FloatArray:
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(size > 0, size, 1.0))
