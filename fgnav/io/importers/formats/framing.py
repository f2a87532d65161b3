"""What RTKLIB passes over in a receiver's file: messages of other kinds, and bytes of none."""

from binascii import crc32, crc_hqx
from collections import Counter
from collections.abc import Callable, Container
from functools import cache
from typing import NamedTuple

import numpy as np

from fgnav.checks import IntArray
from fgnav.io.importers.formats.nmea import SENTENCE

_CRC24Q = 0x1864CFB  # polynomial, RTCM 10403.3, section 4
_LONGEST_RTCM3 = 1029  # bytes: ten bits of length, a head of three, the CRC


class _Frame(NamedTuple):
    """How a format frames its messages."""

    sync: bytes
    head: int  # bytes that tell the length
    length: Callable[[bytes], int]  # of the message, from these
    is_whole: Callable[[bytes], bool]  # a message of that length
    kind: Callable[[bytes], int]  # a message's number
    decoded: Container[int]  # kinds that RTKLIB decodes


def passed_over(content: bytes, format: str) -> tuple[Counter[int], int]:  # noqa: A002
    """Return messages that RTKLIB does not decode, by number, and bytes of no whole message.

    Sentences of NMEA are counted as message 0.

    Parameters
    ----------
    format : {"ubx", "sbf", "novatel", "rtcm3"}
    """
    frame = _FRAMES[format]
    kinds: Counter[int] = Counter()
    done = 0
    between = []
    at = content.find(frame.sync)
    while at >= 0:
        head = content[at : at + frame.head]
        message = content[at : at + frame.length(head)] if len(head) == frame.head else b""
        if message and len(message) == frame.length(head) and frame.is_whole(message):
            kinds[frame.kind(message)] += frame.kind(message) not in frame.decoded
            between.append(content[done:at])
            done = at = at + len(message)
        else:
            at += 1
        at = content.find(frame.sync, at)
    others = [SENTENCE.subn(b"", one) for one in (*between, content[done:])]
    kinds[0] += sum(count for _, count in others)
    return +kinds, sum(len(rest) for rest, _ in others)


def _short(head: bytes, at: int) -> int:
    return int.from_bytes(head[at : at + 2], "little")


def _big(head: bytes, at: int = 2) -> int:
    return int.from_bytes(head[at : at + 2], "big")


def _ubx_is_whole(message: bytes) -> bool:
    """Compare Fletcher's sums, u-blox interface description, section 3.4."""
    part = np.frombuffer(message, np.uint8)[2:-2].astype(np.int64)
    sums = part.sum() & 255, (part * np.arange(len(part), 0, -1)).sum() & 255
    return bytes(sums) == message[-2:]


def _sbf_is_whole(message: bytes) -> bool:
    """Compare the CRC, SBF reference guide, section 4.1."""
    return len(message) >= 8 and crc_hqx(message[4:], 0) == _short(message, 2)


def _novatel_is_whole(message: bytes) -> bool:
    """Compare the CRC, OEM7 manual, "32-bit CRC": as of binascii, without its inversions."""
    crc = ~crc32(message[:-4], 0xFFFFFFFF) & 0xFFFFFFFF
    return crc.to_bytes(4, "little") == message[-4:]


@cache
def _remainders() -> IntArray:
    """Return what each byte leaves of a CRC that is a sum, (bytes behind it, byte)."""
    last = np.arange(256) << 16
    for _ in range(8):
        last = last << 1 ^ np.where(last & 1 << 23, _CRC24Q, 0)
    table = np.empty((_LONGEST_RTCM3, 256), dtype=np.int64)
    table[0] = last
    for k in range(1, _LONGEST_RTCM3):
        table[k] = (table[k - 1] << 8 & 0xFFFFFF) ^ last[table[k - 1] >> 16]
    return table


def _rtcm3_is_whole(message: bytes) -> bool:
    """Compare the CRC; none is left where its own bytes are taken in."""
    behind = np.arange(len(message) - 1, -1, -1)
    remainders = _remainders()[behind, np.frombuffer(message, np.uint8)]
    return not np.bitwise_xor.reduce(remainders)


# Kinds that RTKLIB 2.5.0 decodes: of UBX class and number, of SBF the block's number.
_UBX = (0x0120, 0x0210, 0x0211, 0x0213, 0x0215, 0x030F, 0x0310)
_SBF: tuple[int, ...] = (
    4002,
    4004,
    4017,
    4018,
    4019,
    4020,
    4021,
    4022,
    4023,
    4026,
    4027,
    4030,
    4031,
    4047,
    4066,
)
_SBF += (4081, 4093, 4095, 5891, 5893, 5894, 5896)
_NOVATEL = (7, 8, 41, 43, 140, 287, 723, 1121, 1122, 1127, 1273, 1330, 1331, 1347, 1696)
_RTCM3 = (*range(1001, 1014), 1019, 1020, 1033, *range(1041, 1047), *range(1071, 1138), 1230)
_FRAMES = {  # sizes by the head, kinds by the first six bytes
    "ubx": _Frame(b"\xb5\x62", 6, lambda b: 8 + _short(b, 4), _ubx_is_whole, _big, _UBX),
    "sbf": _Frame(
        b"$@", 8, lambda b: _short(b, 6), _sbf_is_whole, lambda b: _short(b, 4) & 8191, _SBF
    ),
    "novatel": _Frame(
        b"\xaa\x44\x12",
        10,
        lambda b: b[3] + _short(b, 8) + 4,
        _novatel_is_whole,
        lambda b: _short(b, 4),
        _NOVATEL,
    ),
    "rtcm3": _Frame(
        b"\xd3",
        3,
        lambda b: 6 + (_big(b, 1) & 1023),
        _rtcm3_is_whole,
        lambda b: _big(b, 3) >> 4,
        _RTCM3,
    ),
}
