"""A receiver's own solution: the true position and velocity of one antenna, white noise added."""

import numpy as np

from fgnav.types.flight import Fixes
from fgnav_sim.scenario import FixesTable, Scenario


def fix(sensor: FixesTable, scenario: Scenario, antenna: str, *, rng: np.random.Generator) -> Fixes:
    """Return what a receiver says of the reference antenna, whose name is ``antenna``."""
    t_s = scenario.epochs_s(sensor.rate_hz)
    p_n_m, v_n_mps, _ = scenario.motion(t_s).at(np.array(scenario.antennas_b_m[0]))
    noise = rng.standard_normal((2, len(t_s), 3))
    return Fixes(
        t_s=t_s,
        antenna=antenna,
        p_n_m=p_n_m + sensor.position_noise_m * noise[0],
        v_n_mps=v_n_mps + sensor.velocity_noise_mps * noise[1],
        position_sigma_m=np.full((len(t_s), 3), sensor.position_noise_m),
        velocity_sigma_mps=np.full((len(t_s), 3), sensor.velocity_noise_mps),
    )
