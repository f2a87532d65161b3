"""What is known of the attitude before an epoch's integers are: the prediction of a smoother.

A rotation vector of stated covariance moves the columns of ``M = R_nb V`` within a tangent space.
The prior's cost is quadratic in M: there it has the stated covariance, across it, where no small
turn leads, the variance of the least known axis. To second order in the angle that is the Gaussian;
being quadratic in M it enters the relaxation as a measurement would, and the search stays exact.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray, frozen
from fgnav.integers.array.relaxation import Spans

_ORTHOGONAL = 1e-6  # attitudes with rounding of seven digits pass
_NO_DIRECTION = 1e-12  # of the largest variance: what turning about the array's own line leaves


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class AttitudePrior:
    """Attitudes known beforehand, one per epoch of the double differences they belong to.

    It must not come from the same phases: what an epoch says must count once.

    Attributes
    ----------
    R_nb : ndarray, shape (n, 3, 3)
        NaN where nothing is known of an epoch.
    attitude_covariance_rad2 : ndarray, shape (n, 3, 3)
        Of the body-axes tangent ``R_true = R_nb @ Exp(delta)``. Beyond some 40 degrees of an axis
        the prior says less than it could; a half turn about it is then not excluded.
    """

    R_nb: FloatArray
    attitude_covariance_rad2: FloatArray

    def __post_init__(self) -> None:
        """Check and freeze both fields."""
        R_nb = frozen("attitude prior R_nb", self.R_nb, (None, 3, 3), gaps=True)
        covariance = frozen(
            "attitude prior attitude_covariance_rad2",
            self.attitude_covariance_rad2,
            R_nb.shape,
            gaps=True,
        )
        known = np.isfinite(R_nb).all(axis=(1, 2))
        R, P = R_nb[known], covariance[known]
        skew = np.abs(R @ R.swapaxes(1, 2) - np.eye(3)).max(initial=0.0)
        if skew > _ORTHOGONAL or (np.linalg.det(R) < 0).any():
            raise BadInputError("attitude prior R_nb: must be rotations, or NaN where unknown")
        if not np.isfinite(P).all() or not (np.linalg.eigvalsh(P) > 0).all():
            raise BadInputError(
                "attitude prior attitude_covariance_rad2: must be positive definite where R_nb is"
            )
        object.__setattr__(self, "R_nb", R_nb)
        object.__setattr__(self, "attitude_covariance_rad2", covariance)

    def at(self, epochs: IntArray) -> "AttitudePrior":
        """Return some of the epochs."""
        return AttitudePrior(
            R_nb=self.R_nb[epochs],
            attitude_covariance_rad2=self.attitude_covariance_rad2[epochs],
        )


class PriorColumns(NamedTuple):
    """The prior as a measurement of the columns of M; no rows where there is none at all."""

    columns: FloatArray  # (n, 9): the first 3 r count
    information: FloatArray  # (n, 9, 9)


def prior_columns(prior: AttitudePrior | None, arrays: Spans) -> PriorColumns:
    """Return what a prior says of the columns that the antennas of each epoch span.

    Parameters
    ----------
    prior : AttitudePrior or None
    arrays : Spans

    Raises
    ------
    BadInputError
        If the prior has not as many epochs.
    """
    n = len(arrays.pattern)
    if prior is None:
        return PriorColumns(np.zeros((0, 9)), np.zeros((0, 9, 9)))
    if len(prior.R_nb) != n:
        raise BadInputError(f"attitude prior: has {len(prior.R_nb)} epochs, the differences {n}")
    known = np.isfinite(prior.R_nb).all(axis=(1, 2))
    columns, information = np.zeros((n, 9)), np.zeros((n, 9, 9))
    for p, r in enumerate(arrays.rank):
        at = np.flatnonzero(known & (arrays.pattern == p))
        V = arrays.basis_b[p][:, :r]
        M = prior.R_nb[at] @ V
        # R Exp(delta) v = R v - R [v]x delta
        cross = np.cross(np.eye(3)[None], V.T[:, None]).swapaxes(1, 2)  # (r, 3, 3): [v]x
        J = -np.einsum("kij,rjl->kril", prior.R_nb[at], cross).reshape(len(at), 3 * r, 3)
        of_columns = J @ prior.attitude_covariance_rad2[at] @ J.swapaxes(1, 2)
        columns[at, : 3 * r] = M.swapaxes(1, 2).reshape(len(at), 3 * r)
        information[at, : 3 * r, : 3 * r] = _information(of_columns)
    return PriorColumns(columns, information)


def _information(covariance: FloatArray) -> FloatArray:
    """Return the inverse, with the largest variance in directions that have none."""
    variance, axes = np.linalg.eigh(covariance)
    largest = variance.max(axis=1, keepdims=True, initial=0.0)
    weight = 1.0 / np.where(variance > _NO_DIRECTION * largest, variance, largest)
    return np.asarray((axes * weight[:, None, :]) @ axes.swapaxes(1, 2))
