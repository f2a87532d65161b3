"""Strict reading of a RINEX navigation file: messages that are used, and the count of others."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, FloatArray, IntArray, Loss, quoted
from fgnav.io.rinex.header import Header
from fgnav.io.rinex.navigation_lines import BrokenLineError, messages, numbers
from fgnav.io.rinex.scan import CONSTELLATIONS, KNOWN_SATELLITES, line_fault
from fgnav.io.rinex.text import Bytes

_DECODED = ("LNAV", "INAV", "FNAV", "D1", "D2")  # RINEX 4 messages laid out as in RINEX 3


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class NavigationScan:
    """The messages of a navigation file that are used, and the count of the others."""

    satellites: NDArray[np.str_]  # (k,); RINEX names, in the order of the file
    clock_times_s: FloatArray  # (k,); since 1980-01-06, in the constellation's own time
    numbers: FloatArray  # (k, 31); three of the clock, then seven lines of four
    klobuchar: NDArray[np.float64]  # (8,); GPS ionosphere, alpha and beta
    losses: tuple[Loss, ...]  # what stands in the file and is not used


def scan_navigation(header: Header, text: Bytes) -> NavigationScan:
    """Check the body of a navigation file and take the messages that can be decoded.

    Parameters and errors are those of ``fgnav.io.rinex.scan.scan_observations``.
    """
    default = header.system if header.version < 3 else ""
    try:
        found = list(
            messages(
                text.tobytes().rstrip(b"\x1a\0"),
                header.size,
                header.lines + 1,
                int(header.version),
                default,
            )
        )
    except BrokenLineError as error:
        raise BadInputError(
            line_fault(header, text, error.line, error.rule, "fetch the file again")
        ) from None
    names = np.array([one.satellite for one in found], "U3")
    places = np.array([one[:2] for one in found], np.int64).reshape(-1, 2)
    decodable, losses = _sorted_out(names, _types(text, places, header))
    if not decodable.any():
        raise BadInputError(
            f"{header.path}: must hold a GPS, Galileo, BeiDou or QZSS message, has none"
        )
    content = text.tobytes()
    starts = places[decodable, 0].tolist()
    if header.version >= 4:  # a line names the record
        starts = [content.index(b"\n", start) + 1 for start in starts]
    return NavigationScan(
        satellites=names[decodable],
        clock_times_s=np.array([one.clock_time_s for one in found])[decodable],
        numbers=np.array([numbers(content, start, int(header.version)) for start in starts]),
        klobuchar=_klobuchar(header, text),
        losses=losses,
    )


def _types(text: Bytes, places: IntArray, header: Header) -> NDArray[np.str_]:
    """Return the record and message type of each record; RINEX 2 and 3 leave it out."""
    if header.version < 4:
        return np.full(len(places), "EPH", "U8")
    heads = [
        text[start : start + 15].tobytes().decode("latin-1") for start in places[:, 0].tolist()
    ]
    return np.array(
        [f"{head[2:5]} {head[10:15].split(chr(10))[0].strip()}" for head in heads], "U8"
    )


def _sorted_out(
    names: NDArray[np.str_], types: NDArray[np.str_]
) -> tuple[NDArray[np.bool_], tuple[Loss, ...]]:
    """Return which records can be decoded, and the count of the others by reason."""
    reasons = []
    for name, what in zip(names.tolist(), types.tolist(), strict=True):
        record = what.split()
        limit = KNOWN_SATELLITES.get(name[0])
        if record[0] != "EPH":
            reasons.append((f"{record[0]} record", "not an ephemeris"))
        elif limit is None or name[0] == "R":
            reasons.append(
                (f"{CONSTELLATIONS.get(name[0], name[0])} message", "constellation not used")
            )
        elif record[1:] and record[1] not in _DECODED:
            reasons.append((f"{name[0]} {record[1]} message", "type not used"))
        elif int(name[1:]) > limit:
            reasons.append((f"{name} message", "of a number that is not used"))
        else:
            reasons.append(("", ""))
    counts: dict[tuple[str, str], int] = {}
    for reason in reasons:
        counts[reason] = counts.get(reason, 0) + 1
    losses = [Loss(what=w, reason=r, count=c) for (w, r), c in sorted(counts.items()) if w]
    return np.array([not what for what, _ in reasons]), tuple(losses)


def _klobuchar(header: Header, text: Bytes) -> NDArray[np.float64]:
    """Return the GPS ionosphere: of the head, or of the last RINEX 4 record of it."""
    model = np.array(header.klobuchar)
    if header.version < 4:
        return model
    body = text[header.size :].tobytes().decode("latin-1")
    start = max(body.rfind(f"> ION G{k:02d} LNAV") for k in range(1, 33))
    if start >= 0:
        lines = body[start:].splitlines()[1:4]
        fields = [line[4 + 19 * k : 23 + 19 * k] for line in lines for k in range(4)]
        try:
            model[:] = [float(field.replace("D", "E")) for field in fields[1:9]]
        except ValueError as error:
            number = header.lines + body[:start].count("\n") + 1
            raise BadInputError(
                f"{header.path}: line {number}: ION record must hold eight numbers, "
                f"got {quoted(' '.join(lines)[:60])}"
            ) from error
    return model
