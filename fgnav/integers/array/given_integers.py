"""The likelihood of noise where integers are given: no search, every epoch in closed form.

With its integers an epoch knows its attitude to milliradians, whatever the noise, and the residuals
around that attitude are linear in what is left of it. Double differences and their covariance are
those of single links whose satellites and receivers have unknown clocks; eliminating these instead
leaves a matrix per epoch of the size of the antennas.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.integers.ils.array_model import spans
from fgnav.types.differences import DoubleDifferences

# Of the information on turns: two lines of position that touch leave one turn open to first order.
_TANGENT = 1e-12


@dataclass(frozen=True, eq=False, slots=True)
class _Group:
    """Links of a group of signals, a antennas and c channels, with the clocks of satellites out."""

    channels: BoolArray  # (m,)
    used: BoolArray  # (n, c)
    spare: IntArray  # (n, c); links beyond the one that each satellite's clock takes
    absent: BoolArray  # (n, a - 1); receivers without a link
    of_receivers: FloatArray  # (n, c, a - 1, a - 1): by a weight of 1
    values: FloatArray  # (2, n, a - 1, c, 4): code, phase; derivative by three turns, and residual
    squares: FloatArray  # (2, n, c, 4, 4)


@dataclass(frozen=True, eq=False, slots=True)
class GivenIntegers:
    """Epochs with given integers, as linear functions of three turns about the axes of ``n``."""

    groups: Sequence[_Group]
    # Information added to the turn about the only direction of an array in a line.
    open_axis: FloatArray  # (n, 3, 3)

    def log_likelihoods(
        self, code_variance_m2: FloatArray, phase_variance_m2: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return each epoch's cost, and its log likelihood but for ``-cost / 2``, (n,) each.

        Parameters
        ----------
        code_variance_m2, phase_variance_m2 : ndarray, shape (n, m)
        """
        N, log_factor = np.zeros((len(self.open_axis), 4, 4)), np.zeros(len(self.open_axis))
        for group in self.groups:
            for kind, variance in enumerate((code_variance_m2, phase_variance_m2)):
                normal, log_determinant = _normal(group, kind, variance[:, group.channels])
                N += normal
                log_factor -= 0.5 * log_determinant
        H = N[:, :3, :3] + self.open_axis
        size = np.trace(H, axis1=1, axis2=2)[:, None, None]
        H += _TANGENT * size * np.eye(3)
        turn_rad = np.linalg.solve(H, N[:, :3, 3:])[..., 0]
        log_factor -= 0.5 * np.linalg.slogdet(H)[1]
        return N[:, 3, 3] - np.sum(N[:, :3, 3] * turn_rad, axis=1), log_factor


def given_integers(
    differences: DoubleDifferences, cycles: IntArray, columns: FloatArray
) -> GivenIntegers:
    """Return epochs with the integers that a search found.

    Parameters
    ----------
    cycles : ndarray of int64, shape (n, b, m)
    columns : ndarray, shape (n, 9)
        Of the attitudes that these lead to, as in ``ConstrainedSearch``.
    """
    arrays = spans(differences.baselines_b_m, np.any(differences.resolvable, axis=2))
    M = columns.reshape(-1, 3, 3)  # a column in each row
    baselines_n_m = arrays.coordinates_m[arrays.pattern] @ M
    cycles_m = differences.wavelength_m * cycles
    range_m = differences.ranges_m(baselines_n_m)
    by_rotation_m = -np.cross(baselines_n_m[:, :, None], differences.e_n[:, None])  # by turns
    parts = []
    for measured in (differences.code_m, differences.phase_m - cycles_m):
        residual_m = np.where(differences.resolvable, measured - range_m, 0.0)
        parts.append(np.concatenate([by_rotation_m, residual_m[..., None]], axis=3))
    values = np.stack(parts)
    groups = [_group(differences, values, g) for g in range(differences.reference.shape[1])]
    line = (arrays.rank[arrays.pattern] == 1)[:, None, None]
    return GivenIntegers(
        groups=groups,
        open_axis=np.where(line, M[:, 0, :, None] * M[:, 0, None, :], 0.0),
    )


def _group(differences: DoubleDifferences, values: FloatArray, g: int) -> _Group:
    """Take the means over antennas off the links of a group."""
    channels = differences.group == g
    resolvable = differences.resolvable[:, :, channels]
    reference = np.flatnonzero(channels) == differences.reference[:, g, None]
    tracked = resolvable | (reference[:, None] & resolvable.any(axis=2, keepdims=True))
    tracked = np.concatenate([tracked.any(axis=1, keepdims=True), tracked], axis=1)
    on = tracked[:, :, :, None].astype(np.float64)
    of_reference_antenna = np.zeros_like(values[:, :, :1, channels])
    values = np.concatenate([of_reference_antenna, values[:, :, :, channels]], axis=2) * on
    many = np.maximum(tracked.sum(axis=1), 1)
    values = (values - values.sum(axis=2, keepdims=True) / many[:, None, :, None]) * on
    rows = on[:, 1:, :, 0].swapaxes(1, 2)  # (n, c, a - 1)
    of_receivers = np.eye(rows.shape[2]) * rows[..., None]
    of_receivers -= rows[..., :, None] * rows[..., None, :] / many[:, :, None, None]
    squares = np.einsum("knajp,knajq->knjpq", values, values)
    return _Group(
        channels=channels,
        used=np.asarray(tracked.any(axis=1)),
        spare=np.maximum(tracked.sum(axis=1) - 1, 0),
        absent=np.asarray(~tracked[:, 1:].any(axis=2)),
        of_receivers=of_receivers,
        values=values[:, :, 1:],
        squares=squares,
    )


def _normal(group: _Group, kind: int, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return normal equations, (n, 4, 4), and the log determinant of links, (n,), of one kind."""
    weight = np.where(group.used, 1.0 / variance, 0.0)
    n, c, a, _ = group.of_receivers.shape
    K = (weight[:, None] @ group.of_receivers.reshape(n, c, a * a)).reshape(n, a, a)
    K[:, np.arange(a), np.arange(a)] += group.absent
    of_receivers = np.einsum("nj,najp->nap", weight, group.values[kind])
    squares = (weight[:, None] @ group.squares[kind].reshape(n, c, 16)).reshape(n, 4, 4)
    squares -= of_receivers.swapaxes(1, 2) @ np.linalg.solve(K, of_receivers)
    log_determinant = np.sum(group.spare * np.log(variance), axis=1, where=group.used)
    return squares, log_determinant + np.linalg.slogdet(K)[1]
