"""Whether beacon and detector are as the flight says: lines of sight against the array."""

import numpy as np
from scipy.spatial.transform import Rotation, RotationSpline

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.geometry.interpolation import interpolate
from fgnav.geometry.rotations import skew
from fgnav.seeker import line_of_sight
from fgnav.set_up.array.quick import Quick
from fgnav.set_up.array.regression import Regression
from fgnav.set_up.findings import Finding
from fgnav.types.flight import Flight, Seeker

_FEWEST = 10
_NEAR = 1.5  # epochs: a sight further from one has no attitude
_POSITION_M = 1.0  # what code leaves in a position
# Neither is expected to be further off: it keeps what the geometry cannot tell small.
_FAR_M, _TURNED_RAD = 50.0, 0.2
_NOTABLE_M, _NOTABLE_RAD = 5.0, np.radians(1.0)
_SQUARES = 75.0  # the sum of squares that a cause must take off: five sigma in each unknown
_APART = 9.0  # between the squares that two causes leave: the data tell them apart


def sight_findings(flight: Flight, seeker: Seeker, quick: Quick) -> list[Finding]:
    """Return a displaced landmark or a turned detector, empty if the sights agree.

    Raises
    ------
    NoSolutionError
        If fewer than 10 sights have an attitude.
    """
    residual, turn, shift = _equations(flight, seeker, quick)
    causes = {
        "detector": (turn, _TURNED_RAD, _NOTABLE_RAD),
        "landmark": (shift, _FAR_M, _NOTABLE_M),
    }
    square = float(residual @ residual)
    judged: list[tuple[float, str, FloatArray]] = []
    for name, (A, widest, notable) in causes.items():
        unknown, left = Regression.of(A, residual, widest**-2).fit({})
        if square - left > _SQUARES and np.linalg.norm(unknown) > notable:
            judged.append((left, name, unknown))
    if not judged:
        return []
    judged.sort(key=lambda cause: cause[0])
    left, name, unknown = judged[0]
    noise = max(left / len(residual), 1.0)
    evidence = (
        f"the sights then fit {np.sqrt(square / max(left, 1.0)):.1f} times as well over "
        f"{len(residual) // 2} samples"
    )
    text = _turned(unknown) if name == "detector" else _displaced(unknown)
    if len(judged) > 1 and (judged[1][0] - left) / noise < _APART:
        text += ", or as well " + (
            _turned(judged[1][2]) if judged[1][1] == "detector" else _displaced(judged[1][2])
        )
    return [Finding(name=f"seeker {name}", text=f"{text}: {evidence}")]


def _equations(
    flight: Flight, seeker: Seeker, quick: Quick
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return residuals over their sigmas, (2 k,), by the detector's turn and the landmark's shift.

    The turn is in body axes, rad; the shift north, east, down, m: (2 k, 3) each.
    """
    sight = line_of_sight(seeker)
    spacing_s = float(np.median(np.diff(quick.t_s)))
    after = np.searchsorted(quick.t_s, sight.t_s).clip(1, len(quick.t_s) - 1)
    inside = (sight.t_s >= quick.t_s[0]) & (sight.t_s <= quick.t_s[-1])
    inside &= quick.t_s[after] - quick.t_s[after - 1] < _NEAR * spacing_s
    t_s, e_b, after = sight.t_s[inside], sight.e_b[inside], after[inside]
    if len(t_s) < _FEWEST:
        raise NoSolutionError(f"{len(t_s)} sights of the landmark have an attitude beside them")
    R_nb = RotationSpline(quick.t_s, Rotation.from_matrix(quick.R_nb))(t_s).as_matrix()
    p_n_m = interpolate(t_s, quick.t_s, quick.p_n_m)
    arm_b_m = seeker.position_b_m - flight.antennas[0].position_b_m
    to_n_m = seeker.landmark_n_m - p_n_m - R_nb @ arm_b_m
    range_m = np.linalg.norm(to_n_m, axis=1)
    expected_b = np.einsum("nji,nj->ni", R_nb, to_n_m / range_m[:, None])
    across = np.linalg.svd(expected_b[:, None, :])[2][:, 1:, :]  # two unit vectors across the sight
    turn = -across @ skew(expected_b)
    shift = across @ R_nb.swapaxes(1, 2) / range_m[:, None, None]
    attitude_rad2 = np.einsum("nij,njk,nik->ni", turn, quick.covariance_rad2[after], turn)
    variance = attitude_rad2 + sight.sigma_rad**2 + (_POSITION_M / range_m[:, None]) ** 2
    sigma = np.sqrt(variance)[:, :, None]
    residual = np.einsum("nij,nj->ni", across, e_b - expected_b) / sigma[:, :, 0]
    return residual.ravel(), (turn / sigma).reshape(-1, 3), (shift / sigma).reshape(-1, 3)


def _turned(turn_b_rad: FloatArray) -> str:
    shown = ", ".join(f"{x:.1f}" for x in np.degrees(turn_b_rad) + 0.0)
    return (
        f"the detector is turned by {np.degrees(np.linalg.norm(turn_b_rad)):.1f} deg, about body "
        f"x, y, z by [{shown}] deg"
    )


def _displaced(shift_n_m: FloatArray) -> str:
    shown = ", ".join(f"{x:.1f}" for x in shift_n_m + 0.0)
    return (
        f"the landmark is {np.linalg.norm(shift_n_m):.1f} m from where it is said to be: north, "
        f"east, down [{shown}] m"
    )
