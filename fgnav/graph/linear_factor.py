"""White linear rows as GTSAM's factor."""

from collections.abc import Sequence

import gtsam
import numpy as np

from fgnav.checks import FloatArray


def linear_factor(
    terms: Sequence[tuple[int, FloatArray]], right: FloatArray
) -> gtsam.JacobianFactor:
    """Return the white rows ``sum of A_i x_i = right``, of any number of variables.

    GTSAM's own constructors end at three variables; those of a conditional do not.
    """
    unit = gtsam.noiseModel.Unit.Create(len(right))
    blocks = [(key, np.asfortranarray(A)) for key, A in terms]
    return gtsam.JacobianFactor(gtsam.GaussianConditional(blocks, 1, right, unit))
