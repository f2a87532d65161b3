"""The compiled parts of ``fgnav_models.trust_features``."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.integers.ils.array_model import LinkArrays
from fgnav.kernels.compiled import inner, kernel
from fgnav_models.trust_fit import Fit, Links, least_squares, log_odds, mixture

LINK_FEATURES, CANDIDATE_FEATURES, EPOCH_FEATURES = 15, 13, 8
LARGEST = 30.0  # of whitened residuals and of differences of costs and log weights
NOMINAL_PHASE_M, NOMINAL_CODE_M = 0.003, 1.0


class Proposed(NamedTuple):
    """The arrays of ``Candidates`` a kernel reads."""

    epoch: IntArray
    cycles: IntArray
    baselines_n_m: FloatArray
    cost: FloatArray
    log_volume: FloatArray


@kernel
def links_of_epochs(resolvable: BoolArray, of_reference: IntArray) -> BoolArray:
    """Return the undifferenced links, (n, b + 1, m), behind resolvable double differences."""
    n, b, m = resolvable.shape
    out = np.zeros((n, b + 1, m), dtype=np.bool_)
    for k in range(n):
        for i in range(b):
            for j in range(m):
                if resolvable[k, i, j]:
                    reference = of_reference[k, j]
                    out[k, i + 1, j] = out[k, i + 1, reference] = True
                    out[k, 0, j] = out[k, 0, reference] = True
    return out


@kernel
def slots(links: BoolArray) -> IntArray:
    """Return the places of links in a row, (n, l); -1 beyond the last."""
    n, a, m = links.shape
    length = 1
    for k in range(n):
        length = max(length, int(np.count_nonzero(links[k])))
    out = np.full((n, length), -1)
    for k in range(n):
        s = 0
        for i in range(a):
            for j in range(m):
                if links[k, i, j]:
                    out[k, s] = i * m + j
                    s += 1
    return out


@kernel
def candidate_rows(
    epochs: LinkArrays,
    sine: FloatArray,
    group: IntArray,
    found: Proposed,
    slot: IntArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return features of links, (c, l, f), which count, (c, l), and of candidates, (c, f)."""
    count, length = len(found.epoch), slot.shape[1]
    out = np.zeros((count, length, LINK_FEATURES), dtype=np.float32)
    is_present = np.zeros((count, length), dtype=np.float32)
    own = np.zeros((count, CANDIDATE_FEATURES), dtype=np.float32)
    log_mixture = np.zeros(count)
    for r in range(count):
        k = found.epoch[r]
        number = 0
        while number < length and slot[k, number] >= 0:
            is_present[r, number] = 1.0
            number += 1
        places = slot[k, :number]
        links, used = _links_of(epochs, group, found, r, places)
        value_m = _values_m(epochs, found, r, places)
        fit = least_squares(value_m, links)
        worse = np.zeros(len(places))
        robust, density = mixture(value_m, links, fit, worse)
        log_mixture[r] = density - 0.5 * robust.log_determinant
        white = _whitened(fit, links)
        _link_features(white, _whitened(robust, links), worse, links, out[r])
        for s in range(len(places)):
            out[r, s, 8] = sine[k, used[links.channel[s]]]
        degrees = max(2.0 * np.count_nonzero(epochs.resolvable[k]) - 3.0, 1.0)
        _fit_features(white, fit, robust, density, worse, degrees, own[r])
        _cost_features(found.cost[r], found.log_volume[r], degrees, own[r])
    _beside_others(found, log_mixture, own)
    return out, is_present, own


@inner
def _links_of(
    epochs: LinkArrays, group: IntArray, found: Proposed, r: int, places: IntArray
) -> tuple[Links, IntArray]:
    """Return the links of a candidate, and the channels behind those counted anew."""
    k, m, groups = found.epoch[r], len(group), group.max() + 1
    antenna, channel = np.empty(len(places), np.int64), np.empty(len(places), np.int64)
    arm = np.zeros((len(places), 3))
    antennas, channels = 0, 0
    renumbered = np.full(m, -1)
    of_antenna = np.full((found.cycles.shape[1] + 1, groups), -1)
    for s in range(len(places)):
        i, j = places[s] // m, places[s] % m
        if renumbered[j] < 0:
            renumbered[j] = channels
            channels += 1
        if of_antenna[i, group[j]] < 0:
            of_antenna[i, group[j]] = antennas
            antennas += 1
        antenna[s], channel[s] = of_antenna[i, group[j]], renumbered[j]
        if i > 0:
            e, b = epochs.e_n[k, j], found.baselines_n_m[r, i - 1]
            for c in range(3):
                d, f = (c + 1) % 3, (c + 2) % 3
                arm[s, c] = b[f] * e[d] - b[d] * e[f]
    used = np.empty(channels, np.int64)
    variance_m2 = np.empty((2, channels))
    for j in range(m):
        if renumbered[j] >= 0:
            used[renumbered[j]] = j
            variance_m2[0, renumbered[j]] = epochs.phase_variance_m2[k, j]
            variance_m2[1, renumbered[j]] = epochs.code_variance_m2[k, j]
    return Links(antenna, channel, arm, variance_m2, log_odds(variance_m2), antennas), used


@inner
def _values_m(epochs: LinkArrays, found: Proposed, r: int, places: IntArray) -> FloatArray:
    """Return phase and code less the candidate's ranges, (2, l); 0 at references."""
    k, m = found.epoch[r], epochs.e_n.shape[1]
    out = np.zeros((2, len(places)))
    for s in range(len(places)):
        i, j = places[s] // m - 1, places[s] % m
        if i < 0 or not epochs.resolvable[k, i, j]:
            continue
        reference = epochs.of_reference[k, j]
        range_m = 0.0
        for c in range(3):
            apart = epochs.e_n[k, j, c] - epochs.e_n[k, reference, c]
            range_m -= apart * found.baselines_n_m[r, i, c]
        whole_m = epochs.wavelength_m[j] * found.cycles[r, i, j]
        out[0, s] = epochs.phase_m[k, i, j] - whole_m - range_m
        out[1, s] = epochs.code_m[k, i, j] - range_m
    return out


@inner
def _whitened(fit: Fit, links: Links) -> FloatArray:
    out = np.empty(fit.residual_m.shape)
    for s in range(2):
        for i in range(len(links.channel)):
            out[s, i] = fit.residual_m[s, i] / np.sqrt(links.variance_m2[s, links.channel[i]])
    return out


@inner
def _link_features(
    white: FloatArray, robust: FloatArray, worse: FloatArray, links: Links, out: FloatArray
) -> None:
    """Write all features of links but the sine of the elevation."""
    m = links.variance_m2.shape[1]
    of_antenna, of_channel = np.zeros((links.antennas, 3)), np.zeros((m, 3))
    for i in range(len(worse)):
        for own in (of_antenna[links.antenna[i]], of_channel[links.channel[i]]):
            own[0] += white[0, i] ** 2
            own[1] += white[1, i] ** 2
            own[2] += 1.0
    for i in range(len(worse)):
        f = out[i]
        antenna, channel = of_antenna[links.antenna[i]], of_channel[links.channel[i]]
        for s in range(2):
            f[2 * s] = min(abs(white[s, i]), LARGEST)
            f[2 * s + 1] = np.log1p(white[s, i] ** 2)
            f[4 + s] = np.log1p(antenna[s] / antenna[2])
            f[6 + s] = np.log1p(channel[s] / channel[2])
            f[12 + s] = np.log1p(robust[s, i] ** 2)
        f[9] = 0.5 * np.log(links.variance_m2[0, links.channel[i]] / NOMINAL_PHASE_M**2)
        f[10] = 0.5 * np.log(links.variance_m2[1, links.channel[i]] / NOMINAL_CODE_M**2)
        f[11] = np.sqrt((1.0 - 1.0 / channel[2]) * (1.0 - 1.0 / antenna[2]))
        f[14] = worse[i]


@inner
def _fit_features(
    white: FloatArray,
    fit: Fit,
    robust: Fit,
    density: float,
    worse: FloatArray,
    degrees: float,
    own: FloatArray,
) -> None:
    own[4] = np.log1p(np.sum(white[0] ** 2) / degrees)
    own[5] = np.log1p(np.sum(white[1] ** 2) / degrees)
    own[9] = np.log1p(-2.0 * density / degrees)
    own[10] = np.sum(worse) / len(worse)
    own[11] = (robust.log_determinant - fit.log_determinant) / 5.0


@inner
def _cost_features(cost: float, log_volume: float, degrees: float, own: FloatArray) -> None:
    own[2] = np.log1p(cost / degrees)
    own[3] = np.arcsinh((cost - degrees) / np.sqrt(2.0 * degrees))
    own[8] = log_volume / 5.0


@inner
def _beside_others(found: Proposed, log_mixture: FloatArray, own: FloatArray) -> None:
    """Write log posteriors of Gaussian and mixture, and how much dearer than others."""
    count = len(found.epoch)
    start = 0
    while start < count:
        end = start
        gauss, mixed = -np.inf, -np.inf
        while end < count and found.epoch[end] == found.epoch[start]:
            weight = found.log_volume[end] - 0.5 * found.cost[end]
            gauss, mixed = np.logaddexp(gauss, weight), np.logaddexp(mixed, log_mixture[end])
            end += 1
        for r in range(start, end):
            weight = found.log_volume[r] - 0.5 * found.cost[r]
            gap = found.cost[r + 1] - found.cost[r] if r + 1 < end else LARGEST
            own[r, 0] = max(log_mixture[r] - mixed, -LARGEST)
            own[r, 1] = max(weight - gauss, -LARGEST)
            own[r, 6] = min(found.cost[r] - found.cost[start], LARGEST) / 10.0
            own[r, 7] = min(gap, LARGEST) / 10.0
            own[r, 12] = np.log(end - start)
        start = end


@kernel
def epoch_features(
    epochs: LinkArrays,
    baselines_b_m: FloatArray,
    proven: BoolArray,
    groups: IntArray,
    links: BoolArray,
) -> FloatArray:
    """Return figures of epochs, (n, f)."""
    n, a, m = links.shape
    out = np.zeros((n, EPOCH_FEATURES), dtype=np.float32)
    size_m = 1e-3
    for i in range(len(baselines_b_m)):
        size_m = max(size_m, np.sqrt(np.sum(baselines_b_m[i] ** 2)))
    for k in range(n):
        antennas, channels, phase_m2, code_m2 = 0, 0, np.inf, np.inf
        for i in range(a):
            antennas += links[k, i].any()
        for j in range(m):
            if links[k, :, j].any():
                channels += 1
                phase_m2 = min(phase_m2, epochs.phase_variance_m2[k, j])
                code_m2 = min(code_m2, epochs.code_variance_m2[k, j])
        if channels == 0:
            continue
        out[k, 0] = antennas / 8.0
        out[k, 1] = channels / 8.0
        out[k, 2] = np.log(max(int(np.count_nonzero(epochs.resolvable[k])), 1))
        out[k, 3] = 0.5 * np.log(phase_m2 / NOMINAL_PHASE_M**2)
        out[k, 4] = 0.5 * np.log(code_m2 / NOMINAL_CODE_M**2)
        out[k, 5] = np.log(size_m)
        out[k, 6] = proven[k]
        out[k, 7] = groups[k]
    return out


@kernel
def posteriors_of(
    score: FloatArray, none: FloatArray, epoch: IntArray, epochs: int
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return what ``fgnav_models.trust_features.probabilities`` does."""
    probability, of_none = np.zeros(len(epoch)), np.ones(epochs)
    best = np.full(epochs, -1)
    start = 0
    while start < len(epoch):
        end, k, top = start, epoch[start], start
        largest = none[start]
        while end < len(epoch) and epoch[end] == k:
            largest = max(largest, score[end])
            if score[end] >= score[top]:
                top = end
            end += 1
        of_none[k] = np.exp(none[start] - largest)
        total = of_none[k]
        for r in range(start, end):
            probability[r] = np.exp(score[r] - largest)
            total += probability[r]
        of_none[k] /= total
        for r in range(start, end):
            probability[r] /= total
        best[k] = top
        start = end
    return probability, of_none, best
