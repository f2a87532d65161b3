"""Receivers' own solutions: fixes of antennas, the baseline between two; white noise."""

from collections.abc import Iterator

import numpy as np

from fgnav.checks import FloatArray
from fgnav.types.flight import Baseline, Fixes
from fgnav_sim.gnss.tables import BaselineTable, antenna_names
from fgnav_sim.scenario import FixesTable, Scenario


def fix(sensor: FixesTable, scenario: Scenario, rng: np.random.Generator) -> Iterator[Fixes]:
    """Yield the fixes of each antenna that has a receiver."""
    t_s = scenario.epochs_s(sensor.rate_hz)
    rngs = [rng, *rng.spawn(len(sensor.antennas) - 1)]
    for antenna, of_receiver in zip(sensor.antennas, rngs, strict=True):
        p_n_m, v_n_mps, _ = scenario.motion(t_s).at(_place_b_m(scenario, antenna))
        noise = of_receiver.standard_normal((2, len(t_s), 3))
        yield Fixes(
            t_s=t_s,
            antenna=antenna,
            p_n_m=p_n_m + sensor.position_noise_m * noise[0],
            v_n_mps=v_n_mps + sensor.velocity_noise_mps * noise[1],
            position_sigma_m=np.full((len(t_s), 3), sensor.position_noise_m),
            velocity_sigma_mps=np.full((len(t_s), 3), sensor.velocity_noise_mps),
        )


def baseline(sensor: BaselineTable, scenario: Scenario, rng: np.random.Generator) -> Baseline:
    """Return the baseline of a receiver of two antennas."""
    t_s = scenario.epochs_s(sensor.rate_hz)
    noise_m = sensor.noise_m * rng.standard_normal((len(t_s), 3))
    for from_s, until_s in sensor.gaps_s:
        kept = (t_s < from_s) | (t_s >= until_s)
        t_s, noise_m = t_s[kept], noise_m[kept]
    first, second = (_place_b_m(scenario, name) for name in sensor.antennas)
    vector = scenario.motion(t_s).R_nb @ (second - first) + noise_m
    sigma = np.full(len(t_s), sensor.noise_m)
    if sensor.measures != "vector":
        vector *= np.array([1.0, 1.0, sensor.measures == "direction"])
        length_m = np.linalg.norm(vector, axis=1)
        vector, sigma = vector / length_m[:, None], sigma / length_m
    return Baseline(
        t_s=t_s,
        antennas=sensor.antennas,
        vector_n_m=vector,
        covariance_m2=sigma[:, None, None] ** 2 * np.eye(3),
        measured=sensor.measures,
    )


def _place_b_m(scenario: Scenario, antenna: str) -> FloatArray:
    names = antenna_names(len(scenario.antennas_b_m))
    return np.array(scenario.antennas_b_m[names.index(antenna)])
