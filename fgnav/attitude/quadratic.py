"""Everything linear in the rotation matrix, as one quadratic form per epoch.

Double differences and vector pairs are linear in the nine elements x of R_nb (row by row), so all
that an epoch says of the attitude is a quadratic form in x, whatever the number of antennas,
satellites, groups, weights and gaps. It is loss-free: maximum likelihood, the Cramer-Rao bound and
the smoother's factor all start from it. With equal antennas and no gaps it falls apart into three
vector measurements; with gaps it does not, which is why the nine-by-nine form is kept.
"""

from dataclasses import dataclass, field

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.gnss.clock_free import range_information
from fgnav.types.differences import DoubleDifferences
from fgnav.types.integers import Integers, fixed_ranges_m

_NOTHING = 1e-10  # relative eigenvalue: rounding of an array that does not span space


@dataclass(frozen=True, eq=False, slots=True)
class RotationQuadratic:
    """``-log p = (x' information x - 2 vector' x + constant) / 2``, x = R_nb.ravel(), per epoch.

    Examples
    --------
    >>> import numpy as np
    >>> from fgnav.attitude import RotationQuadratic
    >>> down = np.array([[0.0, 0.0, 1.0]])
    >>> level = RotationQuadratic.of_vector_pairs(down, down, 1e-4 * np.eye(3)[None])
    >>> level.information.shape, level.count
    ((1, 9, 9), array([3]))
    """

    information: FloatArray  # (n, 9, 9)
    vector: FloatArray  # (n, 9)
    constant: FloatArray  # (n,); the weighted square sum of the measurements themselves
    count: IntArray  # (n,); independent scalar measurements, nuisance parameters already taken off
    _root: list[tuple[FloatArray, FloatArray]] = field(
        default_factory=list, init=False, repr=False
    )  # once it is known: eigenvectors of nine dimensions are dear

    @classmethod
    def of_double_differences(
        cls, differences: DoubleDifferences, integers: Integers
    ) -> "RotationQuadratic":
        """Collect all fixed double-differenced phases of every epoch, with their full covariance.

        Works on undifferenced links: satellite terms are eliminated per channel, receiver terms per
        antenna and group, which equals double differencing with the full covariance, for any
        reference, any weights and any missing links.
        """
        return cls.of_ranges(differences, fixed_ranges_m(differences, integers))

    @classmethod
    def of_ranges(cls, differences: DoubleDifferences, ranges_m: FloatArray) -> "RotationQuadratic":
        """Collect double differences without integers, m, (n, b, m); NaN rows are left out.

        A NaN at a reference channel takes that one link of that antenna out: the rest of the
        antenna's group shares its error as a constant, which its receiver term takes up.
        """
        joint = range_information(differences, ranges_m, differences.baselines_b_m)
        finite, group = np.isfinite(ranges_m), differences.group
        receivers = [
            finite[:, :, group == g].any(axis=2).sum(axis=1)
            for g in range(group.max(initial=-1) + 1)
        ]
        count = finite.sum(axis=(1, 2)) - sum(receivers, np.zeros(len(finite), dtype=np.int64))
        return cls(joint[:, :9, :9].copy(), joint[:, :9, 9].copy(), joint[:, 9, 9].copy(), count)

    @classmethod
    def of_vector_pairs(
        cls, v_n: FloatArray, v_b: FloatArray, covariance_b: FloatArray
    ) -> "RotationQuadratic":
        """Collect one vector pair per epoch: ``v_b = R_nb.T @ v_n`` plus noise in body axes.

        Parameters
        ----------
        v_n : ndarray, shape (n, 3)
            Known in the frame ``n``.
        v_b : ndarray, shape (n, 3)
            Measured in body axes; NaN rows are not used.
        covariance_b : ndarray, shape (n, 3, 3)
            Of ``v_b``.
        """
        measured = np.asarray(np.isfinite(v_b).all(axis=1))
        weight = np.linalg.inv(covariance_b) * measured[:, None, None]
        v_b = np.where(measured[:, None], v_b, 0.0)
        weighted = np.einsum("nij,nj->ni", weight, v_b)
        n = len(v_n)
        return cls(
            np.einsum("ni,nj,nkl->nikjl", v_n, v_n, weight).reshape(n, 9, 9),
            np.einsum("ni,nk->nik", v_n, weighted).reshape(n, 9),
            np.einsum("ni,ni->n", v_b, weighted),
            np.where(measured, 3, 0),
        )

    def __add__(self, other: "RotationQuadratic") -> "RotationQuadratic":
        """Return the form of both sets of measurements together; they must be independent."""
        return RotationQuadratic(
            information=self.information + other.information,
            vector=self.vector + other.vector,
            constant=self.constant + other.constant,
            count=self.count + other.count,
        )

    def __getitem__(self, epochs: IntArray | slice) -> "RotationQuadratic":
        """Return the form of some epochs."""
        return RotationQuadratic(
            information=self.information[epochs],
            vector=self.vector[epochs],
            constant=self.constant[epochs],
            count=self.count[epochs],
        )

    def with_rows(self, rows: IntArray, part: "RotationQuadratic") -> "RotationQuadratic":
        """Return the form, that of some epochs, (k,), replaced."""
        out = self[np.arange(len(self.count))]
        for name in ("information", "vector", "constant", "count"):
            getattr(out, name)[rows] = getattr(part, name)
        return out

    def with_variance_factor(self, factor: float | FloatArray) -> "RotationQuadratic":
        """Return the form with all variances multiplied by a factor, or one of each epoch, (n,)."""
        factor = np.broadcast_to(factor, self.constant.shape)
        return RotationQuadratic(
            information=self.information / factor[:, None, None],
            vector=self.vector / factor[:, None],
            constant=self.constant / factor,
            count=self.count,
        )

    def chi_square(self, R_nb: FloatArray) -> FloatArray:
        """Return the weighted square sum of residuals, (n,), at attitudes (n, 3, 3)."""
        x = R_nb.reshape(-1, 9)
        quadratic = np.einsum("ni,nij,nj->n", x, self.information, x)
        return np.asarray(quadratic - 2 * np.einsum("ni,ni->n", self.vector, x) + self.constant)

    def information_at(self, R_nb: FloatArray) -> FloatArray:
        """Return the Fisher information of the body tangent, 1/rad2, (n, 3, 3), at attitudes."""
        J = tangent_jacobian(R_nb)
        return np.asarray(J.swapaxes(1, 2) @ self.information @ J)

    def gradient_at(self, R_nb: FloatArray) -> FloatArray:
        """Return the gradient of ``-log p`` by the body tangent, 1/rad, (n, 3), at attitudes."""
        x = R_nb.reshape(-1, 9)
        slope = np.einsum("nij,nj->ni", self.information, x) - self.vector
        return np.asarray(np.einsum("nik,ni->nk", tangent_jacobian(R_nb), slope))

    def unconstrained(self) -> FloatArray:
        """Return the matrix of least norm that minimises each form, (n, 3, 3); not a rotation."""
        return self.square_root()[1]

    def square_root(self) -> tuple[FloatArray, FloatArray]:
        """Return W, (n, 9, 9), and M, (n, 3, 3), of ``|W (R - M).ravel()|^2 / 2`` plus a constant.

        M is ``unconstrained``. Directions of which the epoch says nothing have rows of zeros.
        """
        if not self._root:
            self._root.append(self._split())
        return self._root[0]

    def _split(self) -> tuple[FloatArray, FloatArray]:
        if not np.isfinite(self.information).all():
            raise NoSolutionError(
                "array: phases of some epochs have no finite weight; see what fgnav check says of "
                "antennas and noise"
            )
        root, minimum = square_root(self.information, self.vector)
        return root, minimum.reshape(-1, 3, 3)


def square_root(information: FloatArray, vector: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return W, (n, d, d), and m, (n, d), of forms ``|W (x - m)|^2 / 2`` plus a constant.

    Directions of which an epoch says nothing have rows of zeros.
    """
    values, vectors = np.linalg.eigh(information)
    observable = values > _NOTHING * values[:, -1:]
    root = np.sqrt(np.where(observable, values, 0.0))
    inverse = np.where(observable, 1.0 / np.where(observable, values, 1.0), 0.0)
    across = vectors.swapaxes(1, 2)
    minimum = vectors @ (inverse[:, :, None] * (across @ vector[:, :, None]))
    return root[:, :, None] * across, minimum[:, :, 0]


def tangent_jacobian(R_nb: FloatArray) -> FloatArray:
    """Return the derivative of R_nb.ravel() by its body-axes tangent, (n, 9, 3)."""
    J: FloatArray = np.zeros((*R_nb.shape, 3))
    for k in range(3):  # about axis k, the next axis turns towards the one after it
        near, far = (k + 1) % 3, (k + 2) % 3
        J[:, :, near, k], J[:, :, far, k] = R_nb[:, :, far], -R_nb[:, :, near]
    return J.reshape(-1, 9, 3)
