"""Arrays of measurements checked once, and states as the kernels read them."""

import numpy as np

from fgnav.checks import IntArray, frozen
from fgnav.graph.types.states import States

Shape = tuple[int | None, ...]


def freeze(measurement: object, shapes: dict[str, Shape], counts: dict[str, Shape]) -> None:
    """Replace fields of a frozen measurement by checked, contiguous, read-only copies.

    Parameters
    ----------
    measurement : object
        Its ``name`` stands in the error text.
    shapes, counts : dict of str to shape
        Of its float and of its integer fields.

    Raises
    ------
    BadInputError
        If a shape differs or a value is not finite.
    """
    name = getattr(measurement, "name", type(measurement).__name__)
    for fields, dtype in ((shapes, float), (counts, int)):
        for field, shape in fields.items():
            value = frozen(f"{name} {field}", getattr(measurement, field), shape, dtype=dtype)
            object.__setattr__(measurement, field, value)


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
