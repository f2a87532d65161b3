"""Inputs of the trust network: figures of candidates' residuals, whatever their number.

Residuals are those of undifferenced links, freed of whatever each antenna and each satellite of a
group could have added, as double differences are: once by least squares, once by
``fgnav_models.trust_fit``. They are pooled: per degree of freedom, and the largest of a group, an
antenna and a satellite. Nothing here knows order, number or reference of antennas and of
satellites, nor place and time.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.integers.array.candidates import Candidates
from fgnav.integers.array.kernel import PROVEN
from fgnav.integers.ils.array_model import LinkArrays, link_arrays, spans
from fgnav.kernels.compiled import kernel
from fgnav.types.differences import DoubleDifferences
from fgnav_models.trust_fit import Fit, Links, least_squares, log_odds, mixture

POSTERIOR = 0  # feature: log posterior of a candidate by the mixture, which the network corrects
OUTLIER = 0.95  # a link more likely than this to be worse than stated is not fixed
CANDIDATE_FEATURES, EPOCH_FEATURES = 22, 9
FEATURES = CANDIDATE_FEATURES + EPOCH_FEATURES
_LARGEST = 30.0  # of whitened residuals and of differences of costs and log weights
_NOMINAL_PHASE_M, _NOMINAL_CODE_M = 0.003, 1.0


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class TrustRows:
    """One row per candidate."""

    features: FloatArray  # (c, FEATURES)
    worse: FloatArray  # (c, b + 1, m): probability of links to be worse than stated


class _Proposed(NamedTuple):
    """The arrays of ``Candidates`` a kernel reads."""

    epoch: IntArray
    cycles: IntArray
    baselines_n_m: FloatArray
    cost: FloatArray
    log_volume: FloatArray


def links_of(differences: DoubleDifferences) -> BoolArray:
    """Return the undifferenced links, (n, b + 1, m), behind the resolvable double differences."""
    single = differences.resolvable.copy()
    for g, of_group in enumerate(differences.reference.T):
        answered = np.asarray(single[:, :, differences.group == g].any(axis=2))
        some = np.flatnonzero(of_group >= 0)
        single[some, :, of_group[some]] = answered[some]
    return np.concatenate([single.any(axis=1, keepdims=True), single], axis=1)


def trust_rows(differences: DoubleDifferences, candidates: Candidates) -> TrustRows:
    """Return the network's input for every candidate of the epochs.

    Parameters
    ----------
    candidates : Candidates
        Of the same differences.
    """
    links, epoch = links_of(differences), candidates.epoch
    arguments = (candidates.cycles, candidates.baselines_n_m, candidates.cost)
    proposed = _Proposed(epoch, *arguments, candidates.log_volume)
    count = len(epoch)
    worse = np.zeros((count, *links.shape[1:]), dtype=np.float32)
    features = np.zeros((count, CANDIDATE_FEATURES), dtype=np.float32)
    _candidate_features(
        link_arrays(differences), differences.group, links, proposed, worse, features
    )
    of_epoch = _epoch_features(differences, links, candidates.status == PROVEN)
    return TrustRows(features=np.hstack([features, of_epoch[epoch]]), worse=worse)


def _epoch_features(
    differences: DoubleDifferences, links: BoolArray, proven: BoolArray
) -> FloatArray:
    """Return figures of epochs, (n, EPOCH_FEATURES)."""
    used = links.any(axis=1)
    has_links = np.asarray(links[:, 1:].any(axis=2))
    arrays = spans(differences.baselines_b_m, has_links)
    size_m = np.linalg.norm(differences.baselines_b_m, axis=1)
    sigmas = [
        0.5 * np.log(np.where(used, variance, np.inf).min(axis=1, initial=1e6) / nominal_m**2)
        for variance, nominal_m in (
            (differences.phase_variance_m2, _NOMINAL_PHASE_M),
            (differences.code_variance_m2, _NOMINAL_CODE_M),
        )
    ]
    columns = (
        links.any(axis=2).sum(axis=1) / 8.0,
        np.log1p(used.sum(axis=1)),
        np.log1p(differences.resolvable.sum(axis=(1, 2))),
        np.log1p((differences.reference >= 0).sum(axis=1)),
        *sigmas,
        np.log(np.where(has_links, size_m, 1e-3).max(axis=1)),
        arrays.rank[arrays.pattern],
        proven,
    )
    return np.stack(columns, axis=1).astype(np.float32)


@kernel
def _candidate_features(
    epochs: LinkArrays,
    group: IntArray,
    present: BoolArray,
    proposed: _Proposed,
    worse: FloatArray,
    out: FloatArray,
) -> None:
    """Write probabilities of links, (c, b + 1, m), and features of candidates, (c, f)."""
    count = len(proposed.epoch)
    log_mixture = np.zeros(count)
    for r in range(count):
        k = proposed.epoch[r]
        links = _links(epochs, group, present[k], proposed, r)
        value_m = _values_m(epochs, present[k], proposed, r)
        probability = np.zeros(present[k].shape)
        fit = least_squares(value_m, links)
        robust, density = mixture(value_m, links, fit, probability)
        log_mixture[r] = density - 0.5 * robust.log_determinant
        worse[r] = probability
        degrees = max(2.0 * np.count_nonzero(epochs.resolvable[k]) - 3.0, 1.0)
        f = out[r]
        f[2] = np.log1p(proposed.cost[r] / degrees)
        f[3] = np.arcsinh((proposed.cost[r] - degrees) / np.sqrt(2.0 * degrees))
        f[4] = np.log1p(-2.0 * density / degrees)
        f[5] = (robust.log_determinant - fit.log_determinant) / 5.0
        f[6] = proposed.log_volume[r] / 5.0
        _exclusion_features(probability, links, degrees, f[7:11])
        _pooled_features(fit, links, f[11:16])
        f[16] = _largest(robust, links)
    _compare(proposed, log_mixture, out)


@kernel
def _links(
    epochs: LinkArrays, group: IntArray, present: BoolArray, proposed: _Proposed, r: int
) -> Links:
    """Return the links of a candidate."""
    k, (a, m) = proposed.epoch[r], present.shape
    arm, variance_m2 = np.zeros((a, m, 3)), np.empty((2, m))
    for j in range(m):
        variance_m2[0, j] = epochs.phase_variance_m2[k, j]
        variance_m2[1, j] = epochs.code_variance_m2[k, j]
        for i in range(1, a):
            e, b = epochs.e_n[k, j], proposed.baselines_n_m[r, i - 1]
            for c in range(3):
                d, f = (c + 1) % 3, (c + 2) % 3
                arm[i, j, c] = b[f] * e[d] - b[d] * e[f]
    return Links(present, group, arm, variance_m2, log_odds(variance_m2))


@kernel
def _values_m(epochs: LinkArrays, present: BoolArray, proposed: _Proposed, r: int) -> FloatArray:
    """Return phase and code less the candidate's ranges, (2, a, m); 0 at references."""
    k, (a, m) = proposed.epoch[r], present.shape
    out = np.zeros((2, a, m))
    for i in range(a - 1):
        for j in range(m):
            if not epochs.resolvable[k, i, j]:
                continue
            reference = epochs.of_reference[k, j]
            range_m = 0.0
            for c in range(3):
                apart = epochs.e_n[k, j, c] - epochs.e_n[k, reference, c]
                range_m -= apart * proposed.baselines_n_m[r, i, c]
            cycles_m = epochs.wavelength_m[j] * proposed.cycles[r, i, j]
            out[0, i + 1, j] = epochs.phase_m[k, i, j] - cycles_m - range_m
            out[1, i + 1, j] = epochs.code_m[k, i, j] - range_m
    return out


@kernel
def _exclusion_features(worse: FloatArray, links: Links, degrees: float, out: FloatArray) -> None:
    """Write how many links are worse, the likeliest one, and what is left without them."""
    count = np.count_nonzero(links.is_present)
    total = worse.sum()
    out[0] = total / count
    out[1] = worse.max()
    out[2] = np.sum(worse * (1.0 - worse))
    out[3] = np.log(max(degrees - 2.0 * total, 0.5))


@kernel
def _pooled_features(fit: Fit, links: Links, out: FloatArray) -> None:
    """Write mean squares of whitened residuals: of phase, of code, and the largest of pools."""
    a, m = links.is_present.shape
    groups = links.group.max() + 1
    kinds, antenna = np.zeros((2, 2)), np.zeros((a, 2))
    satellite, of_group = np.zeros((m, 2)), np.zeros((groups, 2))
    for s in range(2):
        for i in range(a):
            for j in range(m):
                if links.is_present[i, j]:
                    square = fit.residual_m[s, i, j] ** 2 / links.variance_m2[s, j]
                    for pool in (kinds[s], antenna[i], satellite[j], of_group[links.group[j]]):
                        pool[0] += square
                        pool[1] += 1.0
    for s in range(2):
        out[s] = np.log1p(kinds[s, 0] / kinds[s, 1])
    out[2], out[3], out[4] = _most(of_group), _most(antenna), _most(satellite)


@kernel
def _most(pools: FloatArray) -> float:
    """Return the logarithm of one and the largest mean of pools, sum and number, (p, 2)."""
    most = 0.0
    for p in range(len(pools)):
        if pools[p, 1] > 0.0:
            most = max(most, pools[p, 0] / pools[p, 1])
    return np.log1p(most)  # type: ignore[no-any-return]


@kernel
def _largest(fit: Fit, links: Links) -> float:
    """Return the logarithm of the largest whitened phase residual."""
    most = 0.0
    for i in range(links.is_present.shape[0]):
        for j in range(links.is_present.shape[1]):
            most = max(most, abs(fit.residual_m[0, i, j]) / np.sqrt(links.variance_m2[0, j]))
    return np.log1p(most)  # type: ignore[no-any-return]


@kernel
def _compare(proposed: _Proposed, log_mixture: FloatArray, out: FloatArray) -> None:
    """Write log posteriors of Gaussian and mixture, and how far the other candidates are."""
    count, start = len(proposed.epoch), 0
    while start < count:
        end = start
        gauss, mixed = -np.inf, -np.inf
        while end < count and proposed.epoch[end] == proposed.epoch[start]:
            weight = proposed.log_volume[end] - 0.5 * proposed.cost[end]
            gauss, mixed = np.logaddexp(gauss, weight), np.logaddexp(mixed, log_mixture[end])
            end += 1
        for r in range(start, end):
            weight, f = proposed.log_volume[r] - 0.5 * proposed.cost[r], out[r]
            gap = proposed.cost[r + 1] - proposed.cost[r] if r + 1 < end else _LARGEST
            rival = -np.inf
            for q in range(start, end):
                if q != r:
                    rival = max(rival, log_mixture[q])
            f[0] = max(log_mixture[r] - mixed, -_LARGEST)
            f[1] = max(weight - gauss, -_LARGEST)
            f[17] = min(proposed.cost[r] - proposed.cost[start], _LARGEST) / 10.0
            f[18] = min(gap, _LARGEST) / 10.0
            f[19] = np.log(end - start)
            f[20] = min(max(log_mixture[r] - rival, -_LARGEST), _LARGEST) / 10.0
            # what is not listed costs no less than the dearest that is
            f[21] = min(proposed.cost[end - 1] - proposed.cost[start], _LARGEST) / 10.0
        start = end
