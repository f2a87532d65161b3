"""From the four currents of a quadrant detector to the line of sight in body axes."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray, Unused, freeze, positive
from fgnav.types.flight import Photodetector

_REPEATED = 3  # samples with the very same largest current: no noise does that


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class LineOfSight:
    """Directions from the detector to the landmark, where it was seen.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
    e_b : ndarray, shape (k, 3)
        Unit vectors in body axes.
    sigma_rad : float
        Standard deviation of the direction about each of the two axes across it.
    unused : tuple of Unused
        Samples that show no landmark.
    """

    t_s: FloatArray
    e_b: FloatArray
    sigma_rad: float
    unused: tuple[Unused, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        positive("line of sight sigma_rad", self.sigma_rad)
        freeze("line of sight", self, {"t_s": (None,)})
        freeze("line of sight", self, {"e_b": (len(self.t_s), 3)})

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the unit vectors, (k, 3, 3), of rank two."""
        across = np.eye(3) - self.e_b[:, :, None] * self.e_b[:, None, :]
        return np.asarray(self.sigma_rad**2 * across)


def line_of_sight(
    photodetector: Photodetector, sigma_rad: float | None = None, *, causal: bool = False
) -> LineOfSight:
    """Reconstruct the line of sight from photocurrents (Eqs. 34-36) [1]_.

    The spot sits at ``R_det f(r_quad) l / r_quad`` with ``l = (ln I4/I2, ln I1/I3)``, and the
    direction is (focal length, x_c, y_c) in body axes. A current at or below zero or cut at the
    electronics' limit, or a spot off the detector or beyond its calibration, is a gap.

    Parameters
    ----------
    sigma_rad : float or None
        Standard deviation of the direction; None: the detector's own.
    causal : bool
        Each sample by samples up to it alone: the electronics' limit shows when the largest current
        so far comes for the third time, and the first two times are not recognised.

    References
    ----------
    .. [1] Neural Networks for Estimating Attitude, Line of Sight, and GNSS Ambiguity Through
       Onboard Sensor Fusion, Sensors, 2025, Eqs. 34-36 and Table 3.
    """
    lit, cut = photodetector.currents.min(axis=1) > 0, _cut(photodetector.currents, causal=causal)
    logarithm = np.log(np.where(lit[:, None], photodetector.currents, 1.0))
    quadrants = np.stack(
        [logarithm[:, 3] - logarithm[:, 1], logarithm[:, 0] - logarithm[:, 2]], axis=1
    )
    r_quad = np.hypot(quadrants[:, 0], quadrants[:, 1])
    calibrated = r_quad <= photodetector.calibration[-1, 0]
    r_c = spot_fraction(photodetector.calibration, np.where(calibrated, r_quad, 0.0))
    on_detector = calibrated & (r_c <= 1.0)
    scale = photodetector.detector_radius_m * r_c / np.where(r_quad > 0, r_quad, 1.0)
    boresight = np.full(len(r_quad), photodetector.focal_length_m)
    ray_b = np.column_stack([boresight, scale[:, None] * quadrants])
    is_measured = lit & ~cut & on_detector
    e_b = ray_b[is_measured] / np.linalg.norm(ray_b[is_measured], axis=1, keepdims=True)
    reasons = {
        "a current is zero or below": ~lit,
        "a current stands at its limit": lit & cut,
        "spot off the detector or beyond its calibration": lit & ~cut & ~on_detector,
    }
    unused = tuple(
        Unused(what="photodetector sample", reason=reason, count=int(lost.sum()))
        for reason, lost in reasons.items()
        if lost.any()
    )
    sigma_rad = photodetector.line_of_sight_sigma_rad if sigma_rad is None else sigma_rad
    return LineOfSight(
        t_s=photodetector.t_s[is_measured], e_b=e_b, sigma_rad=sigma_rad, unused=unused
    )


def _cut(currents: FloatArray, *, causal: bool = False) -> BoolArray:
    """Return the mask of samples with a current that was cut at a limit nobody states, (k,).

    Where the largest of all currents comes time and again while others change, it is the limit.
    """
    if causal:
        return _cut_so_far(currents)
    cut: BoolArray = (currents == currents.max(initial=0.0)).any(axis=1)
    stands = cut.sum() >= _REPEATED and np.ptp(currents[cut], axis=0).any()
    return np.asarray(cut & stands)


def _cut_so_far(currents: FloatArray) -> BoolArray:
    """Return the mask of cut samples, (k,), by the largest of the currents up to each sample."""
    largest = currents.max(axis=1, initial=0.0)
    limit = np.maximum.accumulate(largest)
    out = np.zeros(len(currents), dtype=np.bool_)
    values, counts = np.unique(limit[largest == limit], return_counts=True)
    for value in values[counts >= _REPEATED]:
        rows = np.flatnonzero((limit == value) & (largest == value))
        changed = np.cumsum((currents[rows] != currents[rows[0]]).any(axis=1)) > 0
        out[rows] = changed & (np.arange(1, len(rows) + 1) >= _REPEATED)
    return out


def spot_fraction(calibration: FloatArray, r_quad: FloatArray) -> FloatArray:
    """Return the spot's distance from the centre, as a fraction of the detector's radius, (k,).

    The cubic spline through the calibration, (c, 2) rows of r_quad and r_c. A calibration that
    starts off the centre is led to it: equal currents mean a centred spot.
    """
    from fgnav.geometry.cubic_spline import cubic_spline  # noqa: PLC0415  # lazy: scipy

    if calibration[0, 0] > 0:
        calibration = np.vstack([np.zeros(2), calibration])
    return cubic_spline(calibration[:, 0], calibration[:, 1], r_quad)


def to_landmark_b_m(
    photodetector: Photodetector, e_b: FloatArray, from_b_m: FloatArray, distance_m: FloatArray
) -> FloatArray:
    """Return the vector from a body point to the landmark, (n, 3), given how far it is from there.

    The detector sees the landmark along ``e_b`` from where it sits; the known distance, (n,), from
    the body point ``from_b_m``, (3,), says how far along. So the lever arm between the two needs no
    attitude. NaN where the distance is shorter than the lever arm allows.
    """
    arm_b_m = photodetector.position_b_m - from_b_m
    along = e_b @ arm_b_m
    square = along**2 + distance_m**2 - arm_b_m @ arm_b_m
    range_m = np.sqrt(np.where(square >= 0, square, np.nan)) - along
    return np.asarray(arm_b_m + range_m[:, None] * e_b)
