"""Positions and velocities of a track less what gravity gave, in windows."""

import numpy as np

from fgnav.geometry.earth import Origin
from fgnav.identification.track.motion import Series
from fgnav.identification.track.windows import windows_of
from fgnav.types.flight import Fixes

_LONGEST = 3000  # epochs looked at: of a longer recording those around where it moves most


def where_it_moves(fixes: Fixes) -> Fixes:
    """Return the fixes where the vehicle moves most, at most 3000."""
    n = len(fixes.t_s)
    if n <= _LONGEST:
        return fixes
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fixes.p_n_m, axis=0), axis=1))])
    first = int(np.argmax(way[_LONGEST - 1 :] - way[: n - _LONGEST + 1]))
    return fixes[first : first + _LONGEST]


def series_of(origin: Origin, fixes: Fixes) -> list[Series]:
    """Return positions and velocities less what gravity gave."""
    g_n_mps2 = origin.gravity_n_mps2(fixes.p_n_m).mean(axis=0)
    since_s = (fixes.t_s - fixes.t_s[0])[:, None]
    windows = windows_of(fixes.t_s)
    fallen_m = g_n_mps2 * since_s**2 / 2
    out = [
        Series(
            what="position",
            t_s=fixes.t_s,
            value=fixes.p_n_m - fallen_m,
            sigma=fixes.position_sigma_m,
            windows=windows,
        )
    ]
    if fixes.v_n_mps is not None and fixes.velocity_sigma_mps is not None:
        out.append(
            Series(
                what="velocity",
                t_s=fixes.t_s,
                value=fixes.v_n_mps - g_n_mps2 * since_s,
                sigma=fixes.velocity_sigma_mps,
                windows=windows,
            )
        )
    return out
