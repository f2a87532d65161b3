"""Which signals of each constellation are kept: those of three carriers.

One signal per carrier frequency, the same for all antennas of a flight where their receivers allow
it: a double difference needs the same signal at both ends. RINEX 2 names codes and carriers only;
there a satellite's code tells the signal, epoch by epoch [1]_.

References
----------
.. [1] RINEX: The Receiver Independent Exchange Format Version 2.11, 2007, section 10.1.1; tracking
   modes as RTKLIB's reader takes them.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from fgnav.io.rinex.header import Header

QUANTITIES = "CLDS"  # code, phase, Doppler, density
# By constellation: the bands of the three carriers that are kept.
_SLOTS = {
    "G": ("1", "2", "5"),
    "E": ("1", "7", "5"),
    "C": ("2", "7", "5"),  # B1I, B2I, B2a
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


# RINEX 2: signals of codes, by constellation, the best of a carrier first.
_RINEX_2 = {
    "G": {"C1": "1C", "P1": "1W", "P2": "2W", "C2": "2X", "C5": "5X"},
    "E": {"C1": "1X", "C7": "7X", "C5": "5X", "C6": "6X", "C8": "8X"},
    "C": {"C2": "2I", "C1": "2I", "C7": "7I", "C5": "5X", "C6": "6I"},
    "J": {"C1": "1C", "C2": "2X", "C5": "5X", "C6": "6X"},
    "R": {"C1": "1C", "P1": "1P", "C2": "2C", "P2": "2P"},
}


def same_signal(constellation: str, signal: str) -> str:
    """Return one name for all ways to track a signal: ``1BCX`` of Galileo's ``1X``."""
    for family in _SAME_SIGNAL.get(constellation, ()):
        if family[0] == signal[0] and signal[1] in family[1:]:
            return family
    return signal


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalChoice:
    """The signals kept of each of three carriers, by constellation letter.

    One a carrier or none; of RINEX 2 all that its codes may be, the best first.
    """

    kept: dict[str, tuple[tuple[str, ...], ...]]
    version: float = 3.0

    def column(self, constellation: str, name: str) -> tuple[int, int, str]:
        """Return carrier or -1, place of the quantity, and signal of an observation type."""
        place, signal = QUANTITIES.find(name[0].replace("P", "C")), name[1:]
        carriers = self.kept.get(constellation, ((), (), ()))
        if self.version < 3:
            codes = _RINEX_2.get(constellation, {})
            band = codes.get(f"C{name[1]}", name[1])[0]
            code = codes.get(f"C{name[1]}", name[1])
            of_band = next((some[0] for some in carriers if some and some[0][0] == band), code)
            signal = codes.get(name, band) if place == 0 else of_band
        matching = [k for k, some in enumerate(carriers) if signal in some]
        return (matching[0] if matching and place >= 0 else -1), place, signal


def choose_signals(headers: Sequence[Header]) -> list[SignalChoice]:
    """Choose the signals of several receivers: those that most of them have, then by rank.

    Parameters
    ----------
    headers : sequence of Header
        Of observation files.

    Returns
    -------
    list of SignalChoice
        One for each header.
    """
    modern = [header for header in headers if header.version >= 3]
    offers = {c: [_offer(header.types.get(c, ())) for header in modern] for c in _SLOTS}
    choices = []
    for header in headers:
        kept: dict[str, tuple[tuple[str, ...], ...]] = {}
        for constellation, slots in _SLOTS.items():
            types = header.types.get(constellation, ())
            if header.version < 3:
                kept[constellation] = tuple(_of_codes(constellation, band, types) for band in slots)
                continue
            own = _offer(types)
            best = [_best(constellation, band, own, offers[constellation]) for band in slots]
            kept[constellation] = tuple((signal,) if signal else () for signal in best)
        choices.append(SignalChoice(kept=kept, version=header.version))
    return choices


def _of_codes(constellation: str, band: str, types: Sequence[str]) -> tuple[str, ...]:
    """Return the signals of a carrier that the codes, or else the phase, of RINEX 2 may be of."""
    codes = {c: s for c, s in _RINEX_2[constellation].items() if s[0] == band}
    some = [signal for code, signal in codes.items() if code in types]
    some = some or [signal for code, signal in codes.items() if f"L{code[1]}" in types][:1]
    return tuple(dict.fromkeys(some))


def _offer(types: Sequence[str]) -> dict[str, int]:
    """Return the signals of a list of types: 2 with code and phase, 1 with one of them."""
    signals = [t[1:] for t in types if re.fullmatch("[CL][1-9][A-Z]", t)]
    return {signal: signals.count(signal) for signal in signals}


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
