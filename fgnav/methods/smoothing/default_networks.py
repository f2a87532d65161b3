"""Networks that a flight is asked by unless others are named: gravity, where attitude is open."""

from typing import TYPE_CHECKING

import numpy as np

from fgnav import plugins
from fgnav.frontend.gaps import LOST_S
from fgnav.methods.smoothing.own_sources import FACTORS, factor_source
from fgnav.types.flight import Flight

if TYPE_CHECKING:
    from fgnav.neural.factor import NeuralFactor

GRAVITY = "gravity"
_FEWEST = 3  # antennas: two leave the turn about their baseline open


def default_networks(
    flight: Flight, *, causal: bool = False
) -> "tuple[tuple[NeuralFactor, ...], tuple[str, ...]]":
    """Return the networks of a flight, and a sentence on each that cannot be asked."""
    if not is_attitude_open(flight, causal=causal) or GRAVITY not in plugins.names(FACTORS, {}):
        return (), ()
    network: NeuralFactor = factor_source(GRAVITY)  # type: ignore[assignment]  # a manifest's
    refusal = network.refusal(flight)
    if refusal is not None:
        return (), (f"Network {GRAVITY} is not asked: {refusal}.",)
    return (network,), ()


def is_attitude_open(flight: Flight, *, causal: bool) -> bool:
    """Return whether no gyroscope carries the attitude over times without an array of three.

    Causal: whether there is no such array; that it is to be lost is not known before.
    """
    imu, observations = flight.imu, flight.observations
    if imu is None or imu.w_b_radps is not None:
        return False
    if observations is None or len(flight.antennas) < _FEWEST:
        return True
    if causal:
        return False
    tracked = np.isfinite(observations.phase_cycles).any(axis=2).sum(axis=1) >= _FEWEST
    times_s = observations.t_s[tracked]
    edges_s = np.concatenate([observations.t_s[:1], times_s, observations.t_s[-1:]])
    return bool((np.diff(edges_s) > LOST_S).any())
