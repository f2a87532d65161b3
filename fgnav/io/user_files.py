"""The bytes of files that a user names, bounded before they are read.

Regular files only: a pipe or a device may never end. At most ``FGNAV_MAX_BYTES`` bytes of one file,
unpacked.
"""

import bz2
import codecs
import gzip
import lzma
import os
import re
import stat
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import IO, Any
from zipfile import BadZipFile, ZipFile

from fgnav.checks import BadInputError, Unused

LIMIT, DEFAULT_BYTES = "FGNAV_MAX_BYTES", 4_000_000_000
# RINEX, SP3 and CSV shrink 3 to 20 times (the recordings in use: 3.3 to 13); a bomb 1,000 times.
_MOST_UNPACKED, _PIECE_BYTES = 200, 1 << 20
PACKED = {b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"\xfd7zXZ": "xz", b"\x1f\x9d": "compress"}
PACKED[b"PK\x03\x04"] = "zip"
_OPENERS: dict[str, Callable[[BytesIO], Any]] = {
    "gzip": lambda content: gzip.GzipFile(fileobj=content),
    "bzip2": bz2.BZ2File,
    "xz": lzma.LZMAFile,
}
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}


def max_bytes() -> int:
    """Return the largest number of bytes of a file that is read."""
    text = os.environ.get(LIMIT, "")
    if not text:
        return DEFAULT_BYTES
    if not (text.isascii() and text.isdigit() and 0 < len(text) < 19 and int(text)):
        raise BadInputError(f"{LIMIT}: must be a number of bytes, got {text[:80]!r}")
    return int(text)


def read_bytes(path: Path, most: int | None = None, *, is_text: bool = False) -> bytes:
    """Return the content of a file.

    Parameters
    ----------
    most : int or None
        Bytes that are read at most; None: ``FGNAV_MAX_BYTES``.
    is_text : bool
        Whether it is text, which is unpacked where it is packed.
    """
    limit = max_bytes() if most is None else min(most, max_bytes())
    try:
        status = path.stat()
        kind = _KINDS.get(stat.S_IFMT(status.st_mode))
        if kind is not None:  # opening a pipe would wait for somebody to write
            raise BadInputError(f"{path}: must be a regular file, is {kind}")
        if status.st_size > limit:
            raise _too_large(path, f"has {status.st_size} bytes", limit)
        with path.open("rb") as file:  # what the kernel makes up (/proc) states no size
            content = file.read(status.st_size)
        return unpack(path, content) if is_text else content
    except FileNotFoundError as error:
        raise BadInputError(f"{path}: no such file; check the name") from error
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read, {error.strerror}") from error
    except ValueError as error:
        if isinstance(error, BadInputError):
            raise
        raise BadInputError(f"{str(path)!r:.80}: is no name of a file, {error}") from error  # a NUL


def encoding_of(head: bytes) -> str:
    """Return the encoding of a text by its first bytes: a byte-order mark is none of its letters.

    UTF-16 without a mark has a NUL beside each letter of ASCII.
    """
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    if head[1:2] == b"\0" and head[:1] != b"\0":
        return "utf-16-le"
    return "utf-16-be" if head[:1] == b"\0" and head[1:2] not in (b"", b"\0") else "utf-8-sig"


def remove_mark(content: bytes) -> bytes:
    """Return text with a byte-order mark in one byte a letter; other content as it is."""
    if not content.startswith((codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content
    return content.decode(encoding_of(content[:4]), "replace").encode("latin-1", "replace")


def read_lines(path: Path) -> tuple[list[str], Unused]:
    """Return the lines of a text that a program wrote, in any encoding, without their ends.

    A last line without its end is left out, since a number of it may be cut; that is counted. What
    stands after the Ctrl-Z that ends a text of DOS is none.
    """
    content = read_bytes(path)
    try:
        text = content.decode(encoding_of(content[:4]))
    except UnicodeDecodeError:
        text = content.decode("cp1252", "replace")
    lines = text.rstrip("\x1a\0").splitlines()
    is_cut = len(lines) > 1 and not text.rstrip("\0").endswith(("\n", "\r", "\x1a"))
    reason = "has no line end: the file may be cut there"
    lost = Unused(what=f"{path.name} last line", reason=reason, count=int(is_cut))
    return lines[: len(lines) - is_cut], lost


def unpack(path: Path, content: bytes) -> bytes:
    """Unpack a file of gzip, bzip2, xz, zip or compress (.Z); return other content as it is."""
    kind = next((name for magic, name in PACKED.items() if content.startswith(magic)), None)
    if kind is None:
        return content
    limit = min(max_bytes(), max(_PIECE_BYTES, _MOST_UNPACKED * len(content)))
    try:
        with _opened(kind, content) as file:
            plain = file.read(limit + 1)
    except (EOFError, OSError, ValueError, zlib.error, lzma.LZMAError, BadZipFile) as error:
        raise BadInputError(f"{path}: damaged {kind} file, {error}; fetch it again") from error
    if len(plain) > limit:
        raise _too_large(path, "unpacks to more", limit)
    return plain


def plain_name(name: str) -> str:
    """Return a file's name without the suffix of its packing."""
    return re.sub(r"\.(?:gz|bz2|xz|zip|Z)$", "", name)


def _opened(kind: str, content: bytes) -> IO[bytes]:
    """Return a stream of what packed bytes hold."""
    if kind == "compress":
        from ncompress import decompress  # noqa: PLC0415  # lazy: few files are of such age

        return BytesIO(decompress(content))
    if kind != "zip":
        stream: IO[bytes] = _OPENERS[kind](BytesIO(content))
        return stream
    archive = ZipFile(BytesIO(content))
    names = archive.namelist()
    if len(names) != 1:
        raise ValueError(f"it holds {len(names)} files, not one")
    return archive.open(names[0])


def _too_large(path: Path, what: str, limit: int) -> BadInputError:
    return BadInputError(
        f"{path}: {what}, at most {limit} are read; {LIMIT} (in bytes) raises the general limit"
    )
