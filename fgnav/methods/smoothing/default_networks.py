"""Networks that a flight is asked by unless others are named: gravity, where attitude is open."""

from typing import TYPE_CHECKING

from fgnav import plugins
from fgnav.messages import note
from fgnav.methods.smoothing.custom_sources import FACTORS, factor_source
from fgnav.types.flight import Flight

if TYPE_CHECKING:
    from fgnav.neural.factor import NeuralFactor

GRAVITY = "gravity"
_FEWEST = 3  # antennas: two leave the turn about their baseline open


def default_networks(flight: Flight) -> "tuple[tuple[NeuralFactor, ...], tuple[str, ...]]":
    """Return the networks of a flight, and a sentence on each that cannot be asked."""
    if not is_attitude_open(flight) or GRAVITY not in plugins.names(FACTORS, {}):
        return (), ()
    network: NeuralFactor = factor_source(GRAVITY)  # type: ignore[assignment]  # a manifest's
    refusal = network.refusal(flight)
    if refusal is not None:
        return (), (note("W405", network=GRAVITY, refusal=refusal),)
    return (network,), ()


def is_attitude_open(flight: Flight) -> bool:
    """Return True if neither a gyroscope nor an array of three measures the attitude."""
    imu = flight.imu
    if imu is None or imu.w_b_radps is not None:
        return False
    return flight.observations is None or len(flight.antennas) < _FEWEST
