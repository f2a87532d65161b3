"""Constellations in files: names, satellites in use, carriers, codes of RINEX 2.

References
----------
.. [1] RINEX: The Receiver Independent Exchange Format Version 2.11, 2007, section 10.1.1; tracking
   modes as RTKLIB's reader takes them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Constellation:
    """A constellation; of those that are not used the name alone."""

    name: str
    satellites: int = 0  # highest number in use
    carriers: str = ""  # those kept by default
    time: str = "GPS"  # its own time scale, as RINEX names it
    # of RINEX 2 [1]_: signals of codes, the best of a carrier first
    codes: Mapping[str, str] = field(default_factory=dict)


_G2 = {"C1": "1C", "P1": "1W", "P2": "2W", "C2": "2X", "C5": "5X"}
_E2 = {"C1": "1X", "C7": "7X", "C5": "5X", "C6": "6X", "C8": "8X"}
_C2 = {"C2": "2I", "C1": "2I", "C7": "7I", "C5": "5X", "C6": "6I"}
_J2 = {"C1": "1C", "C2": "2X", "C5": "5X", "C6": "6X"}
_R2 = {"C1": "1C", "P1": "1P", "C2": "2C", "P2": "2P"}
CONSTELLATIONS = {
    "G": Constellation("GPS", 32, "125", "GPS", _G2),
    "R": Constellation("GLONASS", 27, "123", "GLO", _R2),
    "E": Constellation("Galileo", 36, "157", "GAL", _E2),
    "C": Constellation("BeiDou", 46, "257", "BDT", _C2),  # B1I, B2a, B2I
    "J": Constellation("QZSS", 10, "125", "QZS", _J2),
    "S": Constellation("SBAS"),
    "I": Constellation("NavIC"),
}
USED = {letter: some for letter, some in CONSTELLATIONS.items() if some.satellites}


def is_known(satellite: str) -> bool:
    """Return True if a satellite's number is in use: ``G05``."""
    number = satellite[1:]
    most = USED[satellite[:1]].satellites if satellite[:1] in USED else 0
    return number.isdigit() and 1 <= int(number) <= most
