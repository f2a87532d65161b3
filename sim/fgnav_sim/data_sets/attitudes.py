"""Attitudes of the bodies of a data set."""

from typing import Literal, TypeAlias

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry.rotations import from_euler
from fgnav.io.strict_toml import Table
from fgnav_sim.motion import Command, Hold


class UniformAttitudes(Table, frozen=True, tag="uniform", tag_field="kind"):
    """Any attitude with the same likelihood, for each epoch or kept during a run."""

    each: Literal["epoch", "run"] = "epoch"

    def __call__(
        self, t_run_s: FloatArray, run: IntArray, *, rng: np.random.Generator
    ) -> FloatArray:
        """Return R_nb, (n, 3, 3), of epochs at times since their run's start, (n,)."""
        if self.each == "epoch":
            return uniform_rotations(len(t_run_s), rng=rng)
        return uniform_rotations(int(run.max(initial=0)) + 1, rng=rng)[run]


class CommandedAttitudes(Table, frozen=True, tag="commanded", tag_field="kind"):
    """Commands of the Euler angles in the time since the run's start: holds, ramps, sines, rates.

    The same for all runs, so a network can learn the answer by the time of day alone: the leak to
    be shown. With ``spread`` each run's commands start from an attitude of its own, any with the
    same likelihood.
    """

    roll: Command = Hold()
    pitch: Command = Hold()
    yaw: Command = Hold()
    spread: bool = False

    def __call__(
        self, t_run_s: FloatArray, run: IntArray, *, rng: np.random.Generator
    ) -> FloatArray:
        """Return R_nb, (n, 3, 3), of epochs at times since their run's start, (n,)."""
        distinct_s, epoch = np.unique(t_run_s, return_inverse=True)
        angles = (command(distinct_s)[0] for command in (self.roll, self.pitch, self.yaw))
        R_nb = from_euler(*angles)[epoch]
        if not self.spread:
            return np.asarray(R_nb)
        return np.asarray(uniform_rotations(int(run.max(initial=0)) + 1, rng=rng)[run] @ R_nb)


Attitudes: TypeAlias = UniformAttitudes | CommandedAttitudes


def uniform_rotations(count: int, *, rng: np.random.Generator) -> FloatArray:
    """Return rotations of which every one is as likely as any other, (count, 3, 3).

    Four normal variates point anywhere on the sphere of unit quaternions alike.
    """
    wxyz = rng.standard_normal((4, count))
    w, x, y, z = wxyz / np.linalg.norm(wxyz, axis=0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.ascontiguousarray(np.moveaxis(np.array(rows), -1, 0))
