"""Which fields of RINEX observations are kept: code, phase, Doppler, density of which signals.

RINEX 2 names codes and carriers only. There a satellite's code tells the signal of its phase, epoch
by epoch.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

from fgnav.checks import BadInputError
from fgnav.io.rinex.constellations import CONSTELLATIONS, USED
from fgnav.io.rinex.header import Header

QUANTITIES = "CLDS"  # code, phase, Doppler, density
Wanted: TypeAlias = Mapping[str, Sequence[str]]  # signals by constellation letter


class Field(NamedTuple):
    """Quantity and signals of a field of a satellite's record."""

    quantity: int  # of ``QUANTITIES``, -1 of another
    signals: tuple[str, ...]
    codes: tuple[int, ...] = ()  # RINEX 2: fields of which the first that is there tells the signal


def fields_of(header: Header, letter: str) -> list[Field]:
    """Return the fields of a constellation's records."""
    types = header.types.get(letter, ())
    if header.version >= 3:
        return [Field(QUANTITIES.find(name[0]), (name[1:],)) for name in types]
    codes = CONSTELLATIONS[letter].codes
    fields = []
    for name in types:
        quantity = QUANTITIES.find(name[0].replace("P", "C"))
        band = codes.get(f"C{name[1]}", name[1])[0]
        if quantity == 0:
            fields.append(Field(0, (codes.get(name, band),)))
            continue
        listed = {code: s for code, s in codes.items() if s[0] == band and code in types}
        first = next((s for s in codes.values() if s[0] == band), band)
        indices = tuple(types.index(code) for code in listed)
        fields.append(Field(quantity, tuple(listed.values()) or (first,), indices))
    return fields


def is_kept(letter: str, signal: str, wanted: Wanted) -> bool:
    """Return True if a signal is wanted, or nothing is and its carrier is kept by default."""
    if wanted:
        return signal in wanted.get(letter, ())
    return len(signal) == 2 and signal[0] in CONSTELLATIONS[letter].carriers


def check_wanted(headers: Sequence[Header], wanted: Wanted) -> None:
    """Raise unless some file has each signal that is wanted."""
    offered = {
        (letter, signal)
        for header in headers
        for letter in USED
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
