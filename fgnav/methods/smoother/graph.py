"""Keyframes as a factor graph: X pose, V velocity, B bias slot, L(0) the landmark.

The graph of a flight is a chain of links: what a keyframe measured, and how the body came to it
from the keyframe before. ``links`` says the same to faster kernels, tested against these factors.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

import gtsam
import numpy as np
from gtsam.symbol_shorthand import B, L, V, X

from fgnav.checks import FloatArray, IntArray
from fgnav.methods.smoother import factors
from fgnav.methods.smoother.chain import STATE, Chain
from fgnav.methods.smoother.constants import LANDMARK
from fgnav.methods.smoother.keyframes import (
    POSITION_PRIOR_M,
    ROTATION_PRIOR_RAD,
    VELOCITY_PRIOR_MPS,
    Keyframes,
    there,
)
from fgnav.methods.smoother.motion_factor import preintegrated

_LANDMARK = 3  # dimensions


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class State:
    """One keyframe's state: pose, velocity (3,) and slot (6,)."""

    pose: gtsam.Pose3
    v_n_mps: FloatArray
    slot: FloatArray

    @classmethod
    def start(cls, keyframes: Keyframes, row: int) -> "State":
        """Return where the search for a keyframe's state starts."""
        pose = gtsam.Pose3(gtsam.Rot3(keyframes.R_nb[row]), keyframes.p_n_m[row])
        return cls(pose=pose, v_n_mps=keyframes.v_n_mps[row], slot=keyframes.slot[row])

    def insert(self, values: gtsam.Values, key: int) -> None:
        """Add the state to the values, or put it in place of the one that was there."""
        values.insert_or_assign(X(key), self.pose)
        values.insert_or_assign(V(key), self.v_n_mps)
        values.insert_or_assign(B(key), as_bias(self.slot))


def link(
    keyframes: Keyframes, row: int, before: Iterable[gtsam.NonlinearFactor], key: int | None = None
) -> gtsam.NonlinearFactorGraph:
    """Return what enters with a keyframe: its measurements, and the motion or priors before it.

    Parameters
    ----------
    keyframes : Keyframes
    row : int
        Which of them.
    before : factors
        ``priors`` of the first keyframe, the ``motion`` to any other.
    key : int, optional
        The keyframe's number in the graph; its row by default.
    """
    graph = gtsam.NonlinearFactorGraph()
    for factor in chain(before, measured(keyframes, row, row if key is None else key)):
        graph.add(factor)
    return graph


def measured(keyframes: Keyframes, row: int, key: int) -> Iterator[gtsam.NonlinearFactor]:
    """Yield the factors of one keyframe's own measurements."""
    array = keyframes.array
    if array.there[row]:
        yield factors.rotation_form(X(key), array.root[row], array.minimum[row])
    p, v = keyframes.position, keyframes.velocity
    if p is not None and there(p.value, row):
        white = p.white(np.array([row]))[0]
        yield factors.antenna_position(X(key), p.value[row], white, p.arm_b_m)
    if v is not None and there(v.value, row):
        yield factors.velocity(V(key), v.value[row], v.white(np.array([row]))[0])
    g, sight = keyframes.gravity, keyframes.sight
    if g is not None and there(g.e_b, row):
        down_n = keyframes.gravity_n_mps2[row]
        yield factors.direction(X(key), down_n, g.e_b[row], g.across_b[row])
    if sight is not None and there(sight.e_b, row):
        yield factors.bearing(X(key), L(0), sight.e_b[row], sight.across_b[row])


def priors(keyframes: Keyframes) -> tuple[gtsam.NonlinearFactor, ...]:
    """Return what is known before the flight: the slot's size, and next to nothing of the rest."""
    sigma = gtsam.noiseModel.Diagonal.Sigmas
    loose = np.repeat([ROTATION_PRIOR_RAD, POSITION_PRIOR_M], 3)
    # The slot's own start is told from the data and must not be used twice: its mean is zero.
    found = [
        gtsam.PriorFactorPose3(X(0), State.start(keyframes, 0).pose, sigma(loose)),
        gtsam.PriorFactorVector(V(0), np.zeros(3), sigma(np.full(3, VELOCITY_PRIOR_MPS))),
        gtsam.PriorFactorConstantBias(
            B(0), gtsam.imuBias.ConstantBias(), sigma(keyframes.slot_sigma)
        ),
    ]
    if keyframes.landmark_n_m is not None:
        near = gtsam.noiseModel.Gaussian.Covariance(keyframes.shared[LANDMARK].covariance)
        found.append(gtsam.PriorFactorPoint3(L(0), keyframes.landmark_n_m, near))
    return tuple(found)


def motion(keyframes: Keyframes, row: int, slot: FloatArray, key: int) -> gtsam.CombinedImuFactor:
    """Return the factor to a keyframe from the one before, preintegrated about a slot, (6,)."""
    pim = preintegrated(keyframes.preintegrate, row - 1, as_bias(slot))
    return gtsam.CombinedImuFactor(X(key - 1), V(key - 1), X(key), V(key), B(key - 1), B(key), pim)


def enter(
    into: Chain, k: int, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, *, first: bool
) -> float:
    """Linearise a link into row k of a chain; return twice its cost."""
    augmented = graph.linearize(values).augmentedHessian()
    seen = len(augmented) != (STATE if first else 2 * STATE) + 1
    into.enter(k, augmented.T, _PLACES[first, seen, into.border])  # symmetric: rows are columns
    return float(augmented[-1, -1])


def _places(*, first: bool, seen: bool, width: int) -> IntArray:
    """Return where GTSAM's rows, by key (B L V X), stand in a link of the chain."""
    blocks = {"b": (9, 6), "v": (6, 3), "x": (0, 6)}
    found: list[int] = []
    for name in "blvx":
        if name == "l":
            found += range(2 * STATE, 2 * STATE + width) if seen else ()
            continue
        start, size = blocks[name]
        for state in (STATE,) if first else (0, STATE):
            found += range(state + start, state + start + size)
    return np.array([*found, 2 * STATE + width])


_PLACES = {
    (first, seen, width): _places(first=first, seen=seen, width=width)
    for first in (False, True)
    for width in (0, _LANDMARK)
    for seen in (False, True)
}


def as_bias(slot: FloatArray) -> gtsam.imuBias.ConstantBias:
    """Return a slot, (6,), as GTSAM's type."""
    return gtsam.imuBias.ConstantBias(slot[:3], slot[3:])
