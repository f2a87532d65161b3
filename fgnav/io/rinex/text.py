"""The bytes of a RINEX or SP3 file, whatever it was packed with."""

import re
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError
from fgnav.io.user_files import read_bytes, remove_mark

Bytes = NDArray[np.uint8]
_MOST_CUT_LINES = 200  # of an epoch: a line a satellite
_CUT = b">" + b" " * 17 + b". cut\n"  # stands where an epoch begins, of any version, and is none
_BLANK_LINES = re.compile(rb"\A(?:[ \t]*\r?\n)+")


def read_text(path: Path) -> Bytes:
    """Return the plain text of a file, read-only.

    It may be packed (.gz, .Z, .bz2, .xz, .zip) or Hatanaka's (.crx), told by content, not by name.
    """
    content = remove_mark(read_bytes(path, is_text=True))
    content = _BLANK_LINES.sub(b"", content, count=1)
    if b"COMPACT RINEX FORMAT" in content[:200]:
        content = _plain(path, content)
    if not content[:1000].strip():
        raise BadInputError(f"{path}: must hold text, the file is empty")
    return np.frombuffer(content, np.uint8)


def _plain(path: Path, content: bytes) -> bytes:
    """Undo Hatanaka's compression, of a file that is cut up to its last whole epoch.

    Its warnings tell of lost data, so they are errors too.
    """
    from hatanaka import crx2rnx  # noqa: PLC0415  # lazy: looks for its program when imported

    lines = content.splitlines(keepends=True)
    reason = ""
    is_cut = not content.endswith(b"\n")  # differences: what is left of a number is another one
    for _ in range(_MOST_CUT_LINES):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", UserWarning)
                plain: bytes = crx2rnx(b"".join(lines[: len(lines) - is_cut]))
            return plain + (_CUT if is_cut else b"")
        except (RuntimeError, ValueError, UserWarning) as error:
            reason = " ".join(str(error).split())[:200]
            if "truncated" not in reason:
                break
            lines = lines[: len(lines) - is_cut]
            is_cut = True
    raise BadInputError(f"{path}: damaged Hatanaka file, {reason}; fetch it again")
