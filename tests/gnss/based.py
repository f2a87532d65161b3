"""Flights of the gallery's demo with a base on the ground, and where their antenna truly was."""

from functools import cache

import msgspec
import numpy as np

from fgnav_sim.gnss.tables import Point
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.assembly.flights import GYROSCOPE
from tests.methods.simulated import SCENARIOS

NEAR = Point(latitude_deg=40.34, longitude_deg=-3.87, height_m=650.0)  # 1.4 km from the start


@cache
def flown(*, name="demo", base=NEAR, span_s=20.0, seed=1, gyroscope=False, **gnss):
    """Return a flight; the same object for the same arguments."""
    scenario = load_scenario(SCENARIOS / f"{name}.toml")
    gnss = msgspec.structs.replace(scenario.gnss, base=base, **gnss)
    imu = msgspec.structs.replace(scenario.imu, **(GYROSCOPE if gyroscope else {}))
    scenario = msgspec.structs.replace(scenario, duration_s=span_s, gnss=gnss, imu=imu)
    return simulate(scenario, np.random.default_rng(seed))


def antenna_n_m(flight, t_s):
    """Return the true positions of the reference antenna at epochs, (n, 3)."""
    truth = flight.truth
    row = np.searchsorted(truth.t_s, t_s - 1e-6)
    np.testing.assert_allclose(truth.t_s[row], t_s, rtol=0, atol=1e-6)
    return truth.p_n_m[row] + truth.R_nb[row] @ flight.antennas[0].position_b_m
