"""States as the kernels read them."""

import numpy as np

from fgnav.checks import IntArray
from fgnav.graph.types.states import States


def contiguous(at: States, which: IntArray) -> tuple[States, IntArray]:
    """Return states and rows as arrays that the kernels are compiled for: C order and writeable.

    Any other layout is a type of its own to numba, which would compile the kernel anew.
    """
    R_nb, p_n_m, v_n_mps, aux, constants = at
    if not (
        R_nb.flags.carray  # not all(...): that takes a microsecond of the few of a single row
        and p_n_m.flags.carray
        and v_n_mps.flags.carray
        and aux.flags.carray
        and constants.flags.carray
    ):
        at = at.copied()
    return at, which if which.flags.carray else np.array(which, dtype=np.int64)
