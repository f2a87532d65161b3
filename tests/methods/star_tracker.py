"""A sensor that the library has not: all that it takes to bring it into the smoother."""

from dataclasses import dataclass

import gtsam
import numpy as np

from fgnav.geometry import rotations
from fgnav.graph import pose
from fgnav.graph.custom import NamedFactor, residual_factor
from fgnav.integers.resolvers.truth import attitude_at

NAME = "star tracker"
SIGMA_RAD = np.radians(30 / 3600)  # about each axis
EVERY = 10  # keyframe


@dataclass(frozen=True)
class StarTracker:
    """Attitudes at every tenth keyframe, drawn about the truth; of a real one, read from a file."""

    seed: int = 0
    native: bool = False  # GTSAM's own factor, else a residual

    def __call__(self, flight, timeline):
        """Yield one factor per attitude."""
        R_nb, _ = attitude_at(flight.truth, timeline.t_s[::EVERY])
        for i, measured in enumerate(drawn(R_nb, self.seed)):
            yield native(EVERY * i, measured) if self.native else own(EVERY * i, measured)


def drawn(R_nb, seed):
    """Return what a star tracker measures of attitudes, (n, 3, 3)."""
    noise = SIGMA_RAD * np.random.default_rng(seed).standard_normal((len(R_nb), 3))
    return R_nb @ rotations.exp(noise)


def own(k, R_nb):
    """Return a factor: the turn from the measured attitude to that of keyframe k."""

    def residual(x):
        return rotations.log((R_nb.T @ x.rotation().matrix())[None])[0]

    return residual_factor(NAME, [pose(k)], residual, SIGMA_RAD, dimension=3)


def native(k, R_nb):
    """Return the same as GTSAM has it, with a name for reports."""
    noise = gtsam.noiseModel.Isotropic.Sigma(3, SIGMA_RAD)
    return NamedFactor(NAME, gtsam.PoseRotationPrior3D(pose(k), gtsam.Rot3(R_nb), noise))
