"""Format of a world file of samples for learning gravity."""

import msgspec

from fgnav.io.strict_toml import NotNegative, Positive, Table
from fgnav_sim.ranges import Count, Range, check_ranges
from fgnav_sim.scenario import ImuTable, Place


class PhasesTable(Table, frozen=True):
    """Relative frequencies of the kinds of flights; all alike by default."""

    # commanded motions
    climb: NotNegative = 1.0
    cruise: NotNegative = 1.0
    descent: NotNegative = 1.0
    turn: NotNegative = 1.0
    spin: NotNegative = 1.0
    # rigid bodies in six degrees of freedom
    rocket: NotNegative = 1.0  # with fins: boost, coast, descent
    guided: NotNegative = 1.0  # the same, its canards commanded
    glider: NotNegative = 1.0  # without and with a motor: cruise, climb, dive, spiral
    vacuum: NotNegative = 1.0  # no air acts on it: nothing shows gravity

    def __post_init__(self) -> None:
        """Require one kind."""
        if not any(msgspec.structs.astuple(self)):
            raise ValueError("cruise: must be above zero where all others are zero")


class WindowsTable(Table, frozen=True):
    """Input of an estimator at a time: accelerometer samples and velocities up to it.

    ``per_flight`` windows end at velocities drawn from a flight of ``flight_s``.
    """

    samples: Count = 150
    velocities: Count = 16
    per_flight: Count = 20
    flight_s: Positive = 40.0


class MotionRanges(Table, frozen=True):
    """Ranges of commanded motions, uniform within each."""

    # speed_mps, climb_deg, turn_mps2, spin_degps: climb is the slope of climbs, and of descents
    # downward; turns have a horizontal acceleration; the spin is about the long axis, either way
    speed_mps: Range = (20.0, 250.0)
    climb_deg: Range = (5.0, 60.0)
    turn_mps2: Range = (1.0, 20.0)
    # amplitude of an acceleration that swings along the first course, at a rate of the wobbles
    surge_mps2: Range = (0.0, 4.0)
    spin_degps: Range = (90.0, 1080.0)
    # wobble_deg, wobble_radps: amplitude and rate of the sine that each Euler angle swings by
    # beside its command
    wobble_deg: Range = (0.0, 8.0)
    wobble_radps: Range = (0.2, 3.0)

    def __post_init__(self) -> None:
        """Check ranges."""
        check_ranges(self, "speed_mps", "turn_mps2", "wobble_radps")
        check_ranges(self, "climb_deg", "surge_mps2", "spin_degps", "wobble_deg", zero=True)


class BodyRanges(Table, frozen=True):
    """Ranges of rigid bodies and their flights, uniform within each."""

    # factors of the shipped vehicles' figures: mass and inertia, thrust, drag, lift, moments
    mass: Range = (0.7, 1.4)
    thrust: Range = (0.5, 1.3)
    drag: Range = (0.7, 1.5)
    lift: Range = (0.7, 1.3)
    moment: Range = (0.5, 1.5)
    # speed at the start: of a rocket on its rail, of one that coasts, of a glider
    rail_mps: Range = (15.0, 50.0)
    coast_mps: Range = (60.0, 300.0)
    glide_mps: Range = (12.0, 28.0)
    # spin_degps: about the long axis, either way, of half of the rockets; the rest hardly roll
    spin_degps: Range = (0.0, 720.0)
    tumble_degps: Range = (0.0, 20.0)  # other rates at the start
    # of a rocket, at the ground and 3 km above; a glider has a third of it
    wind_mps: Range = (0.0, 6.0)
    wind_aloft_mps: Range = (0.0, 12.0)
    gusts_mps: Range = (0.05, 1.5)  # likewise
    # swing_deg, swing_radps: of each commanded angle of guided bodies
    swing_deg: Range = (0.0, 5.0)
    swing_radps: Range = (0.2, 3.0)

    def __post_init__(self) -> None:
        """Check ranges."""
        check_ranges(self, *self.__struct_fields__, zero=True)


class GravityWorld(Table, frozen=True, tag="gravity", tag_field="kind"):
    """Accelerometer windows and the gravity they hide."""

    name: str = ""
    # epochs, shard_epochs: how many windows a data set holds, and one file of it
    epochs: Count = 10_000
    shard_epochs: Count = 10_000
    origin: Place = Place()
    phases: PhasesTable = PhasesTable()
    windows: WindowsTable = WindowsTable()
    motion: MotionRanges = MotionRanges()
    bodies: BodyRanges = BodyRanges()
    # the accelerometer; errors are drawn for each flight, angles between its axes among them
    imu: ImuTable = ImuTable(accelerometer_misalignment_rad=3e-3, accelerometer_scale=1e-3)
    velocity_noise_mps: Range = (0.01, 0.1)  # log-uniform, of a flight's velocities, per axis
    # per axis, either way: where the accelerometer is in the body, the antenna from there
    accelerometer_arm_m: tuple[float, float, float] = (0.5, 0.03, 0.03)
    antenna_arm_m: tuple[float, float, float] = (0.5, 0.1, 0.1)

    def __post_init__(self) -> None:
        """Check what one key's type cannot say."""
        check_ranges(self, "velocity_noise_mps")
        if self.shard_epochs % self.windows.per_flight:
            raise ValueError(
                f"shard_epochs: must hold whole flights of {self.windows.per_flight} windows, "
                f"got {self.shard_epochs}"
            )
