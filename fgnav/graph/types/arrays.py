"""Shapes of arrays, and states as the kernels read them."""

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav.graph.types.states import States
from fgnav.kernels.compiled import kernel


def check_shapes(owner: str, item: object, shapes: dict[str, tuple[int, ...]]) -> None:
    """Raise BadInputError if a field has another shape; one that is None has none."""
    for name, shape in shapes.items():
        value = getattr(item, name)
        if value is not None and value.shape != shape:
            raise BadInputError(f"{owner} {name}: expected shape {shape}, got {value.shape}")


def contiguous(at: States, indices: IntArray) -> tuple[States, IntArray]:
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
    return at, indices if indices.flags.carray else np.array(indices, dtype=np.int64)


@kernel
def zero_rows(at: States, indices: IntArray, m: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return zeros for residuals of j measurements, (j, m), and derivatives; see ``Linearised``."""
    j, D, b = len(indices), 9 + at.aux.shape[1], len(at.constants)
    return np.zeros((j, m)), np.zeros((j, m, D)), np.zeros((j, m, b))
