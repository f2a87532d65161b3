"""Which links explain the residuals of an epoch: w-tests under the known shape of the array."""

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry.rotation_kernel import product, transposed
from fgnav.integers.array.nearest import nearest, tangent, weak_axis
from fgnav.integers.array.relaxation import Relaxation, relaxation
from fgnav.integers.ils.array_model import LinkArrays, Spans, link_arrays, link_design, spans
from fgnav.integers.ils.link_weights import solved, weighed
from fgnav.kernels.compiled import inlined, inner, kernel
from fgnav.types.differences import DoubleDifferences

_UNTESTABLE = 1e-9  # of a residual's variance: nothing else checks the link


def suspects(
    differences: DoubleDifferences, cycles: IntArray, count: int
) -> tuple[IntArray, FloatArray]:
    """Return the links whose errors would explain the residuals best, the worst first.

    The square of a w-test [1]_ is what the cost falls by when the link's own error becomes an
    unknown, linearised at the best attitude; those of its code and of its phase are added.

    Parameters
    ----------
    cycles : ndarray of int64, shape (n, b, m)
        Best integers of every epoch.
    count : int
        How many to return.

    Returns
    -------
    ndarray of int64, shape (n, count)
        Antenna times m plus channel, the reference antenna being 0. Of two antennas, whose errors
        are one and the same, the second's.
    ndarray, shape (n, count)
        By how much each lowers the cost.

    References
    ----------
    .. [1] W. Baarda, "A testing procedure for use in geodetic networks", Netherlands Geodetic
       Commission 2 (5), 1968.
    """
    epochs = link_arrays(differences)
    arrays = spans(differences.baselines_b_m, np.any(epochs.resolvable, axis=2))
    explained = _explained(epochs, arrays, cycles)
    flat = explained.reshape(len(explained), -1)
    which = np.argsort(-flat, axis=1, kind="stable")[:, :count]
    return which, np.take_along_axis(flat, which, axis=1)


@kernel
def _explained(epochs: LinkArrays, arrays: Spans, cycles: IntArray) -> FloatArray:
    """Return by how much the cost falls with each link's errors unknown, (n, b + 1, m)."""
    n, b, m = epochs.phase_m.shape
    out = np.zeros((n, b + 1, m))
    for k in range(n):
        relaxed = relaxation(epochs, arrays, k)
        links = relaxed.links
        q = len(links)
        if q == 0:
            continue
        M = _attitude(relaxed, cycles[k])
        A = link_design(epochs.e_n[k], arrays.coordinates_m[arrays.pattern[k]], links, len(M))
        code_m, phase_m = np.empty(q), np.empty(q)
        for i in range(q):
            baseline, j = links[i, 0], links[i, 1]
            range_m = 0.0
            for c in range(len(M)):
                range_m += A[i, c] * M[c]
            of_cycles = epochs.wavelength_m[j] * cycles[k, baseline, j]
            code_m[i] = epochs.code_m[k, baseline, j] - range_m
            phase_m[i] = epochs.phase_m[k, baseline, j] - of_cycles - range_m
        B = product(A, tangent(M))
        variances = epochs.code_variance_m2[k], epochs.phase_variance_m2[k]
        weights = weighed(links, variances[0], variances[1], np.eye(q))
        of_code, of_phase = weights[0], weights[1]
        by_code, by_phase = product(of_code, B), product(of_phase, B)
        for i in range(q):
            for c in range(B.shape[1]):
                by_code[i, c] += by_phase[i, c]
        normal = product(transposed(B), by_code)
        attitude = solved(normal, np.eye(B.shape[1]))
        _add_tests(code_m, of_code, B, attitude, links, out[k])
        _add_tests(phase_m, of_phase, B, attitude, links, out[k])
    return out


@inlined
def _attitude(relaxed: Relaxation, cycles: IntArray) -> FloatArray:
    """Return the columns that given integers lead to."""
    columns = relaxed.columns.copy()
    for i in range(len(relaxed.links)):
        gap = relaxed.cycles[i] - cycles[relaxed.links[i, 0], relaxed.links[i, 1]]
        for c in range(len(columns)):
            columns[c] += relaxed.gain[c, i] * gap
    return nearest(columns, relaxed.information, weak_axis(relaxed.information, np.inf))[1]


@inner
def _add_tests(
    residual_m: FloatArray,
    weight: FloatArray,
    B: FloatArray,
    attitude: FloatArray,
    links: IntArray,
    out: FloatArray,
) -> None:
    """Add the squared w-tests of one kind of measurement."""
    q = len(links)
    by_attitude = product(weight, B)
    certain = weight - product(by_attitude, product(attitude, transposed(by_attitude)))
    weighted = product(weight, residual_m.reshape(q, 1))
    moved = np.empty(q)
    first = 1 if len(out) == 2 else 0
    for a in range(first, len(out)):
        for j in range(out.shape[1]):
            pull = 0.0
            for i in range(q):
                moved[i] = _share(a, j, links[i])
                pull += moved[i] * weighted[i, 0]
            known, alone = 0.0, 0.0
            for i in range(q):
                if moved[i] != 0.0:
                    for c in range(q):
                        known += moved[i] * certain[i, c] * moved[c]
                        alone += moved[i] * weight[i, c] * moved[c]
            if known > _UNTESTABLE * alone:
                out[a, j] += pull * pull / known


@inner
def _share(antenna: int, channel: int, link: IntArray) -> float:
    """Return how an error of one antenna's channel enters a double difference: -1, 0 or 1."""
    if channel not in (link[1], link[2]):
        return 0.0
    of_channel = 1.0 if link[1] == channel else -1.0
    if antenna == 0:
        return -of_channel
    return of_channel if link[0] + 1 == antenna else 0.0
