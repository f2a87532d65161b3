"""Barometer and magnetometer: what surrounds the vehicle, and what they make of it."""

import numpy as np

from fgnav.geometry.earth import geodetic
from fgnav.geometry.rotations import transpose
from fgnav.types.surroundings import Barometer, Magnetometer
from fgnav_sim.gauss_markov import gauss_markov
from fgnav_sim.scenario import Scenario
from fgnav_sim.sensors.surroundings_tables import BarometerTable, MagnetometerTable


def press(sensor: BarometerTable, scenario: Scenario, *, rng: np.random.Generator) -> Barometer:
    """Return the heights that a barometer tells: offset, drift and white noise on the true ones."""
    t_s, port_b_m = scenario.epochs_s(sensor.rate_hz), np.array(sensor.position_b_m)
    p_n_m, _, _ = scenario.motion(t_s).at(port_b_m)
    height_m = geodetic(scenario.origin.frame.to_e(p_n_m))[:, 2]
    height_m += sensor.offset_m * rng.standard_normal()
    height_m += sensor.noise_m * rng.standard_normal(len(t_s))
    drift = gauss_markov(sensor.wander_time_s, 1 / sensor.rate_hz, (len(t_s),), rng=rng)
    return Barometer(
        t_s=t_s,
        height_m=height_m + sensor.wander_m * drift,
        position_b_m=port_b_m,
        noise_m=sensor.noise_m,
        offset_m=sensor.offset_m,
        wander_m=sensor.wander_m,
        wander_time_s=sensor.wander_time_s,
    )


def point(
    sensor: MagnetometerTable, scenario: Scenario, *, rng: np.random.Generator
) -> Magnetometer:
    """Return the field that a magnetometer tells: the Earth's, the vehicle's own, white noise."""
    t_s, field_n_ut = scenario.epochs_s(sensor.rate_hz), np.array(sensor.field_n_ut)
    hard_iron_b_ut = sensor.hard_iron_ut * rng.standard_normal(3)
    noise_ut = sensor.noise_ut * rng.standard_normal((len(t_s), 3))
    return Magnetometer(
        t_s=t_s,
        field_b_ut=transpose(scenario.motion(t_s).R_nb) @ field_n_ut + hard_iron_b_ut + noise_ut,
        field_n_ut=field_n_ut,
        noise_ut=sensor.noise_ut,
        hard_iron_ut=sensor.hard_iron_ut,
    )
