"""RTKLIB's converter to RINEX, run as a program: ``python -m fgnav.io.rtklib_convert < jobs.json``.

Jobs come and results go as of ``fgnav.io.rtklib``: a job's ``options`` are the format's name and,
behind a blank, GPS seconds near the file's start, which RTCM lacks. What stands at ``out`` is a
RINEX observation file, navigation messages beside it with the suffix ``.nav``.
"""

import json
import sys
from pathlib import Path
from typing import Any

_FORMATS = {"ubx": "UBX", "sbf": "SEPT", "novatel": "OEM4", "rtcm3": "RTCM3"}
_WEEK_S = 604_800
_SYSTEMS, _SIGNALS = 7, 64  # RTKLIB's masks of signals


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
    """Convert the files that a list of jobs on standard input names."""
    import pyrtklib5.pyrtklib5 as binding  # noqa: PLC0415  # only this process may load it

    work = json.load(sys.stdin)
    names = json.dumps({"satellites": [], "signals": []})
    Path(work["names"]).write_text(names, encoding="utf-8")
    for job in work["jobs"]:
        name, _, near_gps_s = job["options"].partition(" ")
        part = Path(job["out"] + ".part")
        outputs = [str(part), str(Path(job["out"]).with_suffix(".nav")), *[""] * 7]
        kind = getattr(binding, f"STRFMT_{_FORMATS[name]}")
        binding.convrnx(kind, options(binding, near_gps_s), job["path"], outputs)
        part.touch()  # nothing was found
        part.rename(job["out"])


if __name__ == "__main__":
    main()
