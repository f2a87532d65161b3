"""GTSAM's incremental smoother over keyframes, eliminated in the order of time.

What GTSAM 4.3.0 asks of its callers, each measured:

- Ordered by time, the oldest keyframes are leaves of the Bayes tree and are marginalised as they
  are; ``IncrementalFixedLagSmoother`` has all of the window eliminated anew for that, three times
  the cost where every keyframe is an update. CCOLAMD fails of group numbers that are not below the
  number of variables eliminated anew: they count from the first of those.
- What is relinearised is decided here: ISAM2's own thresholds go by a variable's letter and want
  one size of it, which constants have not.
- QR, for Cholesky fails of slow motion; a wildfire threshold far below sigma, for that of 1e-3
  leaves velocities behind by more than theirs; factor slots are reused, or grow without end.
- After an exception the smoother is of no more use.
"""

from collections.abc import Callable

import gtsam
import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph.build import Layout
from fgnav.graph.states import AUX, ROTATION
from fgnav.solve.failures import open_state
from fgnav.solve.marginals import Marginals

_WILDFIRE = 1e-5  # m, rad
_OPEN = 1e12  # variance, m2 or rad2, where the weakest prior has 1e6
_MOST = 0.5  # of the variables eliminated anew: above 0.65 ISAM2 orders all of them


class IncrementalSmoother:
    """ISAM2, and which keyframes are in it.

    Parameters
    ----------
    layout : Layout

    Attributes
    ----------
    oldest, end : int
        Keyframes ``oldest`` to ``end - 1`` are in it.
    is_chain : bool
        Whether no factor has yet joined other keyframes than neighbours.
    """

    def __init__(self, layout: Layout) -> None:
        parameters = gtsam.ISAM2Params()
        parameters.setFactorization("QR")
        parameters.setOptimizationParams(gtsam.ISAM2GaussNewtonParams(_WILDFIRE))
        parameters.findUnusedFactorSlots = True
        parameters.enableRelinearization = False  # but where an update forces it
        parameters.setRelinearizeThreshold(0.0)
        self._isam, self._layout = gtsam.ISAM2(parameters), layout
        self._constants = layout.constant_keys
        self._variables = gtsam.KeyList()
        self.oldest, self.end, self.is_chain = 0, 0, True

    def update(
        self,
        graph: gtsam.NonlinearFactorGraph,
        values: gtsam.Values,
        end: int,
        relinearised: list[int],
    ) -> None:
        """Take in factors and keyframes up to ``end``; linearise some anew where they are now.

        Raises
        ------
        RuntimeError
            Of GTSAM, naming a variable that the data leave open.
        """
        first = max(min([self.end, *relinearised]) - 1, self.oldest)
        if not self.is_chain or end - first > _MOST * (end - self.oldest):
            first = self.oldest
        parameters, layout = gtsam.ISAM2UpdateParams(), self._layout
        if relinearised:
            parameters.force_relinearize = True
            parameters.noRelinKeys = gtsam.KeyList(self._variables)
            for k in relinearised:
                for key in layout.keyframe(k):
                    parameters.noRelinKeys.remove(key)
        if not self.is_chain:
            parameters.extraReelimKeys = self._variables
        groups = gtsam.KeyGroupMap()
        for k in range(first, end):
            for key in layout.keyframe(k):
                groups.insert2(key, k - first)
        for key in self._constants:
            groups.insert2(key, end - first)
        parameters.constrainedKeys = groups
        self._isam.update(graph, values, parameters)
        for key in values.keys():  # noqa: SIM118  # not a dict
            self._variables.push_back(key)
        self.end = end

    def marginalise(self, oldest: int) -> None:
        """Leave out keyframes before ``oldest``; what they tell of the others stays."""
        leaves = gtsam.KeyList()
        for k in range(self.oldest, oldest):
            for key in self._layout.keyframe(k):
                leaves.push_back(key)
                self._variables.remove(key)
        self._isam.marginalizeLeaves(leaves)
        self.oldest = oldest

    def steps(self) -> tuple[FloatArray, FloatArray]:
        """Return the way from where variables are linearised to their estimates.

        Of keyframes, (n, D), and of constants, (b,): as in ``States``, positions move by
        ``R dp``, whatever the rotation.
        """
        n, aux = self.end - self.oldest, self._layout.width - AUX
        whole, b = self._isam.getDelta().vector(), self._layout.constants.width
        # In the order of letters: b before c, then m, v and x.
        first = n * aux if self._layout.gyroscope else 0
        v, x = b + n * aux, b + n * (aux + 3)
        steps = np.empty((n, AUX + aux))
        steps[:, :6], steps[:, 6:AUX] = whole[x:].reshape(n, 6), whole[v:x].reshape(n, 3)
        own = whole[:first] if first else whole[b:v]
        steps[:, AUX:] = own.reshape(n, aux)
        return steps, whole[first : first + b]

    def marginals(self, numbers: range, t_s: Callable[[int], float]) -> Marginals:
        """Return covariances of keyframes, and of each with the next.

        Raises
        ------
        NoSolutionError
            Naming the state that the data leave open: QR does not fail of it.
        """
        layout, m = self._layout, len(numbers)
        D, b = layout.width, layout.constants.width
        known = Marginals(
            np.empty((m, D, D)), np.zeros((m, D, D)), np.empty((b, b)), np.empty((m, D, b))
        )
        for i, k in enumerate(numbers):
            after = layout.keyframe(k + 1) if k + 1 < self.end else ()
            P = self._joint([*layout.keyframe(k), *after, *self._constants])
            variances = np.diag(P)[:D]
            is_open = ~(np.isfinite(variances) & (variances < _OPEN))
            if is_open.any():
                raise open_state(int(is_open.argmax()), D, t_s(k))
            known.covariance[i], known.constant_cross[i] = P[:D, :D], P[:D, len(P) - b :]
            known.constant[:] = P[len(P) - b :, len(P) - b :]
            if after:
                known.cross[i] = P[:D, D : 2 * D]
        return known

    def turn_sigma_rad(self, k: int) -> float:
        """Return the 1-sigma of a keyframe's rotation, all axes."""
        rotation = self._joint([self._layout.keyframe(k)[0]])[ROTATION, ROTATION]
        return float(np.sqrt(np.trace(rotation)))

    def _joint(self, variables: list[int]) -> FloatArray:
        """Return the joint covariance of some variables, one after another."""
        joint: FloatArray = self._isam.jointMarginalCovariance(variables).fullMatrix()
        return joint

    def is_fixed(self, k: int) -> bool:
        """Return whether what has been marginalised knows a keyframe where it is linearised."""
        if self.is_chain:
            return k == self.oldest and k > 0
        return bool(self._isam.getFixedVariables().count(self._layout.keyframe(k)[0]))
