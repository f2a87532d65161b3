"""Carrier phases of an antenna, undifferenced, with an ambiguity of each arc.

Of channel i at keyframe k, in the block of arcs that began at ``t_A`` [1]_:

    phase_i - range_i(s) = -e_i . (p + R a - s) + clock_g + n_i + d_j + r_j (t - t_A) + noise

a the antenna from the accelerometer, g the channel's carrier, n_i its arc's ambiguity, d_j what
orbits, clocks and atmosphere of satellite j add that no model knows, and r_j how fast that grows.
Rows are whitened and multiplied by an orthonormal basis of what clocks leave open [2]_, so that
clocks are gone without loss:

    G (p + R (a + l)) + H A - z,    A = (n_1, n_2, ..., d_1, d_2, ..., r_1, r_2, ...)

One vector variable A for the arcs of half a second, or until one begins or ends. To the next:

    n' = n,  d' = d + r (t_A' - t_A) + walk,  r' = r,  phase_i - code_i = n'_i + clock_g + noise

References
----------
.. [1] Teunissen, Montenbruck: Springer Handbook of Global Navigation Satellite Systems, 2017,
   equation 19.7.
.. [2] Schaffrin, Grafarend: Generating classes of equivalent linear models by nuisance parameter
   elimination, Manuscripta Geodaetica 11, 1986.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import gtsam
import numpy as np
from numpy.typing import NDArray

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry import rotation_kernel as rot
from fgnav.graph import keys
from fgnav.graph.factors.position import LEVER_ARM
from fgnav.graph.linear_factor import linear_factor
from fgnav.graph.types.on_demand import OnDemand
from fgnav.graph.types.parameters import Parameters
from fgnav.kernels.compiled import kernel


class PhaseRows(NamedTuple):
    """Whitened rows of one epoch: ``G (p + R (a + l)) + H A - z``."""

    G: FloatArray  # (m, 3)
    H: FloatArray  # (m, d)
    z: FloatArray  # (m,)

    def without_place(self) -> tuple[FloatArray, FloatArray]:
        """Return rows of A alone, the place of the antenna eliminated, and their right-hand side.

        Of fewer than three rows none is left.
        """
        Q, _ = np.linalg.qr(self.G, mode="complete")
        left = Q[:, 3:].T
        return left @ self.H, left @ self.z


class ArcBlock(NamedTuple):
    """One variable A' of d' dimensions, and what leads to it from A, of d, of the block before.

    ``after A' - before A - right`` is white.
    """

    begin_row: int  # keyframe
    before: FloatArray  # (q, d); (q, 0) of the first block
    after: FloatArray  # (q, d')
    right: FloatArray  # (q,)
    satellites: int = 0  # whose errors d, and then rates r, are the last of A'

    @property
    def size(self) -> int:
        """Dimensions of A'."""
        return int(self.after.shape[1])


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class AntennaPhase:
    """Phases of an antenna at k keyframes."""

    name: ClassVar[str] = "phase"  # in reports
    row: IntArray  # (k,): keyframes, increasing
    rows: Sequence[PhaseRows]  # length k: made on demand, as a rule: take each but once
    block: IntArray  # (k,): which block's A each has
    blocks: Sequence[ArcBlock]  # as the rows
    arm_b_m: FloatArray  # (k, 3): from the accelerometer to the antenna
    constants: Parameters  # of the problem, l among them where the lever arm is estimated
    first_block: int = 0  # number of the first of the blocks: of phases that go on

    @property
    def freedom(self) -> IntArray:
        """Rows of each epoch, (k,)."""
        return np.array([len(epoch.z) for epoch in self.rows], dtype=np.int64)

    def factor(self, i: int, key: int) -> gtsam.CustomFactor:
        """Return the phases of epoch i as a factor of keyframe ``key``."""
        epoch, arm_b_m = self.rows[i], self.arm_b_m[i]
        pose, arcs = keys.pose(key), keys.arcs(int(self.block[i]))
        involved, lever = [pose, arcs], -1
        if self.constants.column(LEVER_ARM) >= 0:
            lever = keys.constant(self.constants.first.index(self.constants.column(LEVER_ARM)))
            involved.append(lever)

        def error(
            _: gtsam.CustomFactor, values: gtsam.Values, H: list[FloatArray] | None
        ) -> NDArray[np.float64]:
            arm = arm_b_m if lever < 0 else arm_b_m + values.atVector(lever)
            value, by_pose, by_lever = residual(
                values.atPose3(pose).matrix(), values.atVector(arcs), arm, *epoch
            )
            if H is not None:
                H[0], H[1] = by_pose, epoch.H
                if lever >= 0:
                    H[2] = by_lever
            return np.asarray(value, dtype=np.float64)

        return gtsam.CustomFactor(gtsam.noiseModel.Unit.Create(len(epoch.z)), involved, error)

    def transition_factor(self, block: int) -> gtsam.NonlinearFactor:
        """Build the transition to the A of a block, from that before or from nothing."""
        arcs, point = self.blocks[block - self.first_block], gtsam.Values()
        terms = [(keys.arcs(block), arcs.after)]
        if arcs.before.shape[1]:
            terms.append((keys.arcs(block - 1), -arcs.before))
        for key, A in terms:
            point.insert(key, np.zeros(A.shape[1]))
        return gtsam.LinearContainerFactor(linear_factor(terms, arcs.right), point)

    def ending(self, last: int) -> dict[int, tuple[int, ...]]:
        """Return the blocks that end with each keyframe, the newest being ``last``."""
        ends = [block.begin_row - 1 for block in self.blocks[1:]] + [last]
        return {k: (j,) for j, k in enumerate(ends[: len(self.blocks)])}

    def move(self, row: IntArray) -> "AntennaPhase":
        """Move the phases to other keyframes, (k,), of a finer timeline."""
        of = dict(zip(self.row.tolist(), row.tolist(), strict=True))
        return replace(self, row=row, blocks=_begun_at(self.blocks, of))


def _begun_at(blocks: Sequence[ArcBlock], of: dict[int, int]) -> Sequence[ArcBlock]:
    def moved(j: int) -> ArcBlock:
        block = blocks[j]
        return block._replace(begin_row=of[block.begin_row])

    return OnDemand(len(blocks), moved)


@kernel
def residual(
    pose: FloatArray, arcs: FloatArray, arm: FloatArray, G: FloatArray, H: FloatArray, z: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the residual of an epoch, (m,), and how it changes with pose and lever arm.

    With the pose, (4, 4) as GTSAM's in memory, (m, 6) as in ``gtsam.Pose3``; with the lever arm,
    (m, 3); with ``arcs`` it changes by H.
    """
    m, R = len(z), np.empty((3, 3))
    p_n_m = np.empty(3)
    for i in range(3):
        p_n_m[i] = pose[i, 3]
        for j in range(3):
            R[i, j] = pose[i, j]
            p_n_m[i] += pose[i, j] * arm[j]
    turned = rot.product(G, R)
    cross = rot.product(turned, rot.skew(arm))
    value, by_pose = np.empty(m), np.empty((m, 6))
    for i in range(m):
        total = -z[i]
        for j in range(3):
            total += G[i, j] * p_n_m[j]
            by_pose[i, j], by_pose[i, 3 + j] = -cross[i, j], turned[i, j]
        for j in range(len(arcs)):
            total += H[i, j] * arcs[j]
        value[i] = total
    return value, by_pose, turned
