"""Which fields of RINEX observations are kept: code, phase, Doppler, density of which signals.

RINEX 2 names codes and carriers only. There a satellite's code tells the signal of its phase, epoch
by epoch [1]_.

References
----------
.. [1] RINEX: The Receiver Independent Exchange Format Version 2.11, 2007, section 10.1.1; tracking
   modes as RTKLIB's reader takes them.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

from fgnav.checks import BadInputError
from fgnav.io.rinex.header import Header

QUANTITIES = "CLDS"  # code, phase, Doppler, density
# Carriers that are kept by default, by constellation. BeiDou: B1I, B2a, B2I.
_CARRIERS = {"G": "125", "E": "157", "C": "257", "J": "125", "R": "123"}
# RINEX 2: signals of codes, by constellation, the best of a carrier first.
_RINEX_2 = {
    "G": {"C1": "1C", "P1": "1W", "P2": "2W", "C2": "2X", "C5": "5X"},
    "E": {"C1": "1X", "C7": "7X", "C5": "5X", "C6": "6X", "C8": "8X"},
    "C": {"C2": "2I", "C1": "2I", "C7": "7I", "C5": "5X", "C6": "6I"},
    "J": {"C1": "1C", "C2": "2X", "C5": "5X", "C6": "6X"},
    "R": {"C1": "1C", "P1": "1P", "C2": "2C", "P2": "2P"},
}
Wanted: TypeAlias = Mapping[str, Sequence[str]]  # signals by constellation letter


class Field(NamedTuple):
    """What a field of a satellite's record may hold."""

    quantity: int  # of ``QUANTITIES``, -1 of another
    signals: tuple[str, ...]
    codes: tuple[int, ...] = ()  # RINEX 2: fields of which the first that is there tells the signal


def fields_of(header: Header, letter: str) -> list[Field]:
    """Return what the fields of a constellation's records hold."""
    types = header.types.get(letter, ())
    if header.version >= 3:
        return [Field(QUANTITIES.find(name[0]), (name[1:],)) for name in types]
    codes = _RINEX_2.get(letter, {})
    fields = []
    for name in types:
        quantity = QUANTITIES.find(name[0].replace("P", "C"))
        band = codes.get(f"C{name[1]}", name[1])[0]
        if quantity == 0:
            fields.append(Field(0, (codes.get(name, band),)))
            continue
        listed = {code: s for code, s in codes.items() if s[0] == band and code in types}
        first = next((s for s in codes.values() if s[0] == band), band)
        places = tuple(types.index(code) for code in listed)
        fields.append(Field(quantity, tuple(listed.values()) or (first,), places))
    return fields


def is_kept(letter: str, signal: str, wanted: Wanted) -> bool:
    """Return True if a signal is wanted, or nothing is and its carrier is kept by default."""
    if wanted:
        return signal in wanted.get(letter, ())
    return len(signal) == 2 and signal[0] in _CARRIERS.get(letter, "")


def check_wanted(headers: Sequence[Header], wanted: Wanted) -> None:
    """Raise unless some file has each signal that is wanted.

    Raises
    ------
    BadInputError
        The text names those that they have.
    """
    offered = {
        (letter, signal)
        for header in headers
        for letter in _CARRIERS
        for field in fields_of(header, letter)
        for signal in field.signals
        if field.quantity in (0, 1) and len(signal) == 2
    }
    for letter, signals in wanted.items():
        for signal in signals:
            if (letter, signal) not in offered:
                names = ", ".join(f"{c} {s}" for c, s in sorted(offered))
                raise BadInputError(
                    f"key gnss.signals: no {letter} signal {signal} was observed; there are {names}"
                )
