"""Which signals of each constellation are kept: RTKLIB holds three per satellite.

One signal per carrier frequency, the same for all antennas of a flight where their receivers allow
it: a double difference needs the same signal at both ends.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from fgnav.io.rinex.header import Header

# By constellation: the band of each of RTKLIB's slots.
_SLOTS = {
    "G": ("1", "2", "5"),
    "E": ("1", "7", "5"),
    "C": ("2", "7", "5"),  # B1C has no slot of these three in pyrtklib5
    "J": ("1", "2", "5"),
    "R": ("1", "2", "3"),
}
# Attributes by band, best first (tracking modes of RINEX 3.05, tables 4 to 9).
ATTRIBUTES = {
    "G1": "CWPYSLXMN",
    "G2": "WLXSPYCDMN",
    "G5": "QXI",
    "E1": "CXBAZ",
    "E7": "QXI",
    "E5": "QXI",
    "C2": "IXQ",
    "C7": "IZDPXQ",
    "C5": "PXD",
    "J1": "CXLSZEB",
    "J2": "LXS",
    "J5": "QXIPDZ",
    "R1": "CP",
    "R2": "CP",
    "R3": "QXI",
}
# Ways to track one and the same signal: pilot, data, or both. RINEX 3 aligns their phases, so
# receivers that chose differently can still be differenced.
_SAME_SIGNAL = {
    "G": ("1PWY", "1SLX", "2PWY", "2SLX", "5IQX"),
    "E": ("1BCX", "5IQX", "7IQX"),
    "C": ("2IQX", "5DPX", "7IQX", "7DPZ"),
    "J": ("1SLX", "2SLX", "5IQX"),
}


def same_signal(constellation: str, signal: str) -> str:
    """Return one name for all ways to track a signal: ``1BCX`` of Galileo's ``1X``."""
    for family in _SAME_SIGNAL.get(constellation, ()):
        if family[0] == signal[0] and signal[1] in family[1:]:
            return family
    return signal


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalChoice:
    """The signal kept in each of RTKLIB's slots, by constellation letter; None where none is."""

    kept: dict[str, tuple[str | None, str | None, str | None]]

    @property
    def options(self) -> str:
        """RTKLIB's reading options that make it keep these."""
        chosen = [f"-{c}L{s}" for c, signals in self.kept.items() for s in signals if s]
        return " ".join(["-SYS=" + "".join(_SLOTS), *chosen])


def choose_signals(headers: Sequence[Header]) -> list[SignalChoice]:
    """Choose the signals of several receivers: those that most of them have, then by rank.

    Parameters
    ----------
    headers : sequence of Header
        Of observation files, RINEX 3 or 4; those of RINEX 2 get no choice (types leave none).

    Returns
    -------
    list of SignalChoice
        One for each header.
    """
    modern = [header for header in headers if header.version >= 3]
    offers = {c: [_offer(header.types.get(c, ())) for header in modern] for c in _SLOTS}
    choices = []
    for header in headers:
        if header.version < 3:
            choices.append(SignalChoice(kept={}))
            continue
        kept = {}
        for constellation, slots in _SLOTS.items():
            own = _offer(header.types.get(constellation, ()))
            first, second, third = (
                _best(constellation, band, own, offers[constellation]) for band in slots
            )
            kept[constellation] = (first, second, third)
        choices.append(SignalChoice(kept=kept))
    return choices


def _offer(types: Sequence[str]) -> dict[str, int]:
    """Return the signals of a list of types: 2 with code and phase, 1 with code only."""
    return {t[1:]: 1 + (f"L{t[1:]}" in types) for t in types if re.fullmatch("C[1-9][A-Z]", t)}


def _best(
    constellation: str, band: str, own: dict[str, int], all_offers: list[dict[str, int]]
) -> str | None:
    """Return the signal of a band: code and phase first, then shared by most, then by rank."""
    attributes = ATTRIBUTES[constellation + band]

    def worth(signal: str) -> tuple[int, int, int, int]:
        family = same_signal(constellation, signal)
        akin = sum(any(same_signal(constellation, s) == family for s in o) for o in all_offers)
        shared = sum(offer.get(signal, 0) for offer in all_offers)
        return own[signal], akin, shared, -attributes.index(signal[1])

    candidates = [signal for signal in own if signal[0] == band and signal[1] in attributes]
    return max(candidates, key=worth, default=None)
