"""Writing precise orbits and clocks in SP3-d format."""

from pathlib import Path

import numpy as np

from fgnav.io.gps_time import WEEK_S, gps_s_to_date
from fgnav.types.orbits import PreciseOrbits

_NO_CLOCK = 999_999.999999


def write_precise(path: Path, orbits: PreciseOrbits, *, start_gps_s: float) -> None:
    """Write precise orbits: millimetres and picoseconds.

    Parameters
    ----------
    start_gps_s : float
        GPS time of ``t_s = 0``.
    """
    gps_s = start_gps_s + orbits.t_s
    names = list(orbits.satellites)
    step_s = float(np.median(np.diff(gps_s))) if len(gps_s) > 1 else 0.0
    week, second = divmod(gps_s[0], WEEK_S)
    day = int(gps_s[0] // 86_400)
    modified_julian = 44_244 + day  # MJD of 1980-01-06
    lines = [
        f"#dP{_date(gps_s[0])} {len(gps_s):7d} ORBIT IGS14 FIT FGNV",
        f"## {int(week):4d} {second:15.8f} {step_s:14.8f} {modified_julian:5d} "
        f"{gps_s[0] / 86_400 - day:15.13f}",
    ]
    padded = names + ["  0"] * (max(85, -(-len(names) // 17) * 17) - len(names))
    for k in range(0, len(padded), 17):
        count = f"{len(names):3d}" if k == 0 else "   "
        lines.append(f"+  {count}   " + "".join(padded[k : k + 17]))
    lines += ["++       " + "  0" * 17] * (len(padded) // 17)
    lines += ["%c M  cc GPS ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc"]
    lines += ["%c cc cc ccc ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc"]
    km, clock_us = np.nan_to_num(orbits.p_e_m / 1e3), orbits.clock_s * 1e6
    clock_us = np.where(np.isfinite(clock_us), clock_us, _NO_CLOCK)
    for k, moment in enumerate(gps_s):
        lines.append(f"*  {_date(moment)}")
        lines += [
            f"P{name}{x:14.6f}{y:14.6f}{z:14.6f}{clock:14.6f}"
            for name, (x, y, z), clock in zip(
                names, km[k].tolist(), clock_us[k].tolist(), strict=True
            )
        ]
    path.write_text("\n".join([*lines, "EOF"]) + "\n", encoding="ascii")


def _date(gps_s: float) -> str:
    """Return year, month, day, hour, minute, second in SP3's columns."""
    whole_s, microseconds = divmod(round(gps_s * 1e6), 1_000_000)
    year, month, day, hour, minute, second = gps_s_to_date(whole_s)
    date = f"{year:4d} {month:2d} {day:2d} {hour:2d} {minute:2d}"
    return f"{date} {second + microseconds / 1e6:11.8f}"
