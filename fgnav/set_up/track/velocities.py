"""Whether a receiver's velocities are the change of its positions: unit, axes, age."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from fgnav.checks import FloatArray
from fgnav.identification.track.integrals import sampled, summed
from fgnav.identification.track.windows import Fitted, Windows, fitted, nearer, windows_of
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
    for (unit, factor), axes in product(UNITS.items(), signed_permutations()):
        here, _ = _aged(fixes, windows, factor * fixes.v_n_mps @ axes.T, steps=0)
        changes = int((np.diag(axes) < 1).sum()) + (factor != 1.0)
        tried.append((float(np.log(here.squares + 1e-12).mean()), changes, here, unit, axes))
    tried.sort(key=lambda one: one[0])
    best, stated = tried[0], next(one for one in tried if one[1] == 0)
    if best[1] and nearer(stated[2], best[2], len(tried)):
        equal = [one for one in tried if not nearer(one[2], best[2], len(tried))]
        _, _, _, unit, axes = min(equal, key=lambda one: (one[1], one[0]))
        return [_columns(unit, axes)], None
    here, old_s = _aged(fixes, windows, fixes.v_n_mps, steps=_STEPS)
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


def _aged(fixes: Fixes, windows: Windows, v_n_mps: FloatArray, steps: int) -> tuple[Fitted, float]:
    """Fit each window's place, and the age of all velocities, s."""
    t_s, row, old_s = fixes.t_s, windows.row, 0.0
    way = summed(t_s, v_n_mps)
    white = np.where(windows.inside[..., None], 1.0 / fixes.position_sigma_m[row], 0.0)
    local = white[..., None] * np.broadcast_to(np.eye(3), (*row.shape, 3, 3))
    spacing_s = float(np.median(np.diff(t_s)))

    def fit_at(old_s: float) -> Fitted:
        at_s = (t_s[row] + old_s).ravel()  # what belongs to t stands at t + age
        place = sampled(t_s, way, at_s).reshape(*row.shape, 3)
        speed = sampled(t_s, v_n_mps, at_s).reshape(*row.shape, 3)
        apart = fixes.p_n_m[row] - fixes.p_n_m[row[:, :1]] - (place - place[:, :1])
        y = (white * apart).reshape(len(row), -1)
        k = y.shape[1]
        common = (white * speed).reshape(len(row), k, 1)
        return fitted(y, local.reshape(len(row), k, 3), common, np.zeros(3))

    here = fit_at(old_s)
    for _ in range(steps):
        old_s += float(np.clip(here.x[0], -spacing_s, spacing_s))
        here = fit_at(old_s)
    return here, old_s
