"""Attitude of an antenna array by full-covariance maximum likelihood, with its covariance."""

from dataclasses import dataclass, fields

import numpy as np

from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.attitude.vector_pairs import upright
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.geometry import rotations
from fgnav.types.estimate import open_angle_variance_rad2

_ITERATIONS = 100  # a well-posed epoch needs four; the weakest creep
_RESTARTS = 8  # of 24 starts of a doubtful epoch, the most likely
_STEP_SIGMAS = 1e-4  # a Gauss-Newton step below this share of the standard deviation is the last
_LOUDER, _LOUDEST = 4 / 3, 9.0  # variance factors that are believed, and their inverses
# Degrees of freedom of epochs whose median chi-square tells a third: its standard deviation is
# 1.25 sqrt(2 / freedom) then (normal distribution), a third of that third.
_TELLING = 2 * (1.25 / ((_LOUDER - 1) / 3)) ** 2
_ALONG_AXIS = 1e-3  # rad: an open direction this close to a body axis is that axis


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class AttitudeSolution:
    """Attitudes of epochs, each from that epoch's measurements alone.

    Examples
    --------
    >>> import numpy as np
    >>> from fgnav.attitude import RotationQuadratic, maximum_likelihood
    >>> down = np.array([[0.0, 0.0, 1.0]])
    >>> level = RotationQuadratic.of_vector_pairs(down, down, 1e-4 * np.eye(3)[None])
    >>> solution = maximum_likelihood(level)
    >>> np.abs(solution.open_axis_b[0]).round(6)  # nothing tells the heading
    array([0., 0., 1.])
    >>> np.degrees(np.sqrt(np.diag(solution.covariance_rad2[0]))).round(2)
    array([  0.57,   0.57, 103.92])
    """

    R_nb: FloatArray  # (n, 3, 3); identity where there is no information at all
    # (n, 3, 3); of the body-axes tangent; directions left open have the variance of a uniform angle
    covariance_rad2: FloatArray
    chi_square: FloatArray  # (n,); weighted square sum of the residuals
    degrees_of_freedom: IntArray  # (n,)
    # (n,); whether the search ended at a minimum and at least two angles are determined
    solved: BoolArray
    # (n, 3); unit vector in body axes about which the attitude is open; 0 where all is determined
    open_axis_b: FloatArray

    def consistent(
        self, false_alarm: float = 1e-4, variance_factor: float | FloatArray = 1.0
    ) -> BoolArray:
        """Mask of the epochs that pass the chi-square test of their residuals, (n,).

        With a factor, or one for each epoch, (n,), as if variances were so many times the stated.

        An epoch without redundancy passes: it cannot be tested.
        """
        from scipy.special import chdtri  # noqa: PLC0415  # lazy: half a second

        threshold = chdtri(np.maximum(self.degrees_of_freedom, 1), false_alarm)
        fits = self.chi_square <= variance_factor * threshold
        return np.asarray(fits | (self.degrees_of_freedom < 1))

    def variance_factor(self) -> float:
        """Return the noise's variance over the stated, as the residuals of most epochs say.

        1 where they agree within a third, and never more than three times the standard deviation,
        or less than a third of it: of epochs that fail the chi-square test even then it is not
        noise that is wrong, and they do not count unless all are such. Not below 1 where few
        residuals say so. The median of chi-square over its own median.
        """
        rows, shares = self._shares_of_median()
        factor = _significant_factor(shares)
        return factor if self.degrees_of_freedom[rows].sum() >= _TELLING else max(factor, 1.0)

    def variance_factor_so_far(self) -> FloatArray:
        """Return the variance factor of each epoch by the epochs up to it alone, (n,).

        1 until their residuals have some 250 degrees of freedom together, of which the median knows
        the factor to a ninth; renewed whenever the number of epochs has doubled since.
        """
        rows, shares = self._shares_of_median()
        out = np.ones(len(self.solved))
        telling = np.cumsum(self.degrees_of_freedom[rows]) >= _TELLING
        count = 1 + int(telling.argmax()) if telling.any() else len(rows) + 1
        while count <= len(rows):
            out[rows[count - 1] :] = _significant_factor(shares[:count])
            count *= 2
        return out

    def _shares_of_median(self) -> tuple[IntArray, FloatArray]:
        """Return epochs that noise may explain, (k,), and their chi-square over its median."""
        tested = self.solved & (self.degrees_of_freedom > 0)
        by_noise = tested & self.consistent(variance_factor=_LOUDEST)
        rows = np.flatnonzero(by_noise if by_noise.any() else tested)
        freedom = self.degrees_of_freedom[rows]
        median = freedom * (1 - 2 / (9 * freedom)) ** 3  # Wilson and Hilferty
        return rows, self.chi_square[rows] / median

    def unobservable(self) -> tuple[str, ...]:
        """Return the names of the angles that most solved epochs leave open."""
        axes = self.open_axis_b[self.solved]
        is_open = axes.any(axis=1)
        if not len(axes) or is_open.mean() <= 0.5:
            return ()
        return (axis_name(axes),)


def _significant_factor(shares: FloatArray) -> float:
    """Return the variance factor that shares of the median, (k,), ask for, within bounds."""
    factor = float(np.median(shares)) if len(shares) else 1.0
    believed = float(np.clip(factor, 1 / _LOUDEST, _LOUDEST))
    return 1.0 if 1 / _LOUDER <= factor <= _LOUDER else believed


def axis_name(axes_b: FloatArray) -> str:
    """Return the Euler angle about a body axis, or the axis in words where it is none of them.

    Of several, (k, 3), of either sign, the axis that they have in common. Either direction gives
    the same name: its first component that shows is positive.
    """
    axis_b = np.linalg.eigh(axes_b.T @ axes_b)[1][:, -1]
    across = np.linalg.norm(np.cross(axis_b, np.eye(3)), axis=1)
    if across.min() < _ALONG_AXIS:
        return ("roll", "pitch", "yaw")[int(across.argmin())]
    shown = np.round(axis_b, 3)
    x, y, z = shown * np.sign(shown[shown != 0][0]) + 0.0  # no negative zero
    return f"rotation about the body axis [{x:.3f}, {y:.3f}, {z:.3f}]"


def maximum_likelihood(
    quadratic: RotationQuadratic, R_nb_start: FloatArray | None = None
) -> AttitudeSolution:
    """Return the most likely rotation of each epoch: Gauss-Newton on SO(3), all epochs at once.

    Parameters
    ----------
    quadratic : RotationQuadratic
        What the epochs measured; sums of double differences and vector pairs, any subset.
    R_nb_start : ndarray, shape (n, 3, 3), optional
        Where to start; the rotation nearest to the unconstrained minimum by default.

    Returns
    -------
    AttitudeSolution
        A direction of which the data say less than a uniform prior would is left open, and says
        so; the rotation about it is set by ``vector_pairs.upright``.

    References
    ----------
    The covariance is the inverse Fisher information, which the estimate reaches to first order: the
    Cramer-Rao bound of the model ``paper Eq. 28`` with its full covariance.

    Examples
    --------
    >>> import numpy as np
    >>> from fgnav.attitude import RotationQuadratic, maximum_likelihood
    >>> v_n = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # down and north
    >>> R_nb = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # heading east
    >>> pairs = [
    ...     RotationQuadratic.of_vector_pairs(v[None], (R_nb.T @ v)[None], 1e-4 * np.eye(3)[None])
    ...     for v in v_n
    ... ]
    >>> maximum_likelihood(pairs[0] + pairs[1]).R_nb[0].round(6) + 0.0
    array([[ 0., -1.,  0.],
           [ 1.,  0.,  0.],
           [ 0.,  0.,  1.]])
    """
    if R_nb_start is None:
        R_nb, settled = _descend(quadratic, rotations.nearest(quadratic.unconstrained()))
        R_nb, settled = _restarted(quadratic, R_nb, settled)
    else:
        R_nb, settled = _descend(quadratic, R_nb_start)
    covariance, is_open, axes = _bounded_inverse(
        quadratic.information_at(R_nb), open_variance_rad2=open_angle_variance_rad2()
    )
    open_directions = is_open.sum(axis=1)
    line = open_directions == 1
    R_nb[line] = upright(R_nb[line], axes[line, :, 0])
    return AttitudeSolution(
        R_nb=R_nb,
        covariance_rad2=covariance,
        chi_square=quadratic.chi_square(R_nb),
        degrees_of_freedom=quadratic.count - 3 + open_directions,
        solved=settled & (open_directions <= 1),
        open_axis_b=axes[:, :, 0] * is_open[:, :1],
    )


def searched_again(
    solution: AttitudeSolution,
    quadratic: RotationQuadratic,
    rows: IntArray,
    R_nb_start: FloatArray | None = None,
) -> AttitudeSolution:
    """Return attitudes, those of some epochs, (k,), searched again; others do not move at all.

    From starts, (k, 3, 3), or those of ``maximum_likelihood``.
    """
    if not len(rows):
        return solution
    result = maximum_likelihood(quadratic[rows], R_nb_start)
    parts = {field.name: getattr(solution, field.name).copy() for field in fields(solution)}
    for name, values in parts.items():
        values[rows] = getattr(result, name)
    return AttitudeSolution(**parts)


def agreeing(
    quadratic: RotationQuadratic,
) -> tuple[RotationQuadratic, AttitudeSolution, tuple[str, ...]]:
    """Return the form, its attitudes and a note, the noise changed to what residuals ask for.

    Multipath on a body is often louder than the receiver's data sheet: every epoch would fail the
    chi-square test, and every covariance would be too small. A usual figure in the place of a
    receiver's own may be too large as well.
    """
    solution = maximum_likelihood(quadratic)
    factor = solution.variance_factor()
    if factor == 1.0:
        return quadratic, solution, ()
    scaled = quadratic.with_variance_factor(factor)
    return scaled, maximum_likelihood(scaled, solution.R_nb), noise_notes(factor)


def noise_notes(variance_factor: float) -> tuple[str, ...]:
    """Return a sentence on the noise of phases, where it is not as stated."""
    if variance_factor == 1.0:
        return ()
    times = np.sqrt(variance_factor)
    return (f"Phase noise is taken as {times:.2g} times the stated: its residuals say so.",)


def _descend(quadratic: RotationQuadratic, start: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Gauss-Newton with step control; return where it ended and whether that is a minimum."""
    R_nb, settled = start.copy(), np.zeros(len(start), dtype=bool)
    share = np.ones(len(start))  # of the full step: a weak epoch may overshoot
    for _ in range(_ITERATIONS):
        active = np.flatnonzero(~settled)
        if not len(active):
            break
        form, here = quadratic[active], R_nb[active]
        # A flat direction is not searched: its inverse is set to zero.
        inverse, _, _ = _bounded_inverse(form.information_at(here), open_variance_rad2=0.0)
        gradient = form.gradient_at(here)
        step = -np.einsum("nij,nj->ni", inverse, gradient)
        settled[active] = -np.einsum("ni,ni->n", step, gradient) < _STEP_SIGMAS**2
        trial_R_nb = here @ rotations.exp(share[active, None] * step)
        better = form.chi_square(trial_R_nb) <= form.chi_square(here) + _STEP_SIGMAS**2
        R_nb[active] = np.where(better[:, None, None], trial_R_nb, here)
        share[active] = np.where(better, np.minimum(2 * share[active], 1), share[active] / 4)
    return R_nb, settled


def _bounded_inverse(
    information: FloatArray, *, open_variance_rad2: float
) -> tuple[FloatArray, BoolArray, FloatArray]:
    """Invert information matrices; directions worse than a uniform angle get the variance given.

    Returns the inverses (n, 3, 3), which directions are open (n, 3), and the directions as columns
    (n, 3, 3).
    """
    values, vectors = np.linalg.eigh(information)
    is_open = values < 1.0 / open_angle_variance_rad2()
    variance = np.where(is_open, open_variance_rad2, 1.0 / np.where(is_open, 1.0, values))
    inverse = (vectors * variance[:, None]) @ vectors.swapaxes(1, 2)
    return inverse, is_open, vectors


def _restarted(
    quadratic: RotationQuadratic, R_nb: FloatArray, settled: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Search again from a quarter-turn grid where the residuals say that a minimum is a local one.

    Without it 0.3 % of weak planar epochs (three antennas, six satellites) end in a wrong one.
    """
    freedom = np.maximum(quadratic.count - 3, 1)
    doubtful = np.flatnonzero(quadratic.chi_square(R_nb) > freedom + 4 * np.sqrt(2 * freedom))
    if not len(doubtful):
        return R_nb, settled
    form, lowest = quadratic[doubtful], quadratic.chi_square(R_nb)[doubtful]
    grid = np.array(
        [form.chi_square(np.tile(quarter, (len(doubtful), 1, 1))) for quarter in _quarters()]
    )
    for start in np.argsort(grid, axis=0)[:_RESTARTS]:
        trial, ended = _descend(form, _quarters()[start])
        chi_square = form.chi_square(trial)
        better = chi_square < lowest - _STEP_SIGMAS
        lowest = np.where(better, chi_square, lowest)
        R_nb[doubtful[better]], settled[doubtful[better]] = trial[better], ended[better]
    return R_nb, settled


def _quarters() -> FloatArray:
    """Return the 24 rotations of a cube, (24, 3, 3)."""
    turns = np.array(np.meshgrid(*[np.arange(4) * np.pi / 2] * 3)).reshape(3, -1)
    return np.unique(np.rint(rotations.from_euler(*turns)), axis=0)
