"""The unit vector nearest to a given one, in the metric of an information matrix.

The minimum is found through its secular equation [1]_: it is the global one.

References
----------
.. [1] L. Eldén, "Solving quadratically constrained least squares problems using a
   differential-geometric approach", BIT 42, 2002.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotation_kernel import scaled
from fgnav.integers.array.principal_axes import principal_axes
from fgnav.kernels.compiled import kernel

_BISECTIONS = 60


@kernel
def nearest_direction(column: FloatArray, information: FloatArray) -> FloatArray:
    """Return the unit vector; ``(information - mu) x = information column`` at the least mu."""
    values, vectors = principal_axes(information)
    weighted, x, out = np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(3):
        for j in range(3):
            weighted[i] += values[i] * vectors[j, i] * column[j]
    # |x| grows with mu from below 1 at `low` and passes 1 before the least eigenvalue, unless
    # the column has no share in that eigenvector: then the share is what is missing to length 1.
    low = values[0] - _length(weighted) - 1e-12 * values[0]
    high = values[0]
    for _ in range(_BISECTIONS):
        mu = 0.5 * (low + high)
        size = 0.0
        for i in range(3):
            size += (weighted[i] / (values[i] - mu)) ** 2
        if size > 1.0:
            high = mu
        else:
            low = mu
    for i in range(3):
        x[i] = weighted[i] / (values[i] - low)
    short = 1.0 - _length(x) ** 2
    if short > 1e-9:
        x[0] += np.copysign(np.sqrt(short + x[0] * x[0]) - abs(x[0]), x[0])
    for i in range(3):
        for j in range(3):
            out[j] += vectors[j, i] * x[i]
    return scaled(out, 1.0 / _length(out))


@kernel
def _length(v: FloatArray) -> float:
    return float(np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]))
