"""A measurement in axes that are turned against those of the states, the inertial unit's.

``R_n,other = R_nb Exp(c)``, c a constant of the flight: a measurement of the pose is one of the
same place with that attitude. Its derivative by c is that by a turn of the state,
carried to the end of c.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import IntArray
from fgnav.geometry import rotation_kernel as rot
from fgnav.graph.measurement_factor import Use, of_measurement, parts_of
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.measurement import Linearised, Measurement, OfAnother
from fgnav.graph.types.states import AUX, POSITION, ROTATION, States
from fgnav.optional_gtsam import gtsam

ARRAY_TURN, UNIT_TURN = "array turn", "unit turn"  # of the array alone; of all but the unit
# 1-sigma to which either is put into a body: 4 mm on a metre. What stays of velocities under a sky
# that the body hides as it rolls is as much (scenario rough: 0.3 to 0.8 degree of right flights).
MOUNTED_RAD = float(np.radians(0.2))
_ARRAY = ("array phases",)
_LASTING = 9  # most that a keyframe's vector ends in of phases that err lastingly: by elements
DIRECTIONS = ("line of sight", "magnetic field", "gravity")  # of other sensors fixed to the body


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Turned(OfAnother):
    """Measurements of states whose attitude is turned by a constant.

    Attributes
    ----------
    measurement : Measurement
    column : int
        First of the three constants c.
    constants : Constants
    """

    column: int

    def linearise(self, at: States, which: IntArray) -> Linearised:
        """Return whitened residuals of some, (j,), see ``Measurement``."""
        columns = slice(self.column, self.column + 3)
        angle = np.ascontiguousarray(at.constants[columns])
        R = rot.exp(angle)
        value, state, shared = self.measurement.linearise(at._replace(R_nb=at.R_nb @ R), which)
        state, shared = state.copy(), shared.copy()
        shared[:, :, columns] += state[:, :, ROTATION] @ rot.right_jacobian(angle)
        for tangent in (ROTATION, POSITION):  # both in the state's own axes
            state[:, :, tangent] = state[:, :, tangent] @ R.T
        return Linearised(value, state, shared)

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return measurement i as a factor of keyframe ``key``."""
        _, state, shared = self.linearise(_anywhere(self.constants), np.array([i]))
        inner = np.flatnonzero(shared[0].any(axis=0)).tolist()
        parts = parts_of(self.constants, (self.column, *inner))
        lasting: tuple[Use, ...] = ("angular_motion",) if state[0, :, AUX:].any() else ()
        return of_measurement(self, i, key, ("pose", *lasting), parts, rows=shared.shape[1])


def _anywhere(constants: Constants) -> States:
    """Return a state at which an inner measurement shows what it depends on."""
    zeros, ones = np.zeros((1, 3)), np.ones(constants.width)
    R_nb = rot.exp(np.array([0.3, -0.2, 0.1]))[None]
    return States(R_nb, zeros, zeros, np.zeros((1, _LASTING)), ones)


def in_turned_axes(measurement: Measurement, constants: Constants) -> Measurement:
    """Return a measurement in the axes that it is of, if the constants have a turn of them."""
    for turn, names in ((ARRAY_TURN, _ARRAY), (UNIT_TURN, (*_ARRAY, *DIRECTIONS))):
        column = constants.column(turn)
        if column >= 0 and measurement.name in names:
            return Turned(measurement=measurement, column=column, constants=constants)
    return measurement
