"""Strict check of a RINEX navigation file, which also sorts out what RTKLIB can decode."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, IntArray, Loss, quoted
from fgnav.io.rinex.header import Header
from fgnav.io.rinex.scan import CONSTELLATIONS, KNOWN_SATELLITES, line_fault
from fgnav.io.rinex.text import Bytes

_DECODED = ("LNAV", "INAV", "FNAV", "D1", "D2")  # RINEX 4 messages laid out as in RINEX 3
_PROBLEMS = {
    1: "a message must start here with its satellite and time",
    2: "the message ends before its last line",
    3: "column {column}: must be a number such as -1.234567890123E-04",
    4: "the last line is cut, it has no line end",
    5: "column {column}: must not be blank",
    6: "a RINEX 4 record must start here with '> '",
}


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class NavigationScan:
    """The messages of a navigation file that can be decoded, and the count of the others."""

    satellites: NDArray[np.str_]  # (k,); RINEX names, in the order of the file
    text: Bytes  # a RINEX file of these messages alone
    klobuchar: NDArray[np.float64]  # (8,); GPS ionosphere, alpha and beta
    losses: tuple[Loss, ...]  # what stands in the file and is not used


def scan_navigation(header: Header, text: Bytes) -> NavigationScan:
    """Check the body of a navigation file and take the messages that can be decoded.

    Parameters and errors are those of ``fgnav.io.rinex.scan.scan_observations``.
    """
    from fgnav.io.rinex.navigation_kernel import scan_messages  # noqa: PLC0415  # lazy: numba

    rows = int(np.count_nonzero(text == ord("\n"))) + 1
    messages, problem = np.zeros((rows, 5), np.int64), np.zeros(3, np.int64)
    start = np.array([header.size, header.lines + 1])
    default = ord(header.system) if header.version < 3 else 0
    count = scan_messages(text, start, int(header.version), default, messages, problem)
    if problem[0]:
        raise BadInputError(_problem(header, text, problem))
    messages = messages[:count]
    names = np.array([f"{chr(c)}{k:02d}" for c, k in messages[:, 3:5].tolist()], "U3")
    decodable, losses = _sorted_out(names, _types(text, messages, header))
    if not decodable.any():
        raise BadInputError(
            f"{header.path}: must hold a GPS, Galileo, BeiDou or QZSS message, has none"
        )
    keep = np.zeros(len(text) + 1, np.int8)
    np.add.at(keep, messages[decodable, 0], 1)
    np.add.at(keep, messages[decodable, 1], -1)
    body = text[np.cumsum(keep[:-1]).astype(bool)]
    return NavigationScan(
        satellites=names[decodable],
        text=np.concatenate([_head(header, text), body]),
        klobuchar=_klobuchar(header, text),
        losses=losses,
    )


def _types(text: Bytes, messages: IntArray, header: Header) -> NDArray[np.str_]:
    """Return the record and message type of each record; RINEX 2 and 3 leave it out."""
    if header.version < 4:
        return np.full(len(messages), "EPH", "U8")
    heads = [
        text[start : start + 15].tobytes().decode("latin-1") for start in messages[:, 0].tolist()
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
        elif limit is None:
            reasons.append((f"{CONSTELLATIONS[name[0]]} message", "constellation not used"))
        elif record[1:] and record[1] not in _DECODED:
            reasons.append((f"{name[0]} {record[1]} message", "type unknown to RTKLIB's reader"))
        elif int(name[1:]) > limit:
            reasons.append((f"{name} message", "satellite unknown to RTKLIB"))
        else:
            reasons.append(("", ""))
    counts: dict[tuple[str, str], int] = {}
    for reason in reasons:
        counts[reason] = counts.get(reason, 0) + 1
    losses = [Loss(what=w, reason=r, count=c) for (w, r), c in sorted(counts.items()) if w]
    return np.array([not what for what, _ in reasons]), tuple(losses)


def _head(header: Header, text: Bytes) -> Bytes:
    """Return a head for the decodable messages: RINEX 4 becomes the RINEX 3 that RTKLIB knows."""
    if header.version < 4:
        return text[: header.size]
    lines = "     3.05           NAVIGATION DATA     M                   RINEX VERSION / TYPE\n"
    lines += f"{'':60s}END OF HEADER\n"
    return np.frombuffer(lines.encode("ascii"), np.uint8)


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


def _problem(header: Header, text: Bytes, problem: IntArray) -> str:
    """Return the sentence that tells what is wrong in which line."""
    code, line, column = (int(k) for k in problem)
    rule = _PROBLEMS[code].format(column=column)
    return line_fault(header, text, line, rule, "fetch the file again")
