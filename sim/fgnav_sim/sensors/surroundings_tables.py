"""Format of a scenario's barometer and magnetometer."""

from fgnav.io.strict_toml import NotNegative, Positive, Table, Vector


class BarometerTable(Table, frozen=True):
    """Height by air pressure."""

    rate_hz: Positive = 10.0
    position_b_m: Vector = (0.0, 0.0, 0.0)
    noise_m: Positive = 0.3  # white, of each sample
    offset_m: Positive = 20.0  # 1-sigma of an offset that holds for the flight
    # wander_m, wander_time_s: 1-sigma and time constant of a first-order Gauss-Markov drift
    wander_m: NotNegative = 1.0
    wander_time_s: Positive = 300.0


class MagnetometerTable(Table, frozen=True):
    """The magnetic field in body axes."""

    rate_hz: Positive = 10.0
    # the Earth's, north, east, down, the same everywhere; Madrid's where nothing is said
    field_n_ut: Vector = (25.8, -0.2, 36.6)
    noise_ut: Positive = 0.3  # white, of each axis of each sample
    hard_iron_ut: Positive = 2.0  # 1-sigma of each axis of the vehicle's own field

    def __post_init__(self) -> None:
        """Require a field."""
        if not any(self.field_n_ut):
            raise ValueError("field_n_ut: must not be zero, got [0, 0, 0]")
