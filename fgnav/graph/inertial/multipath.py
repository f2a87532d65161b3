"""Time-correlated phase error of antenna and satellite, as a state of the array.

Of the error of each link of an array a share s of the variance is a first-order Gauss-Markov
process, mirrored signals as a rule, of the time constant tau; the rest is white. All that both do
to the nine elements x of R_nb is ``u = N^-1 A' W error``, of covariance ``N^-1``, N the information
of the epoch's phases (``fgnav.attitude.quadratic``). So the links' states come down, without loss,
to one vector z of unit covariance, ``u = N^-1/2 (sqrt(s) z + sqrt(1 - s) white)``, and

    z_1 = F z_0 + noise of covariance I - F F'        F = exp(-T / tau) N_1^-1/2 N_01 N_0^-1/2,

N_01 the information of the links that both epochs have. Of an array in a plane, or in a line, x has
directions that no link knows of; z is what is left, by an orthonormal basis.
"""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import FloatArray, freeze
from fgnav.graph.inertial.increments import parents


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Multipath:
    """A lasting error of an array's phases, at n keyframes."""

    t_s: FloatArray  # (n,)
    basis: FloatArray  # (9, q): orthonormal; of the elements of R_nb by row
    share: FloatArray  # (n,): of the phases' variance, from 0 to 1
    decay_per_s: FloatArray  # (n - 1,): inverse time constant
    kept: FloatArray  # (n - 1, q, q): ``N_1^-1/2 N_01 N_0^-1/2``, by the basis

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        n, q = len(self.t_s), self.basis.shape[-1]
        shapes = {"t_s": (n,), "basis": (9, q), "share": (n,), "decay_per_s": (n - 1,)}
        freeze("multipath", self, shapes | {"kept": (n - 1, q, q)})

    @property
    def size(self) -> int:
        """Dimensions of z, q."""
        return int(self.basis.shape[1])

    def transition(self) -> tuple[FloatArray, FloatArray]:
        """Return F and what whitens its noise, (n - 1, q, q) each."""
        last = np.exp(-np.diff(self.t_s) * self.decay_per_s)
        F = last[:, None, None] * self.kept
        noise = np.eye(self.size) - F @ F.swapaxes(1, 2)
        return F, np.linalg.inv(np.linalg.cholesky(noise))

    def inflation(self) -> FloatArray:
        """Return the factor of variances, (n,), by which white errors know of a constant no more.

        ``1 - s + s (1 + rho) / (1 - rho)``, rho the correlation of keyframes next to each other:
        the largest row sum of the correlations, so by Gershgorin's theorem never too little.
        """
        rho = np.exp(-np.median(np.diff(self.t_s)) * self.decay_per_s.mean())
        return np.asarray(1 + self.share * 2 * rho / (1 - rho))

    def at_times(self, t_s: FloatArray) -> "Multipath":
        """Build the error at other keyframes, (m,), the present ones among them.

        The links change where the next of the present ones is.
        """
        parent = parents(self.t_s, t_s)
        ends = np.isin(t_s[1:], self.t_s)
        kept = np.where(ends[:, None, None], self.kept[parent], np.eye(self.size))
        row = (np.searchsorted(self.t_s, t_s, side="right") - 1).clip(0)
        return replace(
            self,
            t_s=t_s,
            share=self.share[row],
            decay_per_s=self.decay_per_s[parent],
            kept=kept,
        )
