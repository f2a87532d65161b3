"""RTKLIB's RINEX reader, run as a program of its own: ``python -m fgnav.io.rtklib < jobs.json``.

The C code never complains and may crash or hang on damaged files, so it lives in a child process
(see ``fgnav.io.decoder``), which writes its arrays to files as they lie in memory. It imports no
numpy: that would take longer than reading 7 MB.

pyrtklib5 (RTKLIB demo5/EX 2.5.0) was chosen over pyrtklib (2.4.3 b34) by measurement: both decode
the same number of records of observation files and of RINEX 2 and 3 navigation files; pyrtklib5
needs 0.10 s for 7.4 MB of 1 Hz observations, pyrtklib 0.17 s. Neither knows the records of RINEX 4
navigation files apart (a CNAV message comes out as a wrong LNAV one), so those are sorted before
they come here. pyrtklib5 knows BeiDou only up to C46, pyrtklib up to C63; what lies above is
counted as lost.

Reading one field through the Python binding costs about a microsecond, so the exported C functions
are called directly and their arrays viewed in place. The layout of the structures is checked
against the binding on a small built-in file each time.
"""

import ctypes
import json
import sys
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

_NAV_BYTES = 1 << 24  # more than any nav_t; only the head is looked at
_EPH_POINTER = 56  # offset of nav_t.eph, after fourteen counters


class Moment(ctypes.Structure):
    """RTKLIB's ``gtime_t``."""

    _fields_ = (("time", ctypes.c_longlong), ("sec", ctypes.c_double))


class Record(ctypes.Structure):
    """RTKLIB's ``obsd_t`` with three frequencies: one satellite at one epoch."""

    _fields_ = (
        ("time", Moment),
        ("sat", ctypes.c_uint8),
        ("rcv", ctypes.c_uint8),
        ("freq", ctypes.c_uint8),
        ("LLI", ctypes.c_uint8 * 3),
        ("code", ctypes.c_uint8 * 3),
        ("L", ctypes.c_double * 3),
        ("P", ctypes.c_double * 3),
        ("D", ctypes.c_float * 3),
        ("SNR", ctypes.c_float * 3),
        ("Lstd", ctypes.c_float * 3),
        ("Pstd", ctypes.c_float * 3),
        ("timevalid", ctypes.c_int),
        ("eventime", Moment),
    )


_INTEGERS = ("sat", "iode", "iodc", "sva", "svh", "week", "code", "flag")
_MOMENTS = ("toe", "toc", "ttr")
_REALS = ("A", "e", "i0", "OMG0", "omg", "M0", "deln", "OMGd", "idot", "crc", "crs", "cuc", "cus")
_REALS_TOO = ("cic", "cis", "toes", "fit", "f0", "f1", "f2")


class Message(ctypes.Structure):
    """RTKLIB's ``eph_t``: one broadcast message."""

    _fields_ = (
        *((name, ctypes.c_int) for name in _INTEGERS),
        *((name, Moment) for name in _MOMENTS),
        *((name, ctypes.c_double) for name in (*_REALS, *_REALS_TOO)),
        ("tgd", ctypes.c_double * 6),
        ("Adot", ctypes.c_double),
        ("ndot", ctypes.c_double),
    )


class _Obs(ctypes.Structure):
    """RTKLIB's ``obs_t``."""

    _fields_ = (
        ("n", ctypes.c_int),
        ("nmax", ctypes.c_int),
        ("flag", ctypes.c_int),
        ("rcvcount", ctypes.c_int),
        ("tmcount", ctypes.c_int),
        ("data", ctypes.c_void_p),
    )


STRUCTURES: dict[str, type[ctypes.Structure]] = {"observations": Record, "navigation": Message}

_SAMPLE_HEADER = """\
     3.04           OBSERVATION DATA    M                   RINEX VERSION / TYPE
G   12 C1C L1C D1C S1C C2W L2W D2W S2W C5Q L5Q D5Q S5Q      SYS / # / OBS TYPES
  2020     6    25     0     0    0.0000000     GPS         TIME OF FIRST OBS
                                                            END OF HEADER
"""
_SAMPLE_MESSAGE = """\
     3.04           NAVIGATION DATA     M                   RINEX VERSION / TYPE
                                                            END OF HEADER
"""


def read(library: ctypes.CDLL, kind: str, path: str, options: str) -> ctypes.Array[Any]:
    """Return the records of a file in place, as the C code keeps them.

    Parameters
    ----------
    library : ctypes.CDLL
        The extension module of pyrtklib5, which exports RTKLIB's functions.
    kind : {"observations", "navigation"}
    path, options : str
        Plain RINEX file, and RTKLIB's reading options.

    Returns
    -------
    ctypes array of Record or Message
    """
    address: int | None
    if kind == "observations":
        obs = _Obs()
        library.readrnx(path.encode(), 1, options.encode(), ctypes.byref(obs), None, None)
        count, address = obs.n, obs.data
    else:
        nav = ctypes.create_string_buffer(_NAV_BYTES)
        library.readrnx(path.encode(), 1, options.encode(), None, nav, None)
        count = ctypes.c_int.from_buffer(nav).value
        address = ctypes.c_void_p.from_buffer(nav, _EPH_POINTER).value
    if not count or not address:
        return (STRUCTURES[kind] * 0)()
    records: ctypes.Array[Any] = (STRUCTURES[kind] * count).from_address(address)
    return records


def _samples() -> tuple[str, str]:
    """Return a small observation and a small navigation file, every field with its own value."""
    fields = "".join(f"{1000.125 + 8 * k:14.3f}1 " for k in range(12))
    record = _SAMPLE_HEADER + "> 2020 06 25 00 00  0.5000000  0  2\nG05" + fields + "\nG07" + fields
    numbers = [f"{0.0625 + k / 64:19.12e}" for k in range(34)]
    rows = ["    " + "".join(numbers[k : k + 4]) for k in range(3, 31, 4)]
    head = "G05 2020 06 25 00 00 00" + "".join(numbers[:3])
    return record + "\n", _SAMPLE_MESSAGE + "\n".join([head, *rows] * 2) + "\n"


def differing_fields(binding: ModuleType, library: ctypes.CDLL, folder: str) -> list[str]:
    """Return the fields where the view of the memory and the binding disagree.

    Parameters
    ----------
    binding : module
        ``pyrtklib5.pyrtklib5``, whose objects know the layout.
    library : ctypes.CDLL
        The same file.
    folder : str
        Where small files may be written.
    """
    wrong = []
    for kind, text in zip(STRUCTURES, _samples(), strict=True):
        path = Path(folder) / kind
        path.write_text(text, encoding="ascii")
        obs, nav, station = binding.obs_t(), binding.nav_t(), binding.sta_t()
        binding.readrnx(str(path), 1, "", obs, nav, station)
        count, bound = (obs.n, obs.data) if kind == "observations" else (nav.n, nav.eph)
        seen = read(library, kind, str(path), "")
        if len(seen) != count or not count:
            return [f"{kind}: number of records"]
        last, expected = seen[count - 1], bound[count - 1]
        for name, *_ in STRUCTURES[kind]._fields_:
            mine, theirs = getattr(last, name), getattr(expected, name)
            if isinstance(mine, Moment):
                same = (mine.time, mine.sec) == (theirs.time, theirs.sec)
            elif isinstance(mine, ctypes.Array):
                same = list(mine) == [theirs[k] for k in range(len(mine))]
            else:
                same = mine == theirs
            wrong += [] if same else [f"{kind}: {name}"]
    return wrong


def _names(binding: ModuleType, library: ctypes.CDLL) -> dict[str, list[str]]:
    """Return RINEX names by RTKLIB's satellite numbers, and signals by its code numbers."""
    text = ctypes.create_string_buffer(16)
    satellites = [""]
    for number in range(1, binding.MAXSAT + 1):
        library.satno2id(number, text)
        satellites.append(text.value.decode())
    library.code2obs.restype = ctypes.c_char_p
    signals = [library.code2obs(ctypes.c_uint8(k)).decode() for k in range(binding.MAXCODE + 1)]
    return {"satellites": satellites, "signals": signals}


def main() -> None:
    """Decode the files that a list of jobs on standard input names.

    The list is JSON, ``{names, jobs: [{kind, path, options, out}]}``. The records of each file are
    written to ``out`` when they are whole, the names of satellites and signals to ``names`` (JSON).
    """
    import pyrtklib5.pyrtklib5 as binding  # noqa: PLC0415  # only this process may load it

    library = ctypes.CDLL(binding.__file__)
    with tempfile.TemporaryDirectory() as folder:
        wrong = differing_fields(binding, library, folder)
    if wrong:
        sys.exit(f"pyrtklib5 has another memory layout than expected: {', '.join(wrong)}")
    work = json.load(sys.stdin)
    Path(work["names"]).write_text(json.dumps(_names(binding, library)), encoding="utf-8")
    for job in work["jobs"]:
        records = read(library, job["kind"], job["path"], job["options"])
        part = Path(job["out"] + ".part")
        part.write_bytes(memoryview(records).cast("B") if len(records) else b"")
        part.rename(job["out"])


if __name__ == "__main__":
    main()
