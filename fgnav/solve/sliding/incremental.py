"""GTSAM's incremental fixed-lag smoother, told by number what enters, what leaves and what moves.

What GTSAM 4.3.0 asks of its callers, each measured:

- What enters and what is linearised anew go into one update of its ISAM2, which eliminates in the
  order of time: left to itself it begins at either end, and every second update then eliminates the
  whole window. What leaves is at the end of the tree by that, and the smoother's own update, which
  cannot take an order, only cuts it off: .4 ms where it took 20.
- A keyframe's variables are stamped with its number and constants with the newest, and the lag is
  set before each update: what leaves is decided here, and no rounding of times takes part.
- What is relinearised is decided here: ISAM2's own thresholds go by a variable's letter and want
  one size of it, which constants have not.
- QR, for Cholesky fails of slow motion; a wildfire threshold far below sigma, for that of 1e-3
  leaves velocities behind by more than theirs; factor slots are reused, or grow without end.
- After an exception the smoother is of no more use.
"""

from collections.abc import Iterable
from typing import SupportsFloat, SupportsIndex, SupportsInt

import gtsam
import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph import keys
from fgnav.graph.build import Layout
from fgnav.graph.types.states import AUX

_WILDFIRE = 1e-5  # m, rad
_OPEN_END = 1 << 60  # a keyframe that never comes


class IncrementalSmoother:
    """``gtsam.IncrementalFixedLagSmoother``, and which keyframes are in it.

    Parameters
    ----------
    layout : Layout
    oldest : int
        Its first keyframe.

    Attributes
    ----------
    oldest, end : int
        Keyframes ``oldest`` to ``end - 1`` are in it.
    isam2 : gtsam.ISAM2
    is_chain : bool
        Whether no factor has yet joined other keyframes than neighbours.
    """

    def __init__(self, layout: Layout, oldest: int = 0) -> None:
        parameters = gtsam.ISAM2Params()
        parameters.setFactorization("QR")
        parameters.setOptimizationParams(gtsam.ISAM2GaussNewtonParams(_WILDFIRE))
        parameters.findUnusedFactorSlots = True
        parameters.enableRelinearization = False  # but where an update forces it
        parameters.setRelinearizeThreshold(0.0)
        self._smoother = gtsam.IncrementalFixedLagSmoother(np.inf, parameters)
        self.isam2, self._layout = self._smoother.getISAM2(), layout
        self._constants = layout.constant_keys
        self._variables: set[int] = set()
        self._arcs: dict[int, tuple[int, int]] = {}  # size, and the last keyframe that needs it
        self._leaving: set[int] = set()  # by the next update
        self._stamped = oldest  # keyframes before it have a time in GTSAM's smoother
        self.oldest, self.end, self.is_chain = oldest, oldest, True

    def enter_arcs(self, key: int, size: int, begin: int) -> None:
        """Let arcs begin with the next update, at a keyframe; those before end just before it."""
        for before, (width, last) in self._arcs.items():
            self._arcs[before] = width, min(last, begin - 1)
        self._arcs[key] = size, _OPEN_END

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
        self.end = end
        entered = values.keys()  # a list of keys, not a dict's
        if entered or relinearised or not graph.empty():
            self._variables.update(entered)
            shared = self._arcs.keys() | set(self._constants)
            touched = [keys.index(key) for key in graph.keyVector() if key not in shared]
            parameters = self._ordered(min((*relinearised, *touched), default=end - 1))
            if relinearised:
                moved = {key for k in relinearised for key in self._layout.keyframe(k)}
                parameters.force_relinearize = True
                parameters.noRelinKeys = _key_list(self._variables - moved)
            self.isam2.update(graph, values, parameters)
        if self._leaving:
            self._leave()

    def _ordered(self, first: int) -> gtsam.ISAM2UpdateParams:
        """Return that keyframes are eliminated one after another as they came, then constants.

        Eliminated are at least those from the first on that an update touches, and the one before:
        there may be as many groups as variables in what is eliminated. The older are the first one,
        which needs no name.
        """
        base = max(first - 1, self.oldest)
        last = 3 * (self.end - base) - 1
        second = max(self.end - last + 1, self.oldest)
        rank = {key: k for k in range(second, self.end) for key in self._layout.keyframe(k)}
        # Arcs with their last keyframe, while they go on beside the constants.
        rank |= {key: min(k, self.end) for key, (_, k) in self._arcs.items()}
        rank |= dict.fromkeys(self._constants, self.end)
        groups, parameters = gtsam.KeyGroupMap(), gtsam.ISAM2UpdateParams()
        for key, after in rank.items():
            groups.insert2(key, max(last - self.end + after, 0))
        parameters.constrainedKeys = groups
        parameters.extraReelimKeys = _key_list(self._layout.keyframe(base))
        return parameters

    def _leave(self) -> None:
        """Let GTSAM's smoother know keyframes that are new to it, and marginalise what leaves."""
        last = self.end - 1
        stamps: dict[SupportsInt | SupportsIndex, SupportsFloat | SupportsIndex] = {}
        stamps.update(dict.fromkeys(self._constants, float(last)))
        for k in range(self._stamped, self.end):
            stamps.update(dict.fromkeys(self._layout.keyframe(k), float(k)))
        self._stamped = self.end
        for key, (_, k) in self._arcs.items():
            stamps[key] = float(min(k, last))
        self._smoother.setSmootherLag(float(last - self.oldest))
        self._smoother.update(gtsam.NonlinearFactorGraph(), gtsam.Values(), stamps)
        self._variables.difference_update(self._leaving)
        for key in self._leaving & self._arcs.keys():
            del self._arcs[key]
        self._leaving.clear()

    def marginalise(self, oldest: int) -> None:
        """Leave out keyframes before ``oldest`` by the next update; what they tell stays."""
        for k in range(self.oldest, oldest):
            self._leaving.update(self._layout.keyframe(k))
        self._leaving.update(key for key, (_, last) in self._arcs.items() if last < oldest)
        self.oldest = oldest

    def steps(self) -> tuple[FloatArray, FloatArray]:
        """Return the way from where variables are linearised to their estimates.

        Of keyframes, (n, D), and of constants, (b,): as in ``States``, positions move by
        ``R dp``, whatever the rotation.
        """
        n, aux = self.end - self.oldest, self._layout.width - AUX
        delta, b = self.isam2.getDelta().vector(), self._layout.constants.width
        # In the order of letters: a before b and c, then m, v and x.
        delta = delta[sum(size for size, _ in self._arcs.values()) :]
        first = n * aux if self._layout.gyroscope else 0
        v, x = b + n * aux, b + n * (aux + 3)
        steps = np.empty((n, AUX + aux))
        steps[:, :6], steps[:, 6:AUX] = delta[x:].reshape(n, 6), delta[v:x].reshape(n, 3)
        vectors = delta[:first] if first else delta[b:v]
        steps[:, AUX:] = vectors.reshape(n, aux)
        return steps, delta[first : first + b]

    def is_fixed(self, k: int) -> bool:
        """Return True if marginalization has fixed the linearization point of a keyframe."""
        if self.is_chain:
            return k == self.oldest and k > 0
        return bool(self.isam2.getFixedVariables().count(self._layout.keyframe(k)[0]))


def _key_list(variables: Iterable[int]) -> gtsam.KeyList:
    listed = gtsam.KeyList()
    for key in variables:
        listed.push_back(key)
    return listed
