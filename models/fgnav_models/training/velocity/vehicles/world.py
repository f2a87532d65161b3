"""Flights of vehicles of many kinds: which, how long, with which inertial unit."""

from collections.abc import Callable
from typing import Annotated

import msgspec
import numpy as np

from fgnav.io.strict_toml import NotNegative, Positive, Table
from fgnav_models.training.velocity.vehicles.aeroplane import aeroplane
from fgnav_models.training.velocity.vehicles.car import car
from fgnav_models.training.velocity.vehicles.multirotor import multirotor
from fgnav_models.training.velocity.vehicles.track import Track
from fgnav_sim.ranges import Range, check_ranges, log_uniform
from fgnav_sim.scenario import FixesTable, ImuTable, Scenario

_MAKERS: dict[str, Callable[[float, np.random.Generator], Track]] = {
    "car": car,
    "multirotor": multirotor,
    "aeroplane": aeroplane,
}
KINDS = tuple(_MAKERS)


class VehiclesWorld(Table, frozen=True, tag="vehicles", tag_field="kind"):
    """Distribution of vehicles."""

    # car, multirotor, aeroplane: how likely a flight is of each kind
    car: NotNegative = 1.0
    multirotor: NotNegative = 1.0
    aeroplane: NotNegative = 1.0
    flight_s: Annotated[float, msgspec.Meta(ge=10)] = 60.0
    rate_hz: Positive = 100.0  # of the inertial unit
    # accelerometer_noise_mps2_per_sqrt_hz, gyroscope_noise_radps_per_sqrt_hz: their logarithms are
    # uniform; of consumer and tactical units
    accelerometer_noise_mps2_per_sqrt_hz: Range = (5e-4, 1e-2)
    # accelerometer_bias_mps2, gyroscope_bias_radps: 1-sigma
    accelerometer_bias_mps2: Positive = 0.1
    gyroscope_noise_radps_per_sqrt_hz: Range = (5e-5, 2e-3)
    gyroscope_bias_radps: Positive = 5e-3

    def __post_init__(self) -> None:
        """Require one kind, and ranges."""
        if not self.car + self.multirotor + self.aeroplane:
            raise ValueError("car: must be above zero where all others are zero")
        noises = ("accelerometer_noise_mps2_per_sqrt_hz", "gyroscope_noise_radps_per_sqrt_hz")
        check_ranges(self, *noises)


def vehicle_scenario(
    world: VehiclesWorld,
    kind: str,
    rng: np.random.Generator,
    *,
    fixes: FixesTable | None = None,
) -> Scenario:
    """Return a flight of a kind, one of ``KINDS``, with one antenna at its inertial unit."""
    imu = ImuTable(
        rate_hz=world.rate_hz,
        accelerometer_noise_mps2_per_sqrt_hz=log_uniform(
            world.accelerometer_noise_mps2_per_sqrt_hz, rng
        ),
        accelerometer_bias_mps2=world.accelerometer_bias_mps2,
        gyroscope_noise_radps_per_sqrt_hz=log_uniform(world.gyroscope_noise_radps_per_sqrt_hz, rng),
        gyroscope_bias_radps=world.gyroscope_bias_radps,
        gyroscope_bias_walk_radps_per_sqrt_s=1e-5,
    )
    return Scenario(
        name=kind,
        duration_s=world.flight_s,
        motion=_MAKERS[kind](world.flight_s, rng),
        antennas_b_m=((0.0, 0.0, 0.0),),
        imu=imu,
        fixes=fixes,
    )


def drawn_kind(world: VehiclesWorld, rng: np.random.Generator) -> str:
    """Return a kind, as likely as the world has it."""
    weights = np.array([getattr(world, kind) for kind in KINDS])
    return str(rng.choice(KINDS, p=weights / weights.sum()))
