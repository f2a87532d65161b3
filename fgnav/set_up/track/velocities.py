"""Whether a receiver's velocities are the change of its positions: unit, axes, age."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from fgnav.checks import FloatArray
from fgnav.identification.track.integrals import sampled, summed
from fgnav.identification.track.windows import (
    Fitted,
    Windows,
    explains_more,
    fitted,
    windows_of,
)
from fgnav.set_up.findings import Finding
from fgnav.set_up.track.axes import named_axes, signed_permutations
from fgnav.types.flight import Fixes

UNITS = {"m/s": 1.0, "knots": 1852 / 3600, "km/h": 1 / 3.6, "ft/s": 0.3048, "cm/s": 0.01}
_STEPS = 4  # of Gauss-Newton
_AXES = ("vn_mps", "ve_mps", "vd_mps")


@dataclass(frozen=True, slots=True, kw_only=True)
class Age:
    """How old velocities are, s, and how far a right flight's might seem to be."""

    old_s: float
    sigma_s: float
    reach_s: float


def velocity_findings(fixes: Fixes) -> tuple[list[Finding], Age | None]:
    """Return what is wrong with velocities beside positions; and their age, where that is told."""
    windows = windows_of(fixes.t_s)
    if fixes.v_n_mps is None or len(windows) < 2:
        return [], None
    tried = []
    way_m, speed_mps = _moved(fixes.t_s, fixes.v_n_mps, windows, 0.0)
    for (unit, factor), axes in product(UNITS.items(), signed_permutations()):
        read = factor * axes.T
        here = _fit(fixes, windows, way_m @ read, speed_mps @ read)
        changes = int((np.diag(axes) < 1).sum()) + (factor != 1.0)
        tried.append((float(np.log(here.squares + 1e-12).mean()), changes, here, unit, axes))
    tried.sort(key=lambda one: one[0])
    best, stated = tried[0], next(one for one in tried if one[1] == 0)
    if best[1] and explains_more(stated[2], best[2], len(tried)):
        equal = [one for one in tried if not explains_more(one[2], best[2], len(tried))]
        _, _, _, unit, axes = min(equal, key=lambda one: (one[1], one[0]))
        return [_columns(unit, axes)], None
    here, old_s = _fit(fixes, windows, way_m, speed_mps), 0.0
    spacing_s = float(np.median(np.diff(fixes.t_s)))
    for _ in range(_STEPS):
        old_s += float(np.clip(here.x[0], -spacing_s, spacing_s))
        here = _fit(fixes, windows, *_moved(fixes.t_s, fixes.v_n_mps, windows, old_s))
    return [], Age(old_s=old_s, sigma_s=here.sigma(0), reach_s=here.reach(0))


def _columns(unit: str, axes: FloatArray) -> Finding:
    parts, mends = [], []
    if unit != "m/s":
        parts.append(f"are in {unit}")
        mends.append(f"multiply by {UNITS[unit]:.6g}")
    if (axes != np.eye(3)).any():
        parts.append("have other axes than north, east, down")
        mends.append(f"{', '.join(_AXES)} should read {named_axes(axes, _AXES)}")
    return Finding(
        name="fixes velocity",
        where="[fixes] samples, " + ", ".join(_AXES),
        text=f"velocities {' and '.join(parts)}: positions change so",
        mend="; ".join(mends),
        certain=True,
    )


def _moved(
    t_s: FloatArray, v_n_mps: FloatArray, windows: Windows, old_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return ways from each window's begin and speeds, (W, n, 3), by velocities of an age."""
    row = windows.row
    at_s = (t_s[row] + old_s).ravel()  # what belongs to t stands at t + age
    way_m = sampled(t_s, summed(t_s, v_n_mps), at_s).reshape(*row.shape, 3)
    return way_m - way_m[:, :1], sampled(t_s, v_n_mps, at_s).reshape(*row.shape, 3)


def _fit(fixes: Fixes, windows: Windows, way_m: FloatArray, speed_mps: FloatArray) -> Fitted:
    """Fit each window's place, and how much older all velocities are, s."""
    row, k = windows.row, 3 * windows.row.shape[1]
    white = np.where(windows.inside[..., None], 1.0 / fixes.position_sigma_m[row], 0.0)
    apart = fixes.p_n_m[row] - fixes.p_n_m[row[:, :1]] - way_m
    return fitted(
        (white * apart).reshape(-1, k),
        (white[..., None] * np.eye(3)).reshape(-1, k, 3),
        (white * speed_mps).reshape(-1, k, 1),
        np.zeros(3),
    )
