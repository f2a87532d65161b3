"""What the kernels of a chain's links read: states, motions, measurements, prior."""

from typing import NamedTuple

from fgnav.checks import FloatArray, IntArray


class States(NamedTuple):
    """Where keyframes are linearised; constants belong to all of them."""

    R_nb: FloatArray  # (n, 3, 3)
    p_n_m: FloatArray  # (n, 3)
    v_n_mps: FloatArray  # (n, 3)
    slot: FloatArray  # (n, 6)
    constants: FloatArray  # (b,)
    columns: IntArray  # (8 + a,), where each kind of constant begins; -1 of those that are not
    baselines_b_m: FloatArray  # (a, 3), as stated; none where the array's shape is no question

    def copied(self) -> "States":
        """Return the same in memory of its own."""
        own = (self.R_nb.copy(), self.p_n_m.copy(), self.v_n_mps.copy(), self.slot.copy())
        return States(*own, self.constants.copy(), self.columns, self.baselines_b_m)


class Motions(NamedTuple):
    """How the body came to each keyframe from the one before, see ``motion_kernel``."""

    span_s: FloatArray  # (n,)
    about: FloatArray  # (n, 6), the slot it is integrated about
    gained: FloatArray  # (n, 9)
    correction: FloatArray  # (n, 9, 6)
    white: FloatArray  # (n, 15, 15)
    gravity_n_mps2: FloatArray  # (n, 3), at the keyframe before
    earth_rate_n_radps: FloatArray  # (n, 3)


class Senses(NamedTuple):
    """What keyframes measured; what weighs nothing was not there.

    Any number of positions, velocities and known directions may be told at each keyframe.
    """

    root: FloatArray  # (n, 9, 9), of the array's form
    minimum: FloatArray  # (n, 3, 3)
    floating: FloatArray  # (n,), the stretch without integers that the form is of, or -1
    position_n_m: FloatArray  # (n, k, 3)
    position_white: FloatArray  # (n, k, 3, 3)
    arm_b_m: FloatArray  # (n, k, 3)
    position_piece: FloatArray  # (n, k), the stretch that shares an offset, or -1
    rate_b_radps: FloatArray  # (n, 3), about as fast as the body turns
    shape_root: FloatArray  # (n, 3 a, 3 a), of a form of the baselines in n
    shape_minimum_n_m: FloatArray  # (n, a, 3)
    velocity_n_mps: FloatArray  # (n, k, 3)
    velocity_white: FloatArray  # (n, k, 3, 3)
    known_n: FloatArray  # (n, k, 3), unit vectors
    known_across_b: FloatArray  # (n, k, 2, 3), what whitens those measured
    sight_across_b: FloatArray  # (n, 2, 3)
    height_weight: FloatArray  # (n,), one over sigma
    height_down_n_m: FloatArray  # (n,)
    height_arm_b_m: FloatArray  # (n, 3)
    height_at: FloatArray  # (n, 2), the time of the drift before, and the share on to the next
    field_across_b: FloatArray  # (n, 2, 3)
    field_n_ut: FloatArray  # (n, 3)


class Samples(NamedTuple):
    """Inertial samples of intervals between n keyframes; see ``Increments``."""

    t_s: FloatArray  # (n,), of the keyframes
    first: IntArray
    step_s: FloatArray
    f_b_mps2: FloatArray
    w_b_radps: FloatArray
    noise: FloatArray
    gravity_n_mps2: FloatArray
    earth_rate_n_radps: FloatArray


class Prior(NamedTuple):
    """What is known before the first keyframe, of its state and of the constants."""

    R_nb: FloatArray  # (3, 3)
    p_n_m: FloatArray  # (3,)
    sigma: FloatArray  # (15,)
    constants: FloatArray  # (b,)
    constants_white: FloatArray  # (b, b), a lower triangle
