"""The angle of specific force and magnetic field: the same from the body as from the ground.

However a body turns, ``f_b . m_b = f_n . m_n``; the track knows the mean of f_n, a chart m_n. So an
accelerometer that shows gravity where specific force is wanted, or a magnetometer with its signs
reversed, is told from a body on its back: on a straight path nothing else tells these apart.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.interpolation import interpolate
from fgnav.identification.track.windows import FALSE_ALARM
from fgnav.set_up.findings import Finding
from fgnav.set_up.mean_force import MeanForces
from fgnav.types.flight import Imu
from fgnav.types.surroundings import Magnetometer


def angle_findings(imu: Imu, sensor: Magnetometer, forces: MeanForces) -> list[Finding]:
    """Return a finding where hard iron and the spread over spans do not explain the angle."""
    from scipy.stats import norm  # noqa: PLC0415  # lazy: a slow import

    spans = forces.within(sensor.t_s[0], sensor.t_s[-1])
    if len(sensor.t_s) < 2 or spans is None:
        return []
    size_mps2 = np.linalg.norm(spans.f_n_mps2, axis=1)
    field_b = _unit(interpolate(imu.t_s, sensor.t_s, sensor.field_b_ut))
    seen = spans.mean_of(imu.t_s, (imu.f_b_mps2 * field_b).sum(axis=1)) / size_mps2
    stated = spans.f_n_mps2 @ _unit(sensor.field_n_ut) / size_mps2
    iron = sensor.hard_iron_ut / float(np.median(np.linalg.norm(sensor.field_b_ut, axis=1)))
    off = np.stack([seen - stated, seen + stated])  # as stated, reversed
    # What a wrong sign leaves varies with the force: noise is what the better of both leaves.
    sigma = float(np.hypot(iron, off.std(axis=1).min()))
    fits = np.abs(np.median(off, axis=1)) < sigma * norm.isf(FALSE_ALARM / 2)
    if fits[0]:
        return []
    shown_deg, stated_deg = (
        np.degrees(np.arccos(np.clip(np.median(cosine), -1.0, 1.0))) for cosine in (seen, stated)
    )
    mend = "reverse fx, fy, fz (specific force at rest is up) or the field's three axes"
    return [
        Finding(
            name="magnetometer axes",
            where="[imu] samples, fx_mps2, fy_mps2, fz_mps2; [magnetometer] samples, field_n_ut",
            text=(
                f"the field is {shown_deg:.0f} deg off specific force, by field_n_ut and the "
                f"track {stated_deg:.0f}"
            ),
            mend=mend if fits[1] else "its axes, or hard_iron_ut, are not as stated",
            certain=bool(fits[1]),
        )
    ]


def _unit(vectors: FloatArray) -> FloatArray:
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(size > 0, size, 1.0))
