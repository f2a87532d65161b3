"""Quadrant photodetector: the photocurrents that a beacon in view makes."""

import math

import numpy as np

from fgnav.checks import FloatArray, Unused
from fgnav.geometry.rotations import exp, transpose
from fgnav.photodetector import spot_fraction
from fgnav.types.flight import Photodetector
from fgnav_sim.scenario import OpticsTable, PhotodetectorTable, Scenario


def calibration() -> FloatArray:
    """Return the built-in calibration, rows of r_quad and r_c, (13, 2).

    The paper's measured table is not public. This one has the shape any such detector shows: the
    logarithm of two currents grows without bound while the spot nears the rim, so the radius
    saturates, ``r_c = tanh(0.4 r_quad)``, to four digits as a laboratory would note it.
    """
    r_quad = np.linspace(0.0, 6.0, 13)
    return np.stack([r_quad, np.round(np.tanh(0.4 * r_quad), 4)], axis=1)


def watch(
    sensor: PhotodetectorTable, scenario: Scenario, *, rng: np.random.Generator
) -> Photodetector | None:
    """Return the currents while the beacon is within range and field of view; None if it never is.

    The inverse of the reconstruction that the flight format defines: the spot of direction ``u_b``
    is at ``focal_length (u_y, u_z) / u_x``, its radius gives ``r_quad`` through the inverted
    calibration, and ``r_quad`` along the spot's direction is ``(ln I4/I2, ln I1/I3)``. Where the
    optics are given, currents are amperes; else automatic gain keeps their sum at one, and their
    noise at a constant share of it.
    """
    t_s = scenario.epochs_s(sensor.rate_hz)
    noise = rng.standard_normal((len(t_s), 4))  # drawn for all times: the path changes no noise
    misalignment_rad = sensor.misalignment_rad * rng.spawn(1)[0].standard_normal((1, 3))
    state = scenario.motion(t_s)
    position_n_m, _, _ = state.at(np.array(sensor.position_b_m))
    landmark_n_m = scenario.origin.frame.to_n(sensor.landmark.frame.p_e_m[None])[0]
    sight_b_m = np.einsum("nij,nj->ni", transpose(state.R_nb), landmark_n_m - position_n_m)
    sight_b_m = sight_b_m @ exp(misalignment_rad)[0]  # in the detector's own axes
    ahead_m = np.where(sight_b_m[:, 0] > 0, sight_b_m[:, 0], np.nan)
    spot_m = sensor.focal_length_m * sight_b_m[:, 1:] / ahead_m[:, None]
    # A comparison with NaN is false: a beacon behind is not seen.
    tangent = np.linalg.norm(spot_m, axis=1) / sensor.focal_length_m
    in_view = tangent <= np.tan(np.radians(sensor.field_of_view_deg))
    visible = in_view & (np.linalg.norm(sight_b_m, axis=1) <= sensor.range_m)
    if not visible.any():
        return None
    distance_m = np.linalg.norm(sight_b_m[visible], axis=1)
    currents = _currents(spot_m[visible] / sensor.detector_radius_m)
    if sensor.optics is None:
        currents += _current_noise(sensor) * noise[visible]
    else:
        currents *= _total_a(sensor, sensor.optics, distance_m, spot_m[visible])[:, None]
        currents = _read(sensor.optics, currents + sensor.optics.noise_a * noise[visible])
    for shade in sensor.occlusions:
        currents[shade.holds(t_s[visible]), shade.quadrant - 1] = 0.0
    return Photodetector(
        t_s=t_s[visible],
        currents=currents,
        position_b_m=np.array(sensor.position_b_m),
        landmark_n_m=landmark_n_m,
        detector_radius_m=sensor.detector_radius_m,
        focal_length_m=sensor.focal_length_m,
        calibration=calibration(),
    )


def saturated(sensor: PhotodetectorTable, photodetector: Photodetector) -> tuple[Unused, ...]:
    """Count the samples with a current that was cut."""
    limit_a = sensor.optics.saturation_a if sensor.optics else None
    if limit_a is None or not (cut := (photodetector.currents >= limit_a).any(axis=1)).any():
        return ()
    reason = f"a current saturated at {limit_a:g} A"
    return (Unused(what="photodetector sample", reason=reason, count=int(cut.sum())),)


def _total_a(
    sensor: PhotodetectorTable, optics: OpticsTable, distance_m: FloatArray, spot_m: FloatArray
) -> FloatArray:
    """Return the sum of the currents that the beacon's irradiance makes, (k,)."""
    irradiance = optics.beacon_w_per_sr / distance_m**2
    irradiance *= np.exp(-optics.attenuation_per_m * distance_m)
    radius_m = np.linalg.norm(spot_m, axis=1)
    cosine = 1 / np.sqrt(1 + (radius_m / sensor.focal_length_m) ** 2)
    watts = irradiance * np.pi * optics.aperture_radius_m**2 * cosine
    share = share_within(radius_m, optics.spot_radius_m, sensor.detector_radius_m)
    return np.asarray(optics.responsivity_a_per_w * watts * share)


def share_within(distance: FloatArray, small: float, large: float) -> FloatArray:
    """Return the share of small circles that lies within a large one, centres apart, (k,).

    The lens common to two circles is a segment of each.
    """
    if small > large:
        return share_within(distance, large, small) * (large / small) ** 2
    separation = np.clip(distance, large - small, large + small)
    near = np.where(separation > 0, separation, 1.0)  # equal circles at one place
    angle_small = np.arccos(np.clip((near**2 + small**2 - large**2) / (2 * near * small), -1, 1))
    angle_large = np.arccos(np.clip((near**2 + large**2 - small**2) / (2 * near * large), -1, 1))
    segments = small**2 * (angle_small - 0.5 * np.sin(2 * angle_small))
    segments += large**2 * (angle_large - 0.5 * np.sin(2 * angle_large))
    return np.where(separation > 0, segments / (np.pi * small**2), 1.0)


def _read(optics: OpticsTable, currents_a: FloatArray) -> FloatArray:
    """Return currents as read: none of faint ones, no more of strong."""
    faint = currents_a < optics.threshold_sigmas * optics.noise_a
    largest_a = np.inf if optics.saturation_a is None else optics.saturation_a
    return np.where(faint, 0.0, np.minimum(currents_a, largest_a))


def _currents(spot: FloatArray) -> FloatArray:
    """Return currents, (k, 4), whose sum is one, of spots in units of the radius, (k, 2)."""
    radius = np.linalg.norm(spot, axis=1)
    scale = _inverted(radius) / np.where(radius > 0, radius, 1.0)
    x, y = scale * spot[:, 0], scale * spot[:, 1]
    raw = np.exp(0.5 * np.stack([y, -x, -y, x], axis=1))  # 4 faces +x, 2 -x, 1 +y, 3 -y
    return np.asarray(raw / raw.sum(axis=1, keepdims=True))


def _current_noise(sensor: PhotodetectorTable) -> float:
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
