"""What a check says of a flight: what is in it, what is wrong, what could not be told."""

from dataclasses import asdict, dataclass, field
from typing import Any

from fgnav.checks import Loss


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """A sensor's samples in time."""

    samples: int
    first_s: float
    last_s: float
    rate_hz: float  # from the median interval; 0 for a single sample
    gaps: int  # steps longer than one and a half intervals
    longest_gap_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """Something that will cost accuracy or an answer."""

    name: str
    text: str  # what is wrong, and how that is known
    where: str = ""  # table, file and column of the flight
    mend: str = ""  # what to do about it
    certain: bool = False  # whether no estimate of such a flight is worth having

    def __str__(self) -> str:
        """Return one line."""
        where = f" ({self.where})" if self.where else ""
        mend = f"; {self.mend}" if self.mend else ""
        return f"{self.name}: {self.text}{mend}{where}"


@dataclass(frozen=True, slots=True, kw_only=True)
class SetUp:
    """What is in a flight.

    Attributes
    ----------
    channels : dict of str to int
        Signals tracked at least once, by constellation and signal: ``{"GPS 1C": 9}``.
    series : dict of str to Series
        By sensor: ``gnss``, ``imu``, ``fixes``, ``seeker``, ``barometer``, ``magnetometer``,
        ``truth``; absent ones are not there.
    orbits : tuple of str
        ``broadcast``, ``precise``.
    unchecked : tuple of Finding
        What the data cannot tell right from wrong, with the reason.
    losses : tuple of Loss
        What was in the files and could not be kept.
    """

    flight: str
    antennas: tuple[str, ...]
    channels: dict[str, int] = field(default_factory=dict)
    series: dict[str, Series] = field(default_factory=dict)
    orbits: tuple[str, ...] = ()
    gyroscope: bool = False
    findings: tuple[Finding, ...] = ()
    unchecked: tuple[Finding, ...] = ()
    losses: tuple[Loss, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return everything in plain types."""
        return asdict(self)
