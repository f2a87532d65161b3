"""Delays of signals: troposphere, ionosphere, and the satellite's own electronics."""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.earth import C_MPS, geodetic
from fgnav.gnss.atmosphere import klobuchar_m, saastamoinen_m
from fgnav.gnss.orbits.satellites import group_delay_s
from fgnav.gnss.signals import frequency_hz
from fgnav.types.orbits import BroadcastOrbits, PreciseOrbits
from fgnav_sim.gnss.channels import Channels, places_e_m
from fgnav_sim.gnss.tables import GnssTable
from fgnav_sim.propagation.light_time import Links
from fgnav_sim.scenario import Scenario


def delays_m(
    sensor: GnssTable,
    scenario: Scenario,
    orbits: BroadcastOrbits | PreciseOrbits,
    channels: Channels,
    t_s: FloatArray,
    links: Links,
) -> tuple[FloatArray, FloatArray]:
    """Return the delays of code and phase, m, (n, m), the same at all antennas.

    The air is that of the reference antenna: 1 m of height changes it by 0.3 mm at the zenith.
    """
    times_s = np.repeat(t_s[:, None], len(channels.satellites), axis=1)
    group_m = C_MPS * group_delay_s(
        orbits,
        channels.satellites,
        channels.signals,
        times_s,
        precise_clocks=bool(sensor.orbits),
    )
    if not sensor.atmosphere:
        return group_m, np.zeros_like(group_m)
    antenna = geodetic(places_e_m(scenario, t_s))
    air_m = saastamoinen_m(antenna, links.elevation_rad)
    if isinstance(orbits, PreciseOrbits):  # no messages, so no model of the ionosphere either
        return group_m + air_m, air_m
    ions_m = klobuchar_m(
        orbits.klobuchar,
        antenna,
        links.elevation_rad,
        links.azimuth_rad,
        scenario.start_gps_s + t_s,
    )
    pairs = zip(channels.satellites, channels.signals, strict=True)
    hz = np.array([frequency_hz(*pair) for pair in pairs])
    ions_m *= (frequency_hz("G", "1C") / hz) ** 2
    return group_m + air_m + ions_m, air_m - ions_m
