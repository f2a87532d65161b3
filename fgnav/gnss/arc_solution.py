"""What an adjustment of arcs has found: their constants, and the positions that follow."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss import arc_kernel as kernel
from fgnav.gnss.arc_equations import Epochs
from fgnav.gnss.position_phase import PositionPhase


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class PhasePositions:
    """Positions of the reference antenna at nominal epochs.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
    p_n_m : ndarray, shape (k, 3)
    noise_m2 : ndarray, shape (k, 3, 3)
        The part of the covariance that is new at every epoch: millimetres to centimetres.
    common_m2 : ndarray, shape (k, 3, 3)
        The part that the constants of the arcs bring, common to neighbours.
    piece : ndarray of int, shape (k,)
        Number of the stretch of epochs that phase connects: common errors are common within it.
    """

    t_s: FloatArray
    p_n_m: FloatArray
    noise_m2: FloatArray
    common_m2: FloatArray
    piece: IntArray


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ArcAdjustment:
    """Constants of a flight's arcs, and what is needed to make positions of them.

    Attributes
    ----------
    equations : PositionPhase
    epochs : Epochs
    cofactor : ndarray, shape (n, p, p)
        Covariance of the unknowns of each epoch if the arcs' constants were known.
    solved : ndarray of bool, shape (n,)
    constant_m : ndarray, shape (a + 1,)
        The last stands for no arc: 0.
    covariance_m2 : ndarray, shape (a + 1, a + 1)
    piece : ndarray of int, shape (n,)
    misfit : float
        Mean square of the residuals of phase in stated sigmas, large ones cut.
    rejected : int
        Phases taken out, whose residuals are no noise.
    code_thinning : float
        How many times less averages of code tell than its noise says.
    shift_covariance_m2 : ndarray, shape (3, 3)
        Of what positions have in common with the errors of messages, and phase does not tell.
    unsure_n_m : ndarray, shape (n, 3)
        1-sigma of a shift that drifts over the flight, where two readings of the phases fit alike.
    """

    equations: PositionPhase
    epochs: Epochs
    cofactor: FloatArray
    solved: BoolArray
    constant_m: FloatArray
    covariance_m2: FloatArray
    piece: IntArray
    misfit: float
    rejected: int
    code_thinning: float
    shift_covariance_m2: FloatArray
    unsure_n_m: FloatArray

    def given(self, combinations: FloatArray, values_m: FloatArray) -> "ArcAdjustment":
        """Return the adjustment once combinations of constants are known.

        Parameters
        ----------
        combinations : ndarray, shape (c, a)
        values_m : ndarray, shape (c,)
        """
        H, Q = np.pad(combinations, ((0, 0), (0, 1))), self.covariance_m2
        gain = np.linalg.solve(H @ Q @ H.T, H @ Q).T
        return replace(
            self,
            constant_m=self.constant_m + gain @ (values_m - H @ self.constant_m),
            covariance_m2=Q - gain @ H @ Q,
        )

    def positions(self) -> PhasePositions:
        """Return positions at the epochs that have one."""
        own, row = self.epochs, np.flatnonzero(self.solved)
        x, _ = fitted(own, self.cofactor, self.constant_m)
        p_n_m = self.equations.start_n_m + x[:, :3] - self.equations.late_n_m
        A, weight = own.A[:, own.phases], own.weight[:, own.phases]
        arc = own.arc[:, own.phases]
        return PhasePositions(
            t_s=self.equations.single.t_s[row],
            p_n_m=p_n_m[row],
            noise_m2=self.cofactor[row, :3, :3],
            common_m2=kernel.spread(A, weight, self.cofactor, row, arc, self.covariance_m2),
            piece=self.piece[row],
        )


def fitted(
    own: Epochs, cofactor: FloatArray, constant_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the unknowns of every epoch, the constants of arcs known; and residuals."""
    return kernel.fit(own.A, own.y - constant_m[own.arc], own.weight, cofactor)
