"""The compiled parts of ``fgnav_models.trust_features``."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.integers.ils import kernel

LINK_FEATURES = 12
LARGEST = 30.0  # of whitened residuals and of differences of costs and log weights
_SWEEPS = 6  # of centring where links are missing; one is exact where none is


@kernel
def centred(
    residual: FloatArray, there: BoolArray, weight: FloatArray, group: IntArray, epoch: IntArray
) -> FloatArray:
    """Free residuals, (c, a, m), in place of what antennas and satellites could have added."""
    n, _, m = residual.shape
    groups = group.max() + 1 if m else 0
    for k in range(n):
        mask = there[k]
        complete = True
        for j in range(m):
            if mask[0, j]:
                complete = complete and mask[:, j].all()
        for _ in range(1 if complete else _SWEEPS):
            _free_of_satellites(residual[k], mask)
            _free_of_antennas(residual[k], mask, weight[epoch[k]], group, groups)
    return residual


@kernel
def _free_of_satellites(r: FloatArray, mask: BoolArray) -> None:
    """Take the mean over antennas off every channel."""
    for j in range(r.shape[1]):
        number, level = 0, 0.0
        for i in range(len(r)):
            if mask[i, j]:
                number += 1
                level += r[i, j]
        for i in range(len(r)):
            if mask[i, j]:
                r[i, j] -= level / number


@kernel
def _free_of_antennas(
    r: FloatArray, mask: BoolArray, weight: FloatArray, group: IntArray, groups: int
) -> None:
    """Take the weighted mean over a group's channels off every antenna."""
    total, mean = np.zeros(groups), np.zeros(groups)
    for i in range(len(r)):
        total[:] = 0.0
        mean[:] = 0.0
        for j in range(r.shape[1]):
            if mask[i, j]:
                total[group[j]] += weight[j]
                mean[group[j]] += weight[j] * r[i, j]
        for j in range(r.shape[1]):
            if mask[i, j]:
                r[i, j] -= mean[group[j]] / total[group[j]]


@kernel
def link_features(
    p: FloatArray,
    c: FloatArray,
    there: BoolArray,
    of_channel: FloatArray,
    slot: IntArray,
    epoch: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """Return features of links, (c, l, f), and which count, (c, l)."""
    n, a, m = p.shape
    length = slot.shape[1]
    out = np.zeros((n, length, LINK_FEATURES), dtype=np.float32)
    mask = np.zeros((n, length), dtype=np.float32)
    of_antenna, of_satellite = np.zeros((a, 3)), np.zeros((m, 3))
    for k in range(n):
        _sums(p[k], c[k], there[k], of_antenna, of_satellite)
        for s in range(length):
            place = slot[epoch[k], s]
            if place < 0:
                break
            i, j = place // m, place % m
            f = out[k, s]
            mask[k, s] = 1.0
            f[0] = min(abs(p[k, i, j]), LARGEST)
            f[1] = np.log1p(p[k, i, j] ** 2)
            f[2] = min(abs(c[k, i, j]), LARGEST)
            f[3] = np.log1p(c[k, i, j] ** 2)
            for v in range(2):
                f[4 + v] = np.log1p(of_antenna[i, v] / of_antenna[i, 2])
                f[6 + v] = np.log1p(of_satellite[j, v] / of_satellite[j, 2])
            for v in range(3):
                f[8 + v] = of_channel[epoch[k], j, v]
            f[11] = np.sqrt((1.0 - 1.0 / of_satellite[j, 2]) * (1.0 - 1.0 / of_antenna[i, 2]))
    return out, mask


@kernel
def _sums(
    p: FloatArray, c: FloatArray, mask: BoolArray, of_antenna: FloatArray, of_satellite: FloatArray
) -> None:
    """Write square sums of phase and code and the number of links, by antenna and by channel."""
    of_antenna[:] = 0.0
    of_satellite[:] = 0.0
    for i in range(p.shape[0]):
        for j in range(p.shape[1]):
            if mask[i, j]:
                for own in (of_antenna[i], of_satellite[j]):
                    own[0] += p[i, j] ** 2
                    own[1] += c[i, j] ** 2
                    own[2] += 1.0


@kernel
def beside_others(
    epoch: IntArray, cost: FloatArray, weight: FloatArray, epochs: int
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Return first row and number of rows of epochs, gap to the next dearer, log posterior."""
    first, number = np.zeros(epochs, dtype=np.int64), np.zeros(epochs)
    gap, posterior = np.full(len(epoch), LARGEST), np.zeros(len(epoch))
    total = np.full(epochs, -np.inf)
    for r in range(len(epoch)):
        k = epoch[r]
        if number[k] == 0:
            first[k] = r
        else:
            gap[r - 1] = cost[r] - cost[r - 1]
        number[k] += 1
        total[k] = np.logaddexp(total[k], weight[r])
    for r in range(len(epoch)):
        posterior[r] = weight[r] - total[epoch[r]]
    return first, number, gap, posterior
