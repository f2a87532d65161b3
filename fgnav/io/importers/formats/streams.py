"""Messages of receivers' streams, of any protocol between any others, framed by their checksums.

UBX, SBF, RTCM 3 and NMEA 0183, which libraries decode, and NovAtel's logs, binary and ASCII [1]_.

References
----------
.. [1] NovAtel, OEM7 Commands and Logs Reference Manual, "Message Formats", BESTPOS, BESTVEL,
   HEADING2.
"""

import re
import struct
from binascii import crc32, crc_hqx
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from fgnav.io.gps_time import WEEK_S
from fgnav.io.importers.formats.readers import reader
from fgnav.io.tables import is_number

_SENTENCE = re.compile(rb"\$([A-Z]{2}[A-Z0-9]*),([\x20-\x7e]*)\*([0-9A-Fa-f]{2})(?:\r?\n|$)")
_ASCII_LOG = re.compile(rb"[#%]([A-Z0-9]+A),[^\r\n*]*\*([0-9a-f]{8})(?:\r?\n|$)")
_SYNC = re.compile(rb"\xb5\x62|\$@|\$[A-Z]|\xaa\x44[\x12\x13]|[#%][A-Z]|\xd3[\x00-\x03]")
_LONGEST_LINE = 1000  # bytes
_LOGS = {b"BESTPOSA": 42, b"BESTVELA": 99, b"HEADINGA": 971, b"HEADING2A": 1335}
_LOGS[b"DUALANTENNAHEADINGA"] = 2042
_HEADING = struct.Struct("<II6f")  # length, heading, pitch, and behind a spare one their sigmas
_LAYOUTS = {  # status and type of the solution, then the fields that count
    42: struct.Struct("<II3dfI3f"),  # place, undulation, datum, sigmas
    99: struct.Struct("<II2f3d"),  # latency, age, speed, track, upwards
    **dict.fromkeys((971, 1335, 2042), _HEADING),
}


class Log(NamedTuple):
    """A log of NovAtel's: the OEM7 reference [1]_ has its fields."""

    number: int
    gps_s: float  # GPS time
    is_computed: bool
    fields: tuple[float, ...]  # after its status and type


class Message(NamedTuple):
    """A message that its checksum has proved."""

    protocol: str  # ``ubx``, ``sbf``, ``novatel``, ``rtcm3``, ``nmea``
    number: int  # its kind; 0 of text
    raw: bytes

    @property
    def name(self) -> str:
        """Return its name in the protocol's document, or its number."""
        if self.protocol == "ubx":
            names = reader("pyubx2", "ubx").UBX_MSGIDS
            return str(names.get(self.number.to_bytes(2, "big"), f"UBX {self.number:04X}"))
        if self.protocol == "sbf":
            names = reader("pysbf2", "sbf").SBF_MSGIDS
            return str(names.get(self.number, (f"SBF {self.number}",))[0])
        if self.protocol == "nmea":
            head = self.raw[1:].partition(b",")[0].decode()
            return head if head.startswith("P") else head[-3:]
        if self.protocol == "novatel" and not self.number:
            return self.raw[1:].partition(b",")[0].decode()
        return f"{'NovAtel' if self.protocol == 'novatel' else 'RTCM'} {self.number}"

    def decoded(self) -> Any:  # noqa: ANN401  # made by a library
        """Return the message as its library decodes it."""
        if self.protocol == "ubx":
            return reader("pyubx2", "ubx").UBXReader.parse(self.raw)
        if self.protocol == "sbf":
            return reader("pysbf2", "sbf").SBFReader.parse(self.raw)
        if self.protocol == "nmea":
            return reader("pynmeagps", "nmea").NMEAReader.parse(self.raw)
        return _log(self)


def messages(content: bytes) -> Iterator[Message]:
    """Yield the whole messages of a stream; bytes between them are passed over."""
    at = 0
    while match := _SYNC.search(content, at):
        at = match.start()
        message = _message(content, at, match[0])
        if message is None:
            at += 1
        else:
            yield message
            at += len(message.raw)


def _message(content: bytes, at: int, sync: bytes) -> Message | None:
    """Return the message that begins at a place, None where none does."""
    if sync[:1] in b"$#%" and sync != b"$@":
        return _line(content[at : at + _LONGEST_LINE])
    head = content[at : at + 10].ljust(10, b"\0")
    size = {
        b"\xb5\x62": 8 + _short(head, 4),
        b"$@": _short(head, 6),
        b"\xaa\x44\x12": head[3] + _short(head, 8) + 4,
        b"\xaa\x44\x13": 12 + head[3] + 4,
    }.get(sync, 6 + (int.from_bytes(head[1:3], "big") & 1023))
    raw = content[at : at + size]
    if len(raw) < size or size < 6:
        return None
    if sync == b"\xb5\x62":
        message = Message("ubx", int.from_bytes(raw[2:4], "big"), raw)
        return message if _fletcher(raw[2:-2]) == raw[-2:] else None
    if sync == b"$@":
        message = Message("sbf", _short(raw, 4) & 8191, raw)
        return message if crc_hqx(raw[4:], 0) == _short(raw, 2) else None
    if sync[:1] == b"\xaa":
        message = Message("novatel", _short(raw, 4), raw)
        return message if _crc32(raw[:-4]) == int.from_bytes(raw[-4:], "little") else None
    crc24 = reader("pyrtcm", "rtcm3").calc_crc24q
    return None if crc24(raw) else Message("rtcm3", int.from_bytes(raw[3:5], "big") >> 4, raw)


def _log(message: Message) -> Log:
    """Return the first fields of a log, in binary or ASCII."""
    layout = _LAYOUTS[message.number]
    if message.raw[:1] == b"\xaa":
        week, ms = struct.unpack_from("<HI", message.raw, 14)
        status, _, *values = layout.unpack_from(message.raw, message.raw[3])
        return Log(message.number, WEEK_S * week + 1e-3 * ms, status == 0, tuple(values))
    head, _, body = message.raw.decode("ascii", "replace").partition(";")
    words, texts = head.split(","), body.partition("*")[0].split(",")
    count = len(layout.unpack(bytes(layout.size))) - 2
    values = [float(text) if is_number(text) else np.nan for text in texts[2 : 2 + count]]
    gps_s = WEEK_S * int(words[5]) + float(words[6])
    return Log(message.number, gps_s, texts[0] == "SOL_COMPUTED", tuple(values))


def _line(content: bytes) -> Message | None:
    """Return a sentence, or a log in ASCII."""
    if (match := _SENTENCE.match(content)) is not None:
        total = np.bitwise_xor.reduce(np.frombuffer(match[1] + b"," + match[2], np.uint8))
        return Message("nmea", 0, match[0]) if total == int(match[3], 16) else None
    if (match := _ASCII_LOG.match(content)) is not None:
        body = match[0][1:].partition(b"*")[0]
        number = _LOGS.get(match[1], 0)
        return Message("novatel", number, match[0]) if _crc32(body) == int(match[2], 16) else None
    return None


def _short(raw: bytes, at: int) -> int:
    return int.from_bytes(raw[at : at + 2], "little")


def _crc32(body: bytes) -> int:
    """Return NovAtel's checksum: as of binascii, without its inversions."""
    return ~crc32(body, 0xFFFFFFFF) & 0xFFFFFFFF


def _fletcher(body: bytes) -> bytes:
    """Return the checksum of u-blox's interface description, section 3.4."""
    part = np.frombuffer(body, np.uint8).astype(np.int64)
    return bytes((part.sum() & 255, (part * np.arange(len(part), 0, -1)).sum() & 255))
