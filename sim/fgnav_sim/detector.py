"""Quadrant photodetector: the photocurrents that a beacon in view makes."""

import math

import numpy as np

from fgnav.checks import FloatArray
from fgnav.flight import Seeker
from fgnav.rotations import transpose
from fgnav.seeker import spot_fraction
from fgnav_sim.scenario import Scenario, SeekerTable


def calibration() -> FloatArray:
    """Return the built-in calibration, rows of r_quad and r_c, (13, 2).

    The paper's measured table is not public. This one has the shape any such detector shows: the
    logarithm of two currents grows without bound while the spot nears the rim, so the radius
    saturates, ``r_c = tanh(0.4 r_quad)``, to four digits as a laboratory would note it.
    """
    r_quad = np.linspace(0.0, 6.0, 13)
    return np.stack([r_quad, np.round(np.tanh(0.4 * r_quad), 4)], axis=1)


def watch(sensor: SeekerTable, scenario: Scenario, *, rng: np.random.Generator) -> Seeker | None:
    """Return the currents while the beacon is within range and field of view; None if it never is.

    The inverse of the reconstruction that the flight format defines: the spot of direction ``u_b``
    is at ``focal_length (u_y, u_z) / u_x``, its radius gives ``r_quad`` through the inverted
    calibration, and ``r_quad`` along the spot's direction is ``(ln I4/I2, ln I1/I3)``. Automatic
    gain keeps the sum of the currents at one, and their noise at a constant share of it.
    """
    t_s = scenario.epochs_s(sensor.rate_hz)
    noise = rng.standard_normal((len(t_s), 4))  # drawn for all times: the path changes no noise
    state = scenario.motion(t_s)
    place_n_m, _, _ = state.at(np.array(sensor.position_b_m))
    landmark_n_m = scenario.origin.frame.to_n(sensor.landmark.frame.p_e_m[None])[0]
    sight_b_m = np.einsum("nij,nj->ni", transpose(state.R_nb), landmark_n_m - place_n_m)
    ahead_m = np.where(sight_b_m[:, 0] > 0, sight_b_m[:, 0], np.nan)
    spot_m = sensor.focal_length_m * sight_b_m[:, 1:] / ahead_m[:, None]
    # A comparison with NaN is false: a beacon behind is not seen.
    off_axis = np.linalg.norm(spot_m, axis=1) / sensor.focal_length_m
    in_view = off_axis <= np.tan(np.radians(sensor.field_of_view_deg))
    seen = in_view & (np.linalg.norm(sight_b_m, axis=1) <= sensor.range_m)
    if not seen.any():
        return None
    currents = _currents(spot_m[seen] / sensor.detector_radius_m)
    currents += _current_noise(sensor) * noise[seen]
    return Seeker(
        t_s=t_s[seen],
        currents=currents,
        position_b_m=np.array(sensor.position_b_m),
        landmark_n_m=landmark_n_m,
        detector_radius_m=sensor.detector_radius_m,
        focal_length_m=sensor.focal_length_m,
        calibration=calibration(),
    )


def _currents(spot: FloatArray) -> FloatArray:
    """Return currents, (k, 4), whose sum is one, of spots in units of the radius, (k, 2)."""
    radius = np.linalg.norm(spot, axis=1)
    scale = _inverted(radius) / np.where(radius > 0, radius, 1.0)
    x, y = scale * spot[:, 0], scale * spot[:, 1]
    raw = np.exp(0.5 * np.stack([y, -x, -y, x], axis=1))  # 4 faces +x, 2 -x, 1 +y, 3 -y
    return np.asarray(raw / raw.sum(axis=1, keepdims=True))


def _current_noise(sensor: SeekerTable) -> float:
    """Return the standard deviation of a current whose effect at the centre is the one asked for.

    There each current is 1/4, so ``ln I4/I2`` has sigma ``4 sqrt(2)`` times that of a current, and
    the direction moves by ``slope R_det / focal_length`` times as much.
    """
    step = 1e-3
    slope = spot_fraction(calibration(), np.array([step]))[0] / step
    per_logarithm_rad = float(slope) * sensor.detector_radius_m / sensor.focal_length_m
    return sensor.line_of_sight_noise_rad / (math.sqrt(32) * per_logarithm_rad)


def _inverted(radius: FloatArray) -> FloatArray:
    """Return r_quad of spot radii, by bisection: the reconstruction's spline increases, (k,)."""
    table = calibration()
    low, high = np.zeros_like(radius), np.full_like(radius, table[-1, 0])
    for _ in range(60):  # halves 6 down to below the last bit
        middle = 0.5 * (low + high)
        above = spot_fraction(table, middle) > radius
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return np.asarray(0.5 * (low + high))
