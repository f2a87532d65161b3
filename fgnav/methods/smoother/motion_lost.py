"""How much of a flight's motion a smoother lost, told by how its answer follows the intensity.

Linear smoothers ``x(S)`` of intensity S have the covariance ``P(S)``. With ``P' = dP/dlnS`` the
noise in x(S) has the covariance ``P - P'``, and the motion lost ``P'`` if the rate is a random walk
of intensity S. Noise in ``x(S)`` and ``x(cS)`` has the common covariance
``(c P(S) - P(cS)) / (c - 1)``, since the two informations differ by a multiple of one matrix. So
the mean square of ``x(cS) - x(S)`` has a known part of noise, and a part of the motion: of a random
walk of intensity S ``P(cS) - (1 - 1/c) P'(cS) - P(S)`` less that of noise. Of a swing or a steady
turn what is lost falls as 1/S, and much less is lost than a random walk would lose that moves x as
far. How the mean squares fall as S rises tells the one from the other [1]_.

References
----------
.. [1] Bias and variance of a linear smoother whose motion is not the model's: Wahba, Bayesian
   "confidence intervals" for the cross-validated smoothing spline, JRSS B 45, 1983.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray

RATIO = np.sqrt(3.0)  # of one intensity to the next
PLACES = np.arange(-2, 3)  # of intensities that are compared: powers of that
HERE = 2  # which of them is the flight's
USUAL = 4.0  # times the median variance: beyond, a keyframe is in a gap
_TOLD_BY = range(1, 4)  # steps to the next intensity; far below, a swing is lost for good
_PARTS = 8  # of the keyframes, for how well their mean is known
_DOUBT = 0.5  # 1-sigma of the walk's share before the flight says anything, about 1
_LARGEST = 4.0  # times as much as the model says
_NOTHING = 1e-3  # of the variance: no more follows the intensity
_CLEARLY = 0.25  # of the noise that a lower intensity saves: less is lost by it


def _slopes() -> FloatArray:
    """Return what makes slopes by ln S of values at all places: those of a quartic, (5, 5)."""
    x, power = PLACES * np.log(RATIO), np.arange(len(PLACES))
    by_power = np.where(power > 0, power * x[:, None] ** (power - 1).clip(0), 0.0)
    return np.asarray(by_power @ np.linalg.inv(x[:, None] ** power))


_SLOPES = _slopes()


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Levels:
    """Linear smoothers of five intensities, of k keyframes; velocities in body axes.

    Attributes
    ----------
    step : ndarray, shape (5, k, 15)
        Where they go from one point of linearisation.
    covariance : ndarray, shape (5, k, 15, 15)
    """

    step: FloatArray
    covariance: FloatArray

    @property
    def usual(self) -> BoolArray:
        """Return which keyframes, (k,), are in no gap."""
        variance = np.einsum("kii->ki", self.covariance[HERE])[:, :3]
        return np.asarray((variance < USUAL * np.median(variance, axis=0)).all(axis=1))

    @property
    def too_loose(self) -> bool:
        """Whether a third of the intensity would clearly lose less than the noise it saves."""
        P, slope = self._rotation()
        noise = P - slope
        moved = self._moved(0, HERE) - _noise_apart(P, slope, 0, HERE)
        saved = (noise[HERE] - noise[0]) / P[HERE]
        # A smooth motion loses by the square of one over the intensity: that at a third, less that
        # here, is twice the square of the difference.
        return bool(2 * (moved / P[HERE]).mean() < _CLEARLY * saved.mean())

    def share(self) -> tuple[float, float]:
        """Return how much of what a random walk would lose was lost, and how well it is told.

        The first is near 1 if unsure. The second is the variance of the share that the flight tells
        about one axis: the logarithm of an intensity is told no better.
        """
        (P, slope), usual = self._rotation(), self.usual
        lost = (slope / P)[HERE, usual]
        if not lost.mean() > _NOTHING:
            return 1.0, 0.0
        noise, walk, moved = (np.empty((len(_TOLD_BY), *P.shape[1:])) for _ in range(3))
        for row, j in enumerate(_TOLD_BY):
            noise[row] = _noise_apart(P, slope, j, j + 1)
            of_level = P[j + 1] - (1 - 1 / RATIO) * slope[j + 1] - P[j] - noise[row]
            walk[row] = of_level / RATIO ** PLACES[j]  # of one that is as it is here
            moved[row] = self._moved(j, j + 1) - noise[row]
        noise, walk, moved = ((part / P[HERE])[:, usual] for part in (noise, walk, moved))
        return _fitted(moved, walk, 1 / (noise + walk), lost)

    def slope(self) -> FloatArray:
        """Return ``P'`` of the flight's intensity, (k, 15, 15)."""
        return np.asarray(np.tensordot(_SLOPES[HERE], self.covariance, axes=1))

    def step_slope(self) -> FloatArray:
        """Return ``dx/dlnS`` at the flight's intensity, (k, 15)."""
        return np.asarray(np.tensordot(_SLOPES[HERE], self.step, axes=1))

    def _rotation(self) -> tuple[FloatArray, FloatArray]:
        """Return variances of rotation and their slopes, (5, k, 3)."""
        P = np.einsum("jkii->jki", self.covariance)[:, :, :3]
        return P, np.tensordot(_SLOPES, P, axes=1)

    def _moved(self, i: int, j: int) -> FloatArray:
        return np.asarray((self.step[j] - self.step[i])[:, :3] ** 2)


def _noise_apart(P: FloatArray, slope: FloatArray, i: int, j: int) -> FloatArray:
    """Return the variance of noise in the difference of two smoothers, (k, 3)."""
    c = RATIO ** (PLACES[j] - PLACES[i])
    common = (c * P[i] - P[j]) / (c - 1)
    return np.asarray((P[i] - slope[i]) + (P[j] - slope[j]) - 2 * common)


def _fitted(
    moved: FloatArray, walk: FloatArray, weight: FloatArray, lost: FloatArray
) -> tuple[float, float]:
    """Return the share lost and the variance of the log intensity, from parts of the variance here.

    Parameters
    ----------
    moved, walk, weight : ndarray, shape (3, k, 3)
        By step of intensity, keyframe, axis: mean squares without noise, what a random walk makes
        of them, and how surely they are told.
    lost : ndarray, shape (k, 3)
        By a random walk.
    """
    start = RATIO ** -PLACES[list(_TOLD_BY)]
    swing = (start - start / RATIO) ** 2  # of motion that loses as much as the variance here
    design = np.stack([walk.mean(axis=(1, 2)), swing], axis=1)
    tells = _tells(design, moved.mean(axis=(1, 2)), weight.mean(axis=(1, 2)), lost.mean())
    share = float(np.clip(tells @ moved.mean(axis=(1, 2)), 0.0, _LARGEST))
    parts = [tells @ part.mean(axis=1) for part in np.array_split(moved, _PARTS, axis=1)]
    of_axes = float((np.var(parts, axis=0, ddof=1) / _PARTS).mean())
    trust = _DOUBT**2 / (_DOUBT**2 + of_axes / moved.shape[2])
    return 1 + trust * (share - 1), of_axes


def _tells(design: FloatArray, moved: FloatArray, weight: FloatArray, lost: float) -> FloatArray:
    """Return what makes the share lost of mean squares, (3,): a fit that has nothing negative.

    Of a random walk and a swing, else of the one of them that fits better.
    """
    whole = np.array([1.0, 1 / lost])  # the share that each brings
    best, least = np.zeros(len(moved)), np.inf
    for kinds in ([0, 1], [0], [1]):
        fit = np.linalg.pinv(design[:, kinds] * weight[:, None]) * weight
        found = fit @ moved
        left = (((design[:, kinds] @ found.clip(0) - moved) * weight) ** 2).sum()
        if left < least and (len(kinds) == 1 or (found >= 0).all()):
            best, least = whole[kinds] @ fit, left
    return np.asarray(best)
