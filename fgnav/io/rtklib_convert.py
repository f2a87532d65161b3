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
from typing import Any

from fgnav.checks import BadInputError

COMMAND = (sys.executable, "-m", "fgnav.io.rtklib_convert")
TIMEOUT_S, _TIMEOUT_S_PER_MB = 60.0, 2.0  # RTKLIB reads 70 MB/s
_FORMATS = {"ubx": "UBX", "sbf": "SEPT", "novatel": "OEM4", "rtcm3": "RTCM3"}
_WEEK_S = 604_800
_SYSTEMS, _SIGNALS = 7, 64  # RTKLIB's masks of signals


def convert(
    path: Path,
    words: Sequence[str],
    *,
    command: Sequence[str] = COMMAND,
    timeout_s: float = TIMEOUT_S,
) -> None:
    """Convert a file in a child process.

    Parameters
    ----------
    path : Path
        The file, for error texts and the time that it may take.
    words : sequence of str
        Of the command line.

    Raises
    ------
    BadInputError
        If the converter crashes, hangs or cannot run: the text names the file.
    """
    roots = [str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, roots))}
    limit_s = timeout_s + _TIMEOUT_S_PER_MB * path.stat().st_size / 1e6
    try:
        done = subprocess.run(  # this interpreter, and names of files
            [*command, *words],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env=environment,
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


def options(binding: Any, near_gps_s: str) -> Any:  # noqa: ANN401  # pyrtklib5 has no types
    """Return RTKLIB's conversion options: RINEX 3.04, every system and signal."""
    chosen = binding.rnxopt_t()
    chosen.rnxver = 304
    chosen.navsys, chosen.freqtype = binding.SYS_ALL, binding.FREQTYPE_ALL
    chosen.obstype = binding.OBSTYPE_ALL
    for system in range(_SYSTEMS):
        for signal in range(_SIGNALS):
            chosen.mask[system, signal] = "1"
    chosen.autopos, chosen.outiono = 1, 1  # a position into the header, ionosphere terms
    chosen.ttol = 0.005  # s, as RTKLIB's convbin
    if near_gps_s:
        week, seconds = divmod(float(near_gps_s), _WEEK_S)
        chosen.trtcm = binding.gpst2time(int(week), seconds)
    return chosen


def main() -> None:
    """Convert the file that the command line names."""
    import pyrtklib5.pyrtklib5 as binding  # noqa: PLC0415  # only the child process may load it

    name, path, out, *near_gps_s = sys.argv[1:]
    outputs = [out, str(Path(out).with_suffix(".nav")), *[""] * 7]
    kind = getattr(binding, f"STRFMT_{_FORMATS[name]}")
    binding.convrnx(kind, options(binding, "".join(near_gps_s)), path, outputs)


if __name__ == "__main__":
    main()
