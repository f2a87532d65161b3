"""RTKLIB's converter to RINEX: ``python -m fgnav.io.rtklib_convert FORMAT FILE OUT [GPS_SECONDS]``.

A program of its own, since the C code may crash or hang on damaged files. What stands at ``OUT`` is
a RINEX observation file, navigation messages beside it with the suffix ``.nav``; ``GPS_SECONDS``
are near the file's start, which RTCM lacks.
"""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from fgnav.checks import BadInputError
from fgnav.io.gps_time import WEEK_S

_COMMAND = (sys.executable, "-m", "fgnav.io.rtklib_convert")
_TIMEOUT_S, _TIMEOUT_S_PER_MB = 60.0, 2.0  # RTKLIB reads 70 MB/s
_FORMATS = {"ubx": "UBX", "sbf": "SEPT", "novatel": "OEM4", "rtcm3": "RTCM3"}
_SYSTEMS, _SIGNALS = 7, 64  # RTKLIB's masks of signals


def convert(
    path: Path,
    words: Sequence[str],
    *,
    command: Sequence[str] = _COMMAND,
    timeout_s: float = _TIMEOUT_S,
) -> None:
    """Convert a file, by the words of a command line, in a child process."""
    limit_s = timeout_s + _TIMEOUT_S_PER_MB * path.stat().st_size / 1e6
    try:
        done = subprocess.run(  # this interpreter, and names of files
            [*command, *words],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            text=True,
            timeout=limit_s,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise BadInputError(
            f"{path}: RTKLIB did not end within {limit_s:.0f} s; the file is damaged"
        ) from error
    if done.returncode > 0 and done.stderr:
        reason = done.stderr.strip().splitlines()[-1]
        raise BadInputError(f"RTKLIB cannot run: {reason}; pip install 'fgnav[importers]'")
    if done.returncode:
        raise BadInputError(
            f"{path}: RTKLIB crashed (status {done.returncode}); the file is damaged"
        )


def main() -> None:
    """Convert the file that the command line names: RINEX 3.04, every system and signal."""
    import pyrtklib5.pyrtklib5 as rtklib  # noqa: PLC0415  # only the child process may load it

    name, path, out, near_gps_s = sys.argv[1:]
    options = rtklib.rnxopt_t()
    options.rnxver, options.obstype = 304, rtklib.OBSTYPE_ALL
    options.navsys, options.freqtype = rtklib.SYS_ALL, rtklib.FREQTYPE_ALL
    for system in range(_SYSTEMS):
        for signal in range(_SIGNALS):
            options.mask[system, signal] = "1"
    options.autopos, options.outiono = 1, 1  # a position into the header, ionosphere terms
    options.ttol = 0.005  # s, as RTKLIB's convbin
    if near_gps_s:
        week, seconds = divmod(float(near_gps_s), WEEK_S)
        options.trtcm = rtklib.gpst2time(int(week), seconds)
    outputs = [out, str(Path(out).with_suffix(".nav")), *[""] * 7]
    rtklib.convrnx(getattr(rtklib, f"STRFMT_{_FORMATS[name]}"), options, path, outputs)


if __name__ == "__main__":
    main()
