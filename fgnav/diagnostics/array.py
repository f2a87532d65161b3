"""Attitudes of an antenna array, and the gyroscope and photodetector against them."""

import numpy as np
from scipy.spatial.transform import Rotation, RotationSpline

from fgnav.attitude.array import agreeing
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import FloatArray, NoSolutionError
from fgnav.diagnostics.axes import named_axes, signed_permutations
from fgnav.diagnostics.contents import Finding
from fgnav.geometry.interpolation import integral, interpolate
from fgnav.geometry.rotations import log, skew, transpose
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.seeker import line_of_sight
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Fixes, Flight, Imu, Seeker

_MIN_EPOCHS, _MIN_SIGHTS = 20, 10
_BETTER = 0.5  # share of the squares that another set-up leaves at most
_RATE_SPAN_S = 0.4
_RATE_RATIO = 10.0  # of the variance of rates over their noise, for a lever arm
_NEAR = 1.5  # epochs: a line of sight further from one has no attitude
_POSITION_M = 1.0  # sigma of a position by code
_SIGHT_PRIORS = {"detector": 0.2, "landmark": 50.0}  # rad, m
_NOTABLE = {"detector": np.radians(1.0), "landmark": 5.0}
_SQUARES, _APART = 75.0, 9.0  # five sigma in each unknown; three between two causes


class ArrayAttitudes:
    """Attitudes of the epochs that have attitude, position and velocity.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
    R_nb : ndarray, shape (n, 3, 3)
    covariance_rad2 : ndarray, shape (n, 3, 3)
    fixes : Fixes
        Of the same epochs, by code and Doppler.
    """

    def __init__(
        self,
        flight: Flight,
        differences: DoubleDifferences,
        fixes: Fixes,
        ranges_m: FloatArray | None = None,
    ) -> None:
        """Solve each epoch on its own, by ranges with fixed integers, (n, b, m), if given.

        Raises
        ------
        NoSolutionError
            If fewer than 20 epochs have attitude, position and velocity.
        """
        if ranges_m is None:
            integers = Constrained()(differences, flight)
            quadratic = RotationQuadratic.of_double_differences(differences, integers)
        else:
            quadratic = RotationQuadratic.of_ranges(differences, ranges_m)
        _, attitude, _ = agreeing(quadratic)
        if attitude.unobservable():
            raise NoSolutionError(f"the array leaves {' '.join(attitude.unobservable())} open")
        solved = attitude.solved & attitude.consistent() & ~attitude.open_axis_b.any(axis=1)
        good = np.flatnonzero(solved)
        rows = good[np.isin(differences.t_s[good], fixes.t_s)]
        if len(rows) < _MIN_EPOCHS:
            raise NoSolutionError(f"{len(rows)} epochs have attitude, position and velocity")
        self.t_s, self.R_nb = differences.t_s[rows], attitude.R_nb[rows]
        self.covariance_rad2 = attitude.covariance_rad2[rows]
        self.fixes = fixes[np.isin(fixes.t_s, self.t_s)]
        self._spline = RotationSpline(self.t_s, Rotation.from_matrix(self.R_nb))
        self._rates_b_radps, self._rate_noise = self._mean_rates()

    def at(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return R_nb, (m, 3, 3), and w_b, (m, 3), rad/s, at times within."""
        rates = interpolate(t_s, self.t_s, self._rates_b_radps)
        return self._spline(t_s).as_matrix(), rates

    def rates_exceed_noise(self) -> bool:
        """Return True if changes of body rates within 2 s exceed the noise of their means."""
        rates, reach = self._rates_b_radps, int(np.searchsorted(self.t_s, self.t_s[0] + 1.0))
        change = rates[2 * reach :] - 2 * rates[reach:-reach] + rates[: -2 * reach]
        return bool((change**2).sum(axis=1).mean() > 6 * _RATE_RATIO * self._rate_noise)

    def _mean_rates(self) -> tuple[FloatArray, float]:
        """Return rates, (n, 3), means over 0.4 s, and the variance of their noise."""
        t_s, P = self.t_s, self.covariance_rad2
        reach = max(1, round(_RATE_SPAN_S / 2 / float(np.median(np.diff(t_s)))))
        between = log(transpose(self.R_nb[:-1]) @ self.R_nb[1:])
        total = np.vstack([np.zeros(3), np.cumsum(between, axis=0)])
        k = np.arange(len(total))
        first, last = np.maximum(k - reach, 0), np.minimum(k + reach, len(total) - 1)
        span_s = (t_s[last] - t_s[first])[:, None]
        noise = np.einsum("nii->n", P[last] + P[first]) / span_s[:, 0] ** 2
        return (total[last] - total[first]) / span_s, float(noise.mean())


def gyroscope_finding(imu: Imu, array: ArrayAttitudes) -> Finding | None:
    """Return unit or axes by which the gyroscope's rotations fit those of the array."""
    t_s = array.t_s
    covered = (t_s[:-1] >= imu.t_s[0]) & (t_s[1:] <= imu.t_s[-1])
    if imu.w_b_radps is None or covered.sum() < _MIN_EPOCHS:
        return None
    angles = interpolate(t_s, imu.t_s, integral(imu.t_s, imu.w_b_radps))
    by_gyro = np.diff(angles, axis=0)[covered]
    by_array = log(transpose(array.R_nb[:-1]) @ array.R_nb[1:])[covered]
    rate_hz = 1.0 / float(np.median(np.diff(imu.t_s)))
    units = {"": 1.0, "in degrees per second": np.pi / 180, "increments": rate_hz}
    left = {
        (unit, k): float(((by_array - factor * by_gyro @ M.T) ** 2).sum())
        for unit, factor in units.items()
        for k, M in enumerate(signed_permutations())
    }
    (unit, k), least = min(left.items(), key=lambda item: item[1])
    if (unit, k) == ("", 0) or least > _BETTER * left["", 0]:
        return None
    names = named_axes(signed_permutations()[k], ("wx", "wy", "wz"))
    what = f"rates are {unit}" if unit else "axes are exchanged or reversed"
    ratio = left["", 0] / max(least, 1e-300)
    return Finding(
        name="gyroscope unit" if unit else "gyroscope axes",
        text=f"{what}: squares beside the array's rotations are {ratio:.3g} times larger",
        mend=f"multiply by {units[unit]:.6g}" if unit else f"wx, wy, wz should read {names}",
        where="[imu] samples, wx_radps, wy_radps, wz_radps",
        certain=True,
    )


def sight_finding(flight: Flight, seeker: Seeker, array: ArrayAttitudes) -> Finding | None:
    """Return a displaced landmark or a misaligned detector; None if lines of sight agree.

    Raises
    ------
    NoSolutionError
        If fewer than ten lines of sight have an attitude.
    """
    residual, by_rotation, by_shift = _sight_equations(flight, seeker, array)
    square = float(residual @ residual)
    causes = []
    for name, A in (("detector", by_rotation), ("landmark", by_shift)):
        information = A.T @ A + np.eye(3) * _SIGHT_PRIORS[name] ** -2
        x = np.linalg.solve(information, A.T @ residual)
        left = square - float(x @ (A.T @ residual))
        if square - left > _SQUARES and np.linalg.norm(x) > _NOTABLE[name]:
            causes.append((left, name, x))
    if not causes:
        return None
    causes.sort(key=lambda cause: cause[0])
    left, name, x = causes[0]
    text = _sight_text(name, x)
    if len(causes) > 1 and causes[1][0] - left < _APART * max(left / len(residual), 1.0):
        text += f", or as well {_sight_text(*causes[1][1:])}"
    text += f": residual squares are {square / max(left, 1.0):.3g} times larger as given"
    return Finding(name=f"seeker {name}", text=text)


def _sight_equations(
    flight: Flight, seeker: Seeker, array: ArrayAttitudes
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return whitened residuals, (2 k,), and derivatives, (2 k, 3) each.

    By a rotation of the detector, body axes, rad, and by a shift of the landmark, frame n, m.
    """
    sight, t_s = line_of_sight(seeker), array.t_s
    after = np.searchsorted(t_s, sight.t_s).clip(1, len(t_s) - 1)
    inside = (sight.t_s >= t_s[0]) & (sight.t_s <= t_s[-1])
    inside &= t_s[after] - t_s[after - 1] < _NEAR * float(np.median(np.diff(t_s)))
    if inside.sum() < _MIN_SIGHTS:
        raise NoSolutionError(f"{inside.sum()} lines of sight have an attitude beside them")
    at_s, e_b, after = sight.t_s[inside], sight.e_b[inside], after[inside]
    R_nb, _ = array.at(at_s)
    arm_b_m = seeker.position_b_m - flight.antennas[0].position_b_m
    to_n_m = seeker.landmark_n_m - interpolate(at_s, t_s, array.fixes.p_n_m) - R_nb @ arm_b_m
    range_m = np.linalg.norm(to_n_m, axis=1)
    expected_b = np.einsum("nji,nj->ni", R_nb, to_n_m / range_m[:, None])
    across = np.linalg.svd(expected_b[:, None, :])[2][:, 1:, :]  # two unit vectors
    by_rotation = -across @ skew(expected_b)
    by_shift = across @ R_nb.swapaxes(1, 2) / range_m[:, None, None]
    P = array.covariance_rad2[after]
    variance = np.einsum("nij,njk,nik->ni", by_rotation, P, by_rotation) + sight.sigma_rad**2
    sigma = np.sqrt(variance + (_POSITION_M / range_m[:, None]) ** 2)[:, :, None]
    residual = np.einsum("nij,nj->ni", across, e_b - expected_b) / sigma[:, :, 0]
    return residual.ravel(), (by_rotation / sigma).reshape(-1, 3), (by_shift / sigma).reshape(-1, 3)


def _sight_text(name: str, x: FloatArray) -> str:
    x = np.degrees(x) if name == "detector" else x
    shown = ", ".join(f"{value:.1f}" for value in x + 0.0)
    size = np.linalg.norm(x)
    if name == "detector":
        return f"the detector is misaligned by {size:.1f} deg, about body x, y, z by [{shown}] deg"
    return f"the landmark is {size:.1f} m from its place: north, east, down [{shown}] m"
