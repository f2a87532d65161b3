"""What a world file may say about samples for learning gravity."""

from typing import Annotated

import msgspec

from fgnav.io.strict_toml import NotNegative, Positive, Table
from fgnav_sim.scenario import ImuTable, Place

Range = tuple[float, float]


class PhasesTable(Table, frozen=True):
    """How likely a flight is of each kind; all alike unless told."""

    climb: NotNegative = 1.0
    cruise: NotNegative = 1.0
    descent: NotNegative = 1.0
    turn: NotNegative = 1.0
    spin: NotNegative = 1.0

    def __post_init__(self) -> None:
        """Require one kind."""
        if not any(msgspec.structs.astuple(self)):
            raise ValueError("cruise: must be above zero where all others are zero")


class WindowsTable(Table, frozen=True):
    """What an estimator sees at a time: so many accelerometer samples in a row.

    ``per_flight`` windows begin at times uniform over a flight of ``flight_s``.
    """

    samples: Annotated[int, msgspec.Meta(ge=1)] = 10
    per_flight: Annotated[int, msgspec.Meta(ge=1)] = 20
    flight_s: Positive = 60.0


class MotionRanges(Table, frozen=True):
    """What motions are drawn from, uniform within each range."""

    # speed_mps, climb_deg, turn_mps2, spin_degps: climb is the slope of climbs, and of descents
    # downward; turns have a horizontal acceleration; the spin is about the long axis, either way
    speed_mps: Range = (30.0, 250.0)
    climb_deg: Range = (5.0, 60.0)
    turn_mps2: Range = (1.0, 20.0)
    # amplitude of an acceleration that swings along the first course, at a rate of the wobbles
    surge_mps2: Range = (0.0, 4.0)
    spin_degps: Range = (90.0, 1800.0)
    # wobble_deg, wobble_radps: amplitude and rate of the sine that each Euler angle swings by
    # beside its command
    wobble_deg: Range = (0.0, 8.0)
    wobble_radps: Range = (0.2, 3.0)

    def __post_init__(self) -> None:
        """Check ranges."""
        for name in self.__struct_fields__:
            low, high = getattr(self, name)
            if not 0 <= low <= high:
                raise ValueError(f"{name}: must be a range above zero, got {[low, high]}")
        if self.speed_mps[0] <= 0 or self.turn_mps2[0] <= 0 or self.wobble_radps[0] <= 0:
            raise ValueError("speed_mps: must be above zero, as turn_mps2 and wobble_radps")


class GravityWorld(Table, frozen=True, tag="gravity", tag_field="kind"):
    """Accelerometer windows and the gravity they hide."""

    name: str = ""
    # epochs, shard_epochs: how many windows a data set holds, and one file of it
    epochs: Annotated[int, msgspec.Meta(ge=1)] = 10_000
    shard_epochs: Annotated[int, msgspec.Meta(ge=1)] = 10_000
    origin: Place = Place()
    phases: PhasesTable = PhasesTable()
    windows: WindowsTable = WindowsTable()
    motion: MotionRanges = MotionRanges()
    imu: ImuTable = ImuTable()  # the accelerometer; errors are drawn for each flight
    velocity_noise_mps: Positive = 0.05  # of a receiver's velocities, per axis
    # the derivative is the difference of two velocities so far apart, about the window's end
    velocity_step_s: Positive = 0.2
    velocity_age_s: NotNegative = 0.0  # how long before the window's end the middle of the two is
    # spread of where the accelerometer sits beside ``imu.position_b_m``, per axis
    lever_sigma_m: NotNegative = 0.0

    def __post_init__(self) -> None:
        """Check what one key's type cannot say."""
        if self.shard_epochs % self.windows.per_flight:
            raise ValueError(
                f"shard_epochs: must hold whole flights of {self.windows.per_flight} windows, "
                f"got {self.shard_epochs}"
            )
