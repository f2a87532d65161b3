"""A flight as a smoother takes it: where to start, motion, measurements, constants, prior."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.measurement import Measurement
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.states import States

# 1-sigma before the first keyframe: next to nothing. Ten times less of the position, and rounding
# would leave it open where the first fix is some keyframes away.
ROTATION_PRIOR_RAD = np.pi
POSITION_PRIOR_M = 1e3
VELOCITY_PRIOR_MPS = 1e3


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class SmoothingProblem:
    """All that a solver is given.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
        Keyframes.
    start : States
        Where the search starts; its constants are those of ``constants.start``.
    motion : Motion
    measurements : tuple of Measurement
    constants : Constants
    attitude_known : ndarray of bool, shape (n,)
        Keyframes whose ``start`` holds an attitude measured there; a window starts the others where
        the motion leads.
    """

    t_s: FloatArray
    start: States
    motion: Motion
    measurements: tuple[Measurement, ...]
    constants: Constants
    attitude_known: BoolArray

    @property
    def width(self) -> int:
        """Dimensions of one keyframe's tangent, D."""
        return self.start.width


def pose_prior_sigma() -> FloatArray:
    """Return the 1-sigma of pose and velocity before the first keyframe, (9,).

    About the pose where the search starts; velocity about zero.
    """
    return np.repeat([ROTATION_PRIOR_RAD, POSITION_PRIOR_M, VELOCITY_PRIOR_MPS], 3)
