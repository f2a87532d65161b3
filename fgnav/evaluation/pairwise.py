"""Estimates against each other, where there is no truth to judge them by."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from fgnav.checks import FloatArray
from fgnav.evaluation.reference import common_epochs
from fgnav.evaluation.scores import EULER, Angles, angles, degrees, hidden, rms
from fgnav.geometry import rotations
from fgnav.types.estimate import Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """RMS difference of two methods on the epochs that both have."""

    methods: tuple[str, str]  # the two names
    epochs: int
    rms_deg: Angles
    attitude_rms_deg: float | None
    position_rms_m: float | None
    velocity_rms_mps: float | None


def pairwise(estimates: Sequence[Estimate]) -> tuple[Difference, ...]:
    """Return the difference of each pair of estimates."""
    return tuple(_difference(a, b) for a, b in combinations(estimates, 2))


def _difference(a: Estimate, b: Estimate) -> Difference:
    """Return the RMS difference of two estimates on their common epochs."""
    of_a, of_b = common_epochs(a.t_s, b.t_s)

    def rms_of(x: FloatArray | None, y: FloatArray | None) -> float | None:
        return None if x is None or y is None else rms(x[of_a] - y[of_b])

    lost = hidden(a) | hidden(b)
    R_a, R_b = a.R_nb[of_a], b.R_nb[of_b]
    euler_rad = rotations.wrap(rotations.to_euler(R_a) - rotations.to_euler(R_b))
    euler_rad[:, [name in lost for name in EULER]] = np.nan
    tangent_rad = rotations.log(rotations.transpose(R_a) @ R_b)
    return Difference(
        methods=(a.method, b.method),
        epochs=len(of_a),
        rms_deg=angles(euler_rad),
        attitude_rms_deg=None if lost & set(EULER) else degrees(rms(tangent_rad)),
        position_rms_m=rms_of(a.p_n_m, b.p_n_m),
        velocity_rms_mps=rms_of(a.v_n_mps, b.v_n_mps),
    )
