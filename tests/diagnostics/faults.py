"""Mistakes that people make in a set-up, each made on a right flight; and who is to be blamed."""

from dataclasses import replace

import numpy as np

G_MPS2 = 9.80665


def antennas_exchanged(flight, rng):
    i, j = sorted(rng.choice(len(flight.antennas), 2, replace=False))
    places = [a.position_b_m for a in flight.antennas]
    places[i], places[j] = places[j], places[i]
    return moved(flight, places), f"{flight.antennas[i].name} and {flight.antennas[j].name}"


def antenna_misplaced(flight, rng):
    i = rng.integers(len(flight.antennas))
    places = [a.position_b_m for a in flight.antennas]
    places[i] = places[i] + rng.uniform(0.2, 0.4) * unit(rng)
    return moved(flight, places), f"{flight.antennas[i].name} is not at its place"


def lever_arm_reversed(flight, rng):  # noqa: ARG001
    return with_imu(flight, position_b_m=-flight.imu.position_b_m), "imu lever arm"


def accelerations_in_g(flight, rng):  # noqa: ARG001
    return with_imu(flight, f_b_mps2=flight.imu.f_b_mps2 / G_MPS2), "imu unit"


def axes_wrong(flight, rng):
    while True:
        order, signs = rng.permutation(3), rng.choice([-1.0, 1.0], 3)
        if (order != np.arange(3)).any() or (signs < 0).any():
            break
    return with_imu(flight, f_b_mps2=signs * flight.imu.f_b_mps2[:, order]), "imu axes"


def rates_in_degrees(flight, rng):  # noqa: ARG001
    return with_imu(flight, w_b_radps=np.degrees(flight.imu.w_b_radps)), "gyroscope unit"


def increments_for_rates(flight, rng):  # noqa: ARG001
    step_s = np.median(np.diff(flight.imu.t_s))
    return with_imu(flight, f_b_mps2=flight.imu.f_b_mps2 * step_s), "increments"


def clock_off(flight, rng):
    late_s = rng.choice([-1, 1]) * rng.uniform(0.01, 0.1)
    return with_imu(flight, t_s=flight.imu.t_s + late_s), "imu clock"


def utc_for_gps(flight, rng):
    return with_imu(flight, t_s=flight.imu.t_s + rng.choice([-18.0, 18.0])), "UTC"


def utc_in_observations(flight, rng):  # noqa: ARG001
    o = flight.observations
    late = replace(o, t_s=o.t_s - 18.0, tag_s=o.tag_s - 18.0)
    return replace(flight, observations=late), "UTC"


def landmark_off(flight, rng):
    shift_m = rng.uniform(10.0, 15.0) * across(flight, rng)
    photodetector = replace(
        flight.photodetector, landmark_n_m=flight.photodetector.landmark_n_m + shift_m
    )
    return replace(flight, photodetector=photodetector), "photodetector landmark"


def detector_turned(flight, rng):
    """Turn about an axis across the boresight: the spot moves on the detector."""
    angle = rng.uniform(0, 2 * np.pi)
    return replace(
        flight,
        photodetector=turned(flight.photodetector, 2.0 * np.array([np.cos(angle), np.sin(angle)])),
    ), "photodetector detector"


FAULTS = {
    f.__name__.replace("_", " "): f
    for f in (
        antennas_exchanged,
        antenna_misplaced,
        lever_arm_reversed,
        accelerations_in_g,
        axes_wrong,
        rates_in_degrees,
        increments_for_rates,
        clock_off,
        utc_for_gps,
        utc_in_observations,
        landmark_off,
        detector_turned,
    )
}
NEEDS_PHOTODETECTOR = ("landmark off", "detector turned")


def moved(flight, places_b_m):
    return replace(
        flight,
        antennas=tuple(
            replace(a, position_b_m=p) for a, p in zip(flight.antennas, places_b_m, strict=True)
        ),
    )


def with_imu(flight, **change):
    return replace(flight, imu=replace(flight.imu, **change))


def unit(rng):
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def across(flight, rng):
    """A direction that is not along the line of sight, which the sights could not tell."""
    to_n_m = flight.photodetector.landmark_n_m - flight.truth.p_n_m[-1]
    v = np.cross(to_n_m, unit(rng))
    return v / np.linalg.norm(v)


def turned(photodetector, degrees_yz):
    """The detector whose boresight leans, in the currents that it would then have given."""
    from fgnav.photodetector import line_of_sight

    sight = line_of_sight(photodetector)
    keep = np.isin(photodetector.t_s, sight.t_s)
    spot = sight.e_b[:, 1:] / sight.e_b[:, :1] * photodetector.focal_length_m
    spot = spot + photodetector.focal_length_m * np.radians(degrees_yz)
    r_c = np.linalg.norm(spot, axis=1) / photodetector.detector_radius_m
    on = r_c < 0.95 * photodetector.calibration[-1, 1]
    r_quad = np.interp(r_c[on], photodetector.calibration[:, 1], photodetector.calibration[:, 0])
    logs = spot[on] / np.linalg.norm(spot[on], axis=1, keepdims=True) * r_quad[:, None]
    i2, i3 = np.ones(len(logs)), np.ones(len(logs))
    currents = np.stack([np.exp(logs[:, 1]), i2, i3, np.exp(logs[:, 0])], axis=1)
    return replace(photodetector, t_s=photodetector.t_s[keep][on], currents=currents)
