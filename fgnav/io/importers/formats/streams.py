"""Messages of receivers' streams, of any protocol between any others, framed by their checksums.

UBX, SBF, RTCM 3 and NMEA 0183, which libraries decode, and NovAtel's logs, binary and ASCII [1]_.
Sentences without a checksum are taken where none of a stream has one.

References
----------
.. [1] NovAtel, OEM7 Commands and Logs Reference Manual, "Message Formats", BESTPOS, BESTVEL,
   HEADING2.
"""

import re
import struct
from binascii import crc32, crc_hqx
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from fgnav.io.gps_time import WEEK_S
from fgnav.io.importers.formats.readers import reader
from fgnav.io.tables import is_number

_SENTENCE = re.compile(rb"\$([A-Z]{2}[A-Z0-9]*,[\x20-\x7e]*)\*([0-9A-Fa-f]{2})(?:\r?\n|$)")
_BARE_SENTENCE = re.compile(rb"\$([A-Z]{2}[A-Z0-9]*,[\x20-\x29\x2b-\x7e]*)\r?\n")
_ASCII_LOG = re.compile(rb"[#%]([A-Z0-9]+A),[^\r\n*]*\*([0-9a-f]{8})(?:\r?\n|$)")
_SYNC = re.compile(rb"\xb5\x62|\$@|\$[A-Z]|\xaa\x44[\x12\x13]|[#%][A-Z]|\xd3[\x00-\x03]")
_LONGEST_LINE = 1000  # bytes
_HEADING = (struct.Struct("<6f"), ("", "heading", "pitch", "", "sigma_heading", "sigma_pitch"))
_LOGS = {  # by number: name, layout after status and type, and the names of what counts
    42: (
        "BESTPOS",
        struct.Struct("<3dfI3f"),
        ("latitude", "longitude", "sea", "undulation", "", "sigma_n", "sigma_e", "sigma_u"),
    ),
    99: ("BESTVEL", struct.Struct("<2f3d"), ("", "", "speed", "track", "up")),
    971: ("HEADING", *_HEADING),
    1335: ("HEADING2", *_HEADING),
    2042: ("DUALANTENNAHEADING", *_HEADING),
}
_NUMBERS = {name: number for number, (name, *_) in _LOGS.items()}


class Message(NamedTuple):
    """A message of a stream."""

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
        if not self.number:
            head = self.raw[1:].partition(b",")[0].decode()
            return head[-3:] if self.protocol == "nmea" and head[0] != "P" else head
        if self.number in _LOGS and self.protocol == "novatel":
            return _LOGS[self.number][0]
        return f"{'NovAtel' if self.protocol == 'novatel' else 'RTCM'} {self.number}"

    def decoded(self) -> Any:  # noqa: ANN401  # made by a library
        """Return the message as its library decodes it."""
        if self.protocol == "ubx":
            return reader("pyubx2", "ubx").UBXReader.parse(self.raw)
        if self.protocol == "sbf":
            return reader("pysbf2", "sbf").SBFReader.parse(self.raw)
        if self.protocol == "nmea":
            sentence = self.raw.strip()
            if not _SENTENCE.match(sentence):
                sentence += b"*%02X" % _parity(sentence[1:])
            return reader("pynmeagps", "nmea").NMEAReader.parse(sentence)
        return _log(self)


def messages(content: bytes) -> tuple[list[Message], int]:
    """Return the whole messages of a stream, and how many sentences of them have no checksum."""
    checked = list(_messages(content, _SENTENCE))
    has_checksums = any(message.protocol == "nmea" for message in checked)
    if has_checksums or not _BARE_SENTENCE.search(content):
        return checked, 0
    everything = list(_messages(content, _BARE_SENTENCE))
    return everything, sum(message.protocol == "nmea" for message in everything)


def _messages(content: bytes, sentence: re.Pattern[bytes]) -> Iterator[Message]:
    """Yield the whole messages of a stream; bytes between them are passed over."""
    at = 0
    while match := _SYNC.search(content, at):
        at = match.start()
        is_text = match[0][:1] in b"$#%" and match[0] != b"$@"
        line = content[at : at + _LONGEST_LINE]
        message = _line(line, sentence) if is_text else _binary(content, at, match[0])
        if message is not None:
            yield message
        at += 1 if message is None else len(message.raw)


def _binary(content: bytes, at: int, sync: bytes) -> Message | None:
    """Return the message in binary that begins at a place, None where none does."""
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


def _line(content: bytes, sentence: re.Pattern[bytes]) -> Message | None:
    """Return a sentence, or a log in ASCII."""
    if (match := sentence.match(content)) is not None:
        is_sound = match.re is _BARE_SENTENCE or _parity(match[1]) == int(match[2], 16)
        return Message("nmea", 0, match[0]) if is_sound else None
    if (match := _ASCII_LOG.match(content)) is not None:
        body = match[0][1:].partition(b"*")[0]
        number = _NUMBERS.get(match[1].decode()[:-1], 0)
        return Message("novatel", number, match[0]) if _crc32(body) == int(match[2], 16) else None
    return None


def _log(message: Message) -> SimpleNamespace:
    """Return GPS time and the first fields of a log, in binary or ASCII."""
    _, layout, names = _LOGS[message.number]
    if message.raw[:1] == b"\xaa":
        week, ms = struct.unpack_from("<HI", message.raw, 14)
        begin = message.raw[3]
        is_computed = not any(message.raw[begin : begin + 4])
        values, gps_s = layout.unpack_from(message.raw, begin + 8), WEEK_S * week + 1e-3 * ms
    else:
        head, _, body = message.raw.decode("ascii", "replace").partition(";")
        words, texts = head.split(","), body.partition("*")[0].split(",")
        values = tuple(float(x) if is_number(x) else np.nan for x in texts[2 : 2 + len(names)])
        is_computed, gps_s = texts[0] == "SOL_COMPUTED", WEEK_S * int(words[5]) + float(words[6])
    log = SimpleNamespace(
        gps_s=gps_s, is_computed=is_computed, **dict(zip(names, values, strict=True))
    )
    if message.number == 42:
        log.height = log.sea + log.undulation
    if message.number == 99:
        track = np.radians(log.track)
        log.north, log.east = log.speed * np.cos(track), log.speed * np.sin(track)
    return log


def _short(raw: bytes, at: int) -> int:
    return int.from_bytes(raw[at : at + 2], "little")


def _crc32(body: bytes) -> int:
    """Return NovAtel's checksum: as of binascii, without its inversions."""
    return ~crc32(body, 0xFFFFFFFF) & 0xFFFFFFFF


def _fletcher(body: bytes) -> bytes:
    """Return the checksum of u-blox's interface description, section 3.4."""
    x = np.frombuffer(body, np.uint8).astype(np.int64)
    return bytes((x.sum() & 255, (x * np.arange(len(x), 0, -1)).sum() & 255))


def _parity(body: bytes) -> int:
    """Return the checksum of NMEA 0183: exclusive or of all characters."""
    return int(np.bitwise_xor.reduce(np.frombuffer(body, np.uint8)))
