"""Attitudes of an antenna array, and the photodetector against them."""

import numpy as np
from scipy.spatial.transform import Rotation, RotationSpline

from fgnav.attitude.array import agreeing
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import FloatArray, NoSolutionError
from fgnav.diagnostics.contents import Finding
from fgnav.geometry.interpolation import interpolate
from fgnav.geometry.rotations import log, skew, transpose
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.photodetector import line_of_sight
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Fixes, Flight, Photodetector

_SURE = 0.999  # of right integers; their search needs no shape of the array, which may be wrong
MIN_EPOCHS, _MIN_SIGHTS = 20, 10
_RATE_SPAN_S, _RATE_RATIO = 0.4, 10.0  # of rates; variance of their changes over their noise
_POSITION_M = 1.0  # sigma of a position by code
_CAUSES = {"detector": (0.2, np.radians(1.0)), "landmark": (50.0, 5.0)}  # prior, notable; rad, m
_SQUARES, _SEPARATION = 75.0, 9.0  # five sigma in each unknown; three between two causes


class ArrayAttitudes:
    """Attitudes of the n epochs that have attitude, position and velocity, and their fixes."""

    def __init__(self, flight: Flight, differences: DoubleDifferences, fixes: Fixes) -> None:
        """Solve each epoch on its own.

        Raises
        ------
        NoSolutionError
            If fewer than 20 epochs have attitude, position and velocity.
        """
        integers = Lambda(success_min=_SURE)(differences, flight)
        quadratic = RotationQuadratic.of_double_differences(differences, integers)
        _, attitude, _ = agreeing(quadratic)
        if attitude.unobservable():
            raise NoSolutionError(f"the array leaves {' '.join(attitude.unobservable())} open")
        good = attitude.solved & attitude.consistent() & ~attitude.open_axis_b.any(axis=1)
        rows = np.flatnonzero(good & np.isin(differences.t_s, fixes.t_s))
        if len(rows) < MIN_EPOCHS:
            raise NoSolutionError(f"{len(rows)} epochs have attitude, position and velocity")
        self.t_s, self.R_nb = differences.t_s[rows], attitude.R_nb[rows]
        self.covariance_rad2 = attitude.covariance_rad2[rows]
        self.fixes = fixes[np.isin(fixes.t_s, self.t_s)]
        self._spline = RotationSpline(self.t_s, Rotation.from_matrix(self.R_nb))
        # Rates are means over 0.4 s.
        reach = max(1, round(_RATE_SPAN_S / 2 / float(np.median(np.diff(self.t_s)))))
        total = np.vstack([np.zeros(3), np.cumsum(self.rotations(), axis=0)])
        k, P = np.arange(len(total)), self.covariance_rad2
        first, last = np.maximum(k - reach, 0), np.minimum(k + reach, len(total) - 1)
        span_s = (self.t_s[last] - self.t_s[first])[:, None]
        self._rates = (total[last] - total[first]) / span_s
        self._rate_noise = float(
            (np.einsum("nii->n", P[last] + P[first]) / span_s[:, 0] ** 2).mean()
        )

    def rotations(self) -> FloatArray:
        """Return rotation vectors from epoch to epoch, (n - 1, 3), rad."""
        return log(transpose(self.R_nb[:-1]) @ self.R_nb[1:])

    def interpolated(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return R_nb, (m, 3, 3), and w_b, (m, 3), rad/s, at times within."""
        return self._spline(t_s).as_matrix(), interpolate(t_s, self.t_s, self._rates)

    def rates_exceed_noise(self) -> bool:
        """Return True if changes of body rates within 2 s exceed the noise of their means."""
        reach = int(np.searchsorted(self.t_s, self.t_s[0] + 1.0))
        change = np.diff(self._rates[::reach], n=2, axis=0)
        return bool((change**2).sum(axis=1).mean() > 6 * _RATE_RATIO * self._rate_noise)


def sight_finding(
    flight: Flight, photodetector: Photodetector, array: ArrayAttitudes
) -> Finding | None:
    """Return a displaced landmark or a misaligned detector; None if lines of sight agree.

    Raises
    ------
    NoSolutionError
        If fewer than ten lines of sight have an attitude.
    """
    residual, *derivatives = _sight_equations(flight, photodetector, array)
    square, causes = float(residual @ residual), []
    for (name, (prior, notable)), A in zip(_CAUSES.items(), derivatives, strict=True):
        x = np.linalg.solve(A.T @ A + np.eye(3) * prior**-2, A.T @ residual)
        left = square - float(x @ (A.T @ residual))
        if square - left > _SQUARES and np.linalg.norm(x) > notable:
            causes.append((left, name, x))
    if not causes:
        return None
    (left, name, x), *others = sorted(causes, key=lambda cause: cause[0])
    text = _sight_text(name, x)
    if others and others[0][0] - left < _SEPARATION * max(left / len(residual), 1.0):
        text += f", or as well {_sight_text(*others[0][1:])}"
    text += f": residual squares are {square / max(left, 1.0):.3g} times larger as given"
    return Finding(f"photodetector {name}", text)


def _sight_equations(
    flight: Flight, photodetector: Photodetector, array: ArrayAttitudes
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return whitened residuals, (2 k,), and derivatives, (2 k, 3) each.

    By a rotation of the detector, body axes, rad, and by a shift of the landmark, frame n, m.
    """
    sight, t_s = line_of_sight(photodetector), array.t_s
    after = np.searchsorted(t_s, sight.t_s).clip(1, len(t_s) - 1)
    inside = (sight.t_s >= t_s[0]) & (sight.t_s <= t_s[-1])
    inside &= t_s[after] - t_s[after - 1] < 1.5 * float(np.median(np.diff(t_s)))
    if inside.sum() < _MIN_SIGHTS:
        raise NoSolutionError(f"{inside.sum()} lines of sight have an attitude beside them")
    at_s, e_b, P = sight.t_s[inside], sight.e_b[inside], array.covariance_rad2[after[inside]]
    R_nb, _ = array.interpolated(at_s)
    arm_b_m = photodetector.position_b_m - flight.antennas[0].position_b_m
    to_n_m = photodetector.landmark_n_m - interpolate(at_s, t_s, array.fixes.p_n_m) - R_nb @ arm_b_m
    range_m = np.linalg.norm(to_n_m, axis=1)[:, None, None]
    expected_b = np.einsum("nji,nj->ni", R_nb, to_n_m / range_m[:, 0])
    across = np.linalg.svd(expected_b[:, None, :])[2][:, 1:, :]  # two unit vectors
    by_rotation = -across @ skew(expected_b)
    variance = np.einsum("nij,njk,nik->ni", by_rotation, P, by_rotation)[..., None]
    sigma = np.sqrt(variance + sight.sigma_rad**2 + (_POSITION_M / range_m) ** 2)
    residual = across @ (e_b - expected_b)[:, :, None]
    parts = (residual, by_rotation, across @ R_nb.swapaxes(1, 2) / range_m)
    whitened = [(values / sigma).reshape(-1, values.shape[2]) for values in parts]
    return whitened[0][:, 0], whitened[1], whitened[2]


def _sight_text(name: str, x: FloatArray) -> str:
    x = np.degrees(x) if name == "detector" else x
    shown, size = ", ".join(f"{value:.1f}" for value in x + 0.0), np.linalg.norm(x)
    if name == "detector":
        return f"the detector is misaligned by {size:.1f} deg, about body x, y, z by [{shown}] deg"
    return f"the landmark is {size:.1f} m from its place: north, east, down [{shown}] m"
