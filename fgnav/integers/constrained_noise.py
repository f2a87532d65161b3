"""How large noise really is, learned from the integers' own search, before any is accepted.

A probability means what it says only as far as the noise model does, and stated noise is often two
or three times off and grows towards the horizon by a rule of thumb. Here each variance becomes
``scale v0 (v / v0)^power`` of the stated v and its median v0, with two scales and two powers, for
code and phase, under which the recorded epochs are most likely: summed over all integer candidates
of each epoch, none of which has to be believed for that (marginal likelihood [1]_). Epochs may be
calmer or rougher than the mean: their common scale is integrated out, as in Student's distribution,
so that a spoilt epoch counts no more than a rough one.

References
----------
.. [1] D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4, 1992.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray
from fgnav.gnss.differences import DoubleDifferences
from fgnav.integers.affine import Epochs, epoch_links, epochs_of, link_covariance
from fgnav.integers.constrained_prior import AttitudePrior
from fgnav.integers.constrained_search import PROVEN, search_constrained
from fgnav.integers.epochs import epochs_at
from fgnav.integers.ils import kernel

_ENOUGH = 30  # epochs
_SAMPLE = 200  # epochs, spread evenly: variance factors to 3 %
_LINKS = 3000  # double differences in a sample are enough; larger arrays get by with fewer epochs
_STATED_LOG_SIGMA = 1.0  # of standard deviations: a factor e beside the stated is nothing unusual
_STATED_POWER_SIGMA = 0.5
_ROUGHNESS = 20.0  # degrees of freedom of an epoch's own scale; 17 to 25 fitted two real receivers
_NODES = 10**5  # of an epoch, per trial of noise: one that takes more tells little
_TRIALS = 120
_SETTLED = 0.1  # of log scale and power: what 200 epochs of two antennas tell them to


class _Sample(NamedTuple):
    differences: DoubleDifferences
    prior: AttitudePrior | None
    code: FloatArray  # (n, m): stated variance by its median, whose logarithm is raised
    phase: FloatArray


def with_estimated_noise(
    differences: DoubleDifferences, nodes: int, prior: AttitudePrior | None = None
) -> DoubleDifferences:
    """Return the same differences with code and phase variances as large as the data show.

    As they are, where fewer than 30 epochs have links.

    Parameters
    ----------
    differences : DoubleDifferences
    nodes : int
        What the search of an epoch may visit.
    prior : AttitudePrior or None
    """
    links = differences.resolvable.sum(axis=(1, 2))
    there = np.flatnonzero(links)
    if len(there) < _ENOUGH:
        return differences
    many = int(np.clip(_LINKS / links[there].mean(), _ENOUGH, _SAMPLE))
    pick = there[np.linspace(0, len(there) - 1, min(many, len(there))).astype(np.int64)]
    used = differences.resolvable.any(axis=1)
    stated = [differences.code_variance_m2, differences.phase_variance_m2]
    code, phase = (variance / np.median(variance[used]) for variance in stated)
    sample = _Sample(
        epochs_at(differences, pick),
        None if prior is None else prior.at(pick),
        code[pick],
        phase[pick],
    )
    law = _fitted(sample, min(nodes, _NODES))
    return _with_law(differences, code, phase, law)


def _fitted(sample: _Sample, nodes: int) -> FloatArray:
    """Return log scale and power minus 1, of code and of phase, (4,), that are most likely."""
    from scipy.optimize import minimize  # noqa: PLC0415  # heavy, and seldom needed

    used = sample.differences.resolvable.any(axis=1)
    flat = [np.ptp(np.log(part[used])) < _SETTLED for part in (sample.code, sample.phase)]
    free = np.array([True, not flat[0], True, not flat[1]])
    sigma = np.array([2 * _STATED_LOG_SIGMA, _STATED_POWER_SIGMA] * 2)[free]

    def whole(x: FloatArray) -> FloatArray:
        law = np.zeros(4)
        law[free] = x
        return law

    def misfit(x: FloatArray) -> float:
        return 0.5 * float(np.sum((x / sigma) ** 2)) - _log_likelihood(sample, whole(x), nodes)

    start = np.zeros(free.sum())
    corners = np.vstack([start, np.diag(np.array([-1.0, -0.5, -1.0, -0.5])[free])])
    options = {
        "initial_simplex": corners,
        "xatol": _SETTLED,
        "fatol": 2 * _SETTLED,
        "maxfev": _TRIALS,
    }
    law = whole(minimize(misfit, start, method="Nelder-Mead", options=options).x)
    law[[0, 2]] += np.log(_ROUGHNESS / (_ROUGHNESS - 2.0))  # the mean of the epochs' variances
    return law


def _log_likelihood(sample: _Sample, law: FloatArray, nodes: int) -> float:
    d = _with_law(sample.differences, sample.code, sample.phase, law)
    found = search_constrained(d, nodes, sample.prior)
    sound = found.status == PROVEN
    epochs = epochs_of(d)
    determinants = _log_determinants(epochs, d.code_variance_m2)
    determinants += _log_determinants(epochs, d.phase_variance_m2)
    cost, degrees = found.costs[sound, 0], found.degrees[sound]
    # The best cost becomes Student's; what other candidates and the volume add stays as it is.
    student = 0.5 * (cost - (_ROUGHNESS + degrees) * np.log1p(cost / _ROUGHNESS))
    return float(np.sum(found.log_evidence[sound] + student - 0.5 * determinants[sound]))


def _with_law(
    differences: DoubleDifferences, code: FloatArray, phase: FloatArray, law: FloatArray
) -> DoubleDifferences:
    return replace(
        differences,
        code_variance_m2=differences.code_variance_m2 * np.exp(law[0]) * code ** law[1],
        phase_variance_m2=differences.phase_variance_m2 * np.exp(law[2]) * phase ** law[3],
    )


@kernel
def _log_determinants(epochs: Epochs, variance: FloatArray) -> FloatArray:
    """Return that of each epoch's covariance of links, (n,)."""
    out = np.zeros(len(variance))
    everywhere = np.ones(epochs.phase_m.shape[1], dtype=np.bool_)
    for k in range(len(variance)):
        links = epoch_links(epochs.resolvable[k], epochs.of_reference[k], everywhere)
        U = link_covariance(links, variance[k])
        for j in range(len(U)):
            out[k] += np.log(U[j, j])
            for i in range(j + 1, len(U)):
                factor = U[j, i] / U[j, j]
                for c in range(i, len(U)):
                    U[i, c] -= factor * U[j, c]
    return out
