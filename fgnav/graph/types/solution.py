"""Solution of a problem: states at keyframes, constants, and their covariances."""

from dataclasses import dataclass

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.graph.types.states import States


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Solution:
    """States of n keyframes with their covariances, D dimensions each.

    Attributes
    ----------
    states : States
        Its constants are as known by all that was used.
    covariance : ndarray, shape (n, D, D)
        Tangents as in ``states``: rotation, position in body axes; velocity in ``n``; ``aux``.
    cross : ndarray, shape (n, D, D), or None
        Covariance of each state with the next, zero after the newest; None of states that are not
        of one smoothing.
    constant_covariance : ndarray, shape (n, b, b)
        Of the constants at each keyframe: what was known of them by then, of a window; else the
        same everywhere.
    constant_cross : ndarray, shape (n, D, b)
        Of each state with the constants.
    constants : ndarray, shape (n, b), or None
        The constants as known at each keyframe, of a window; None: everywhere those of ``states``.
    converged : bool
        Whether all of it ended at a minimum.
    refused : ndarray of bool, shape (n,), or None
        States of a window that did not; None: none.
    cost : float
        Sum of all whitened residuals squared; NaN of what is not one minimum.
    solver : str
        Who found it.
    updates : int
        Updates of GTSAM's smoother, or iterations of a batch.
    """

    states: States
    covariance: FloatArray
    cross: FloatArray | None
    constant_covariance: FloatArray
    constant_cross: FloatArray
    converged: bool
    constants: FloatArray | None = None
    cost: float = float("nan")
    solver: str = ""
    updates: int = 0
    refused: BoolArray | None = None

    def __getitem__(self, rows: IntArray) -> "Solution":
        """Select states, (m,), without their neighbours."""
        return Solution(
            states=self.states.at(rows),
            covariance=self.covariance[rows],
            cross=None,
            constant_covariance=self.constant_covariance[rows],
            constant_cross=self.constant_cross[rows],
            converged=self.converged,
            constants=None if self.constants is None else self.constants[rows],
            cost=self.cost,
            solver=self.solver,
            updates=self.updates,
            refused=None if self.refused is None else self.refused[rows],
        )
