"""What the trust network sees of integer candidates: residuals of links, and figures of the whole.

Residuals are those of undifferenced links, double-centred: freed of whatever each antenna and each
satellite of a group could have added, as double differences are. Nothing here knows order, number
or reference of antennas and satellites, nor place and time.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss.differences import DoubleDifferences
from fgnav.integers.candidates import Candidates
from fgnav.integers.constrained_search import PROVEN
from fgnav_models.trust_kernel import (
    LARGEST,
    LINK_FEATURES,
    beside_others,
    centred,
    link_features,
)

__all__ = [
    "LINK_FEATURES",
    "WHOLE_FEATURES",
    "TrustRows",
    "links_of",
    "probabilities",
    "trust_rows",
]

WHOLE_FEATURES = 18
_NOMINAL_PHASE_M, _NOMINAL_CODE_M = 0.003, 1.0
_STUDENT = 4.0  # degrees of freedom of the robust likelihood offered beside Gauss'


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class TrustRows:
    """One row per candidate.

    Attributes
    ----------
    epoch : ndarray of int64, shape (c,)
    links : ndarray of float32, shape (c, l, LINK_FEATURES)
        Links that are there, antenna by antenna; 0 beyond the last.
    there : ndarray of float32, shape (c, l)
        1 where a row of ``links`` counts.
    whole : ndarray of float32, shape (c, WHOLE_FEATURES)
        The first is the logarithm of the candidate's posterior of Gaussian noise.
    slot : ndarray of int64, shape (n, l)
        Antenna and channel of a link, ``antenna m + channel``; -1 beyond the last.
    """

    epoch: IntArray
    links: FloatArray
    there: FloatArray
    whole: FloatArray
    slot: IntArray


def links_of(differences: DoubleDifferences) -> BoolArray:
    """Return the undifferenced links, (n, b + 1, m), behind the resolvable double differences."""
    links = differences.resolvable
    of_reference = differences.reference[:, differences.group]
    out = np.zeros((len(links), links.shape[1] + 1, links.shape[2]), dtype=np.bool_)
    for g in range(differences.reference.shape[1]):
        own = differences.group == g
        some = (links & own).any(axis=2)
        references = (of_reference == np.arange(links.shape[2])) & own
        out[:, 1:] |= (links & own) | (some[:, :, None] & references[:, None])
    out[:, 0] = out[:, 1:].any(axis=1)
    return out


def trust_rows(differences: DoubleDifferences, found: Candidates) -> TrustRows:
    """Return the network's inputs for every candidate of the epochs.

    Parameters
    ----------
    differences : DoubleDifferences
    found : Candidates
        Of the same differences.
    """
    links = links_of(differences)
    slot = _slots(links)
    epoch = found.epoch
    phase_m, code_m = _residuals_m(differences, found)
    group, there = differences.group, links[epoch]
    phase_sigma_m = np.sqrt(differences.phase_variance_m2)
    code_sigma_m = np.sqrt(differences.code_variance_m2)
    p = centred(phase_m, there, 1.0 / differences.phase_variance_m2, group, epoch)
    c = centred(code_m, there, 1.0 / differences.code_variance_m2, group, epoch)
    p /= phase_sigma_m[epoch][:, None]
    c /= code_sigma_m[epoch][:, None]
    sine = np.sin(np.nan_to_num(differences.elevation_rad))
    of_channel = np.stack(
        [
            sine,
            np.log(phase_sigma_m / _NOMINAL_PHASE_M),
            np.log(code_sigma_m / _NOMINAL_CODE_M),
        ],
        axis=2,
    )
    own, mask = link_features(p, c, there, of_channel, slot, epoch)
    whole = _whole_features(differences, found, p, c, links)
    return TrustRows(epoch=epoch, links=own, there=mask, whole=whole, slot=slot)


def _slots(links: BoolArray) -> IntArray:
    """Return the places of links in a row, (n, l); -1 beyond the last."""
    flat = links.reshape(len(links), -1)
    length = int(flat.sum(axis=1).max(initial=1))
    order = np.argsort(~flat, axis=1, kind="stable")[:, :length]
    return np.where(np.take_along_axis(flat, order, axis=1), order, -1)


def _residuals_m(differences: DoubleDifferences, found: Candidates) -> tuple[FloatArray, ...]:
    """Return phase and code less the candidate's ranges, (c, b + 1, m); 0 at references."""
    epoch = found.epoch
    e_n = differences.e_n[epoch]
    of_reference = differences.reference[:, differences.group].clip(0)[epoch]
    apart_n = e_n - np.take_along_axis(e_n, of_reference[..., None], axis=1)
    range_m = -found.baselines_n_m @ apart_n.swapaxes(1, 2)
    links = differences.resolvable[epoch]
    phase_m = differences.phase_m[epoch] - differences.wavelength_m * found.cycles - range_m
    out = []
    for value in (phase_m, differences.code_m[epoch] - range_m):
        padded = np.zeros((len(epoch), value.shape[1] + 1, value.shape[2]))
        padded[:, 1:] = np.where(links, value, 0.0)
        out.append(padded)
    return tuple(out)


def _whole_features(
    differences: DoubleDifferences,
    found: Candidates,
    p: FloatArray,
    c: FloatArray,
    links: BoolArray,
) -> FloatArray:
    """Return figures of a candidate as a whole and of its epoch, (c, WHOLE_FEATURES)."""
    n = len(differences.t_s)
    epoch, cost = found.epoch, found.cost
    weight = found.log_volume - 0.5 * cost
    first, number, gap, posterior = beside_others(epoch, cost, weight, n)
    double = differences.resolvable.sum(axis=(1, 2))
    degrees = np.maximum(2 * double - 3, 1)[epoch]
    robust = np.log1p(p * p / _STUDENT).sum(axis=(1, 2))
    robust += np.log1p(c * c / _STUDENT).sum(axis=(1, 2))
    least = np.full(n, np.inf)
    np.minimum.at(least, epoch, robust)
    antennas, channels = links.any(axis=2).sum(axis=1), links.any(axis=1).sum(axis=1)
    used = links.any(axis=1)
    phase_v = np.where(used, differences.phase_variance_m2, np.inf).min(axis=1)
    code_v = np.where(used, differences.code_variance_m2, np.inf).min(axis=1)
    size_m = np.linalg.norm(differences.baselines_b_m, axis=1).max(initial=1e-3)
    of_epoch = np.stack(
        [
            np.log(np.maximum(number, 1)),
            antennas / 8.0,
            channels / 8.0,
            np.log(np.maximum(double, 1)),
            0.5 * np.log(phase_v / _NOMINAL_PHASE_M**2),
            0.5 * np.log(code_v / _NOMINAL_CODE_M**2),
            np.full(n, np.log(size_m)),
            (found.status == PROVEN).astype(float),
            (differences.reference >= 0).sum(axis=1),
        ],
        axis=1,
    )
    own = np.stack(
        [
            np.maximum(posterior, -LARGEST),
            np.log1p(cost / degrees),
            np.arcsinh((cost - degrees) / np.sqrt(2.0 * degrees)),
            np.log1p((p * p).sum(axis=(1, 2)) / degrees),
            np.log1p((c * c).sum(axis=(1, 2)) / degrees),
            np.minimum(cost - cost[first][epoch], LARGEST) / 10.0,
            np.minimum(gap, LARGEST) / 10.0,
            np.minimum(robust - least[epoch], LARGEST) / 5.0,
            found.log_volume / 5.0,
        ],
        axis=1,
    )
    whole = np.concatenate([own, of_epoch[epoch]], axis=1)
    return np.asarray(np.nan_to_num(whole, posinf=0.0), dtype=np.float32)


def probabilities(
    score: FloatArray, none: FloatArray, epoch: IntArray, epochs: int
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return posteriors of candidates, (c,), of none of them, (n,), and the best rows, (n,).

    Parameters
    ----------
    score, none : ndarray, shape (c,)
        The network's; of ``none`` the first row of each epoch counts.
    epoch : ndarray of int, shape (c,)
        Rising.
    epochs : int
        Those without a row have none for certain, and best row -1.
    """
    first = np.searchsorted(epoch, np.arange(epochs))
    some = np.bincount(epoch, minlength=epochs) > 0
    of_none = np.full(epochs, -np.inf)
    of_none[some] = none[first[some]]
    largest = np.where(some, of_none, 0.0)
    np.maximum.at(largest, epoch, score)
    weight, weight_of_none = np.exp(score - largest[epoch]), np.exp(of_none - largest)
    total = weight_of_none + np.bincount(epoch, weights=weight, minlength=epochs)
    total[~some] = 1.0
    probability = weight / total[epoch]
    order = np.lexsort((probability, epoch))
    best = np.full(epochs, -1)
    best[epoch[order]] = order
    return probability, np.where(some, weight_of_none / total, 1.0), best
