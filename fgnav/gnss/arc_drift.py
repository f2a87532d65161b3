"""What an error that stays with satellites does to the constants of arcs while the sky turns.

Errors of messages and of models of the atmosphere last for minutes: a shift s of all positions that
code tells is in their phases, too, as -A s, with directions to satellites in A. Arcs have constants
for that, but directions turn: a metre grows by 0.15 mm/s. Left alone, it passes for noise of the
phase; told from the phases themselves, it is no error of velocity any more.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray
from fgnav.gnss.arc_equations import Epochs


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Drift:
    """How phases follow a shift of the positions that code tells.

    Attributes
    ----------
    columns : ndarray, shape (n, 2 m, 3)
        Derivative of ``Epochs.y`` by the shift, without what constants of arcs take.
    shown : ndarray, shape (n, 2 m, 3)
        That of residuals.
    information : ndarray, shape (3, 3)
        Of the shift, 1/m2, by the stated noise.
    prior : ndarray, shape (3, 3)
        Before any phase, 1/m2.
    """

    columns: FloatArray
    shown: FloatArray
    information: FloatArray
    prior: FloatArray

    def shift_m(self, own: Epochs, residual_m: FloatArray, inflation: float = 1.0) -> FloatArray:
        """Return the shift that residuals, (n, 2 m), ask for, their variance so much larger."""
        pull = np.einsum("nmi,nm->i", self.shown, own.weight * residual_m)
        return np.asarray(self.covariance_m2(inflation) @ pull / inflation)

    def covariance_m2(self, inflation: float = 1.0) -> FloatArray:
        """Return the covariance of the shift, (3, 3)."""
        return np.linalg.inv(self.information / inflation + self.prior)


def columns_of(own: Epochs) -> FloatArray:
    """Return how measurements follow a shift, (n, 2 m, 3), each arc's mean taken off."""
    arc, used = own.arc[:, own.phases], own.weight[:, own.phases] > 0
    A = own.A[:, own.phases, :3]
    count = np.bincount(arc[used], minlength=len(own.channel) + 1).clip(1)
    means = np.stack(
        [np.bincount(arc[used], A[:, :, i][used], len(count)) / count for i in range(3)], axis=1
    )
    out = np.zeros((*own.y.shape, 3))
    out[:, own.phases] = np.where(used[:, :, None], means[arc] - A, 0.0)
    return out
