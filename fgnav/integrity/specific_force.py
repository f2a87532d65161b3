"""Specific force against the change of velocity, by magnitude alone: a test without any attitude.

Between two fixes, whatever the attitude,

    |mean f| <= |(v_1 - v_0) / T - g| <= mean |f|

but for noise: the left is less the more the body turns, the right is more the more it vibrates.
The residual is how far the middle is outside, its variance that of both velocities and of the
accelerometer's bias and noise. Where nothing determines the heading, no other innovation tests the
accelerometer.
"""

import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.gnss.single_point.fixes import fixes_by_code
from fgnav.graph.innovations import InnovationSeries
from fgnav.types.flight import Flight

NAME = "specific force"
_LONGEST_S = 2.0  # between fixes: over more, forces vary


def force_innovations(flight: Flight) -> InnovationSeries | None:
    """Return the normalised innovations of specific force; None without velocities or samples."""
    imu, fixes = flight.imu, flight.first_fixes
    if imu is None or len(imu.t_s) < 2:
        return None
    try:
        fixes = fixes_by_code(flight) if flight.observations is not None else fixes
    except NoSolutionError:
        return None
    if fixes is None or fixes.v_n_mps is None or fixes.velocity_sigma_mps is None:
        return None
    g_n_mps2 = flight.origin.gravity_n_mps2(fixes.p_n_m)[:-1]
    t_s, span_s = fixes.t_s, np.diff(fixes.t_s)
    first, last = np.searchsorted(imu.t_s, t_s[:-1]), np.searchsorted(imu.t_s, t_s[1:])
    kept = (last > first) & (span_s < _LONGEST_S) & np.isfinite(np.diff(fixes.v_n_mps[:, 0]))
    count = np.maximum(last - first, 1)[:, None]
    sums = np.cumsum(np.column_stack([imu.f_b_mps2, np.linalg.norm(imu.f_b_mps2, axis=1)]), axis=0)
    means = np.diff(np.vstack([np.zeros(4), sums])[[first, last]], axis=0)[0] / count
    lower, most = np.linalg.norm(means[:, :3], axis=1), means[:, 3]
    a_n_mps2 = np.diff(fixes.v_n_mps, axis=0) / span_s[:, None]
    expected = np.linalg.norm(a_n_mps2 - g_n_mps2, axis=1)
    variance: FloatArray = (fixes.velocity_sigma_mps[1:] ** 2).mean(axis=1) * 2 / span_s**2
    variance += imu.accelerometer_bias_mps2**2
    variance += imu.accelerometer_noise_mps2_per_sqrt_hz**2 / span_s
    squared = ((expected - expected.clip(lower, most)) ** 2 / variance)[kept]
    return InnovationSeries(NAME, t_s[1:][kept], squared, np.ones(len(squared), dtype=np.int64))
