"""Which signals of each constellation are kept: those of three carriers, or those that are wanted.

One signal per carrier frequency, the same for all antennas of a flight where their receivers allow
it: a double difference needs the same signal at both ends. RINEX 2 names codes and carriers only;
there a satellite's code tells the signal, epoch by epoch [1]_.

References
----------
.. [1] RINEX: The Receiver Independent Exchange Format Version 2.11, 2007, section 10.1.1; tracking
   modes as RTKLIB's reader takes them.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fgnav.checks import BadInputError
from fgnav.io.rinex.header import Header

QUANTITIES = "CLDS"  # code, phase, Doppler, density
# By constellation: the bands of the three carriers that are kept. BeiDou: B1I, B2I, B2a.
_BANDS = {"G": "125", "E": "175", "C": "275", "J": "125", "R": "123"}
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
    "E": ("1BCX", "5IQX", "6BCX", "7IQX", "8IQX"),
    "C": ("1DPX", "2IQX", "5DPX", "6IQX", "7IQX", "7DPZ", "8DPX"),
    "J": ("1SLX", "2SLX", "5IQX", "6SLX"),
}
# RINEX 2: signals of codes, by constellation, the best of a carrier first.
_RINEX_2 = {
    "G": {"C1": "1C", "P1": "1W", "P2": "2W", "C2": "2X", "C5": "5X"},
    "E": {"C1": "1X", "C7": "7X", "C5": "5X", "C6": "6X", "C8": "8X"},
    "C": {"C2": "2I", "C1": "2I", "C7": "7I", "C5": "5X", "C6": "6I"},
    "J": {"C1": "1C", "C2": "2X", "C5": "5X", "C6": "6X"},
    "R": {"C1": "1C", "P1": "1P", "C2": "2C", "P2": "2P"},
}
Kept = dict[str, tuple[tuple[str, ...], ...]]


def same_signal(constellation: str, signal: str) -> str:
    """Return one name for all ways to track a signal: ``1BCX`` of Galileo's ``1X``."""
    for family in _SAME_SIGNAL.get(constellation, ()):
        if family[0] == signal[0] and signal[1] in family[1:]:
            return family
    return signal


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalChoice:
    """The signals kept of each carrier, by constellation letter.

    One a carrier or none; of RINEX 2 all that its codes may be, the best first.
    """

    kept: Kept
    version: float = 3.0

    def column(self, constellation: str, name: str) -> tuple[int, int, str]:
        """Return carrier or -1, place of the quantity, and signal of an observation type."""
        place, signal = QUANTITIES.find(name[0].replace("P", "C")), name[1:]
        carriers = self.kept.get(constellation, ())
        if self.version < 3:
            codes = _RINEX_2.get(constellation, {})
            code = codes.get(f"C{name[1]}", name[1])
            of_band = next((some[0] for some in carriers if some and some[0][0] == code[0]), code)
            signal = codes.get(name, code[0]) if place == 0 else of_band
        matching = [k for k, some in enumerate(carriers) if signal in some]
        return (matching[0] if matching and place >= 0 else -1), place, signal


def choose_signals(
    headers: Sequence[Header], wanted: Mapping[str, Sequence[str]] | None = None
) -> list[SignalChoice]:
    """Choose the signals of several receivers: those that most of them have, then by rank.

    Parameters
    ----------
    headers : sequence of Header
        Of observation files.
    wanted : mapping of str to sequence of str
        Signals by constellation letter; no others are kept then.

    Returns
    -------
    list of SignalChoice
        One for each header.

    Raises
    ------
    BadInputError
        If no file has a signal that is wanted; the text names those that they have.
    """
    offers = {c: [_offer(c, header) for header in headers] for c in _BANDS}
    for letter, names in (wanted or {}).items():
        _check_wanted(letter, names, offers)
    choices = []
    for k, header in enumerate(headers):
        kept: Kept = {}
        for letter, bands in _BANDS.items():
            offer = offers[letter][k]
            if wanted:
                families = [same_signal(letter, name) for name in wanted.get(letter, ())]
                groups = [[s for s in offer if same_signal(letter, s) == one] for one in families]
            else:
                groups = [_of_band(letter, band, offer, header.version) for band in bands]
            if header.version < 3:
                kept[letter] = tuple(tuple(some) for some in groups)
                continue
            best = [_best(letter, some, offer, offers[letter]) for some in groups]
            kept[letter] = tuple((signal,) if signal else () for signal in best)
        choices.append(SignalChoice(kept=kept, version=header.version))
    return choices


def _offer(constellation: str, header: Header) -> dict[str, int]:
    """Return the signals of a header: 2 with code and phase, 1 with one of them."""
    types = header.types.get(constellation, ())
    if header.version >= 3:
        signals = [t[1:] for t in types if re.fullmatch("[CL][1-9][A-Z]", t)]
        return {signal: signals.count(signal) for signal in signals}
    codes = _RINEX_2[constellation]
    coded = [signal for code, signal in codes.items() if code in types]
    bands = {signal[0] for signal in coded}
    phases = {s[0]: s for c, s in reversed(codes.items()) if f"L{c[1]}" in types}
    return dict.fromkeys([*coded, *(s for band, s in phases.items() if band not in bands)], 1)


def _of_band(constellation: str, band: str, offer: Mapping[str, int], version: float) -> list[str]:
    attributes = ATTRIBUTES[constellation + band]
    return [s for s in offer if s[0] == band and (version < 3 or s[1] in attributes)]


def _check_wanted(
    letter: str, names: Sequence[str], offers: Mapping[str, Sequence[Mapping[str, int]]]
) -> None:
    """Raise unless some file has each signal that is wanted."""
    had = {same_signal(letter, s) for offer in offers.get(letter, ()) for s in offer}
    for name in names:
        if same_signal(letter, name) not in had:
            pairs = {f"{c} {s}" for c, some in offers.items() for offer in some for s in offer}
            raise BadInputError(
                f"key gnss.signals: no {letter} signal {name} was observed; there are "
                f"{', '.join(sorted(pairs))}"
            )


def _best(
    constellation: str,
    candidates: Sequence[str],
    offer: Mapping[str, int],
    offers: Sequence[Mapping[str, int]],
) -> str | None:
    """Return a signal of several: code and phase first, then shared by most, then by rank."""

    def worth(signal: str) -> tuple[int, int, int, int]:
        family = same_signal(constellation, signal)
        akin = sum(any(same_signal(constellation, s) == family for s in o) for o in offers)
        shared = sum(one.get(signal, 0) for one in offers)
        rank = ATTRIBUTES.get(constellation + signal[0], "").find(signal[1])
        return offer[signal], akin, shared, -rank

    return max(candidates, key=worth, default=None)
