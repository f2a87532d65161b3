"""How large noise really is, learned from the integers' own search, before any is accepted.

A probability means what it says only as far as the noise model does, and stated noise is often two
or three times off and grows towards the horizon by a rule of thumb. Here each variance becomes
``scale v0 (v / v0)^power`` of the stated v and its median v0, with two scales and two powers, for
code and phase, under which the recorded epochs are most likely: summed over all integer candidates
of each epoch, none of which has to be believed for that (marginal likelihood [1]_). Only integers
that are beyond doubt, before and after, are held instead of searched for. Epochs may be calmer or
rougher than the mean: their common scale is integrated out, as in Student's distribution, so that a
spoilt epoch counts no more than a rough one.

References
----------
.. [1] D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4, 1992.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss.differences import DoubleDifferences
from fgnav.integers.affine import Epochs, epoch_links, epochs_of, link_covariance
from fgnav.integers.constrained_held import Held, hold
from fgnav.integers.constrained_prior import AttitudePrior
from fgnav.integers.constrained_search import PROVEN, ConstrainedSearch, search_constrained
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
_DOUBT = 1e-6  # chance that integers held are wrong
_SETTLED = 0.1  # of log scale and power: what 200 epochs of two antennas tell them to


class _Sample(NamedTuple):
    differences: DoubleDifferences
    prior: AttitudePrior | None
    code: FloatArray  # (n, m): stated variance by its median, whose logarithm is raised
    phase: FloatArray

    def at(self, which: BoolArray) -> "_Sample":
        pick = np.flatnonzero(which)
        prior = None if self.prior is None else self.prior.at(pick)
        of_pick = epochs_at(self.differences, pick)
        return _Sample(of_pick, prior, self.code[pick], self.phase[pick])

    def variances_m2(self, law: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return those of code and phase, (n, m) each, under a law of noise."""
        return (
            self.differences.code_variance_m2 * np.exp(law[0]) * self.code ** law[1],
            self.differences.phase_variance_m2 * np.exp(law[2]) * self.phase ** law[3],
        )

    def with_law(self, law: FloatArray) -> DoubleDifferences:
        code_m2, phase_m2 = self.variances_m2(law)
        return replace(self.differences, code_variance_m2=code_m2, phase_variance_m2=phase_m2)


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
    if len(differences.t_s) < _ENOUGH:
        return differences
    links = differences.resolvable.sum(axis=(1, 2))
    there = np.flatnonzero(links)
    if len(there) < _ENOUGH:
        return differences
    many = int(np.clip(_LINKS / links[there].mean(), _ENOUGH, _SAMPLE))
    pick = there[np.linspace(0, len(there) - 1, min(many, len(there))).astype(np.int64)]
    used = differences.resolvable.any(axis=1)
    stated = [differences.code_variance_m2, differences.phase_variance_m2]
    code, phase = (variance / np.median(variance[used]) for variance in stated)
    whole = _Sample(differences, prior, code, phase)
    sample = whole.at(np.isin(np.arange(len(links)), pick))
    return whole.with_law(_fitted(sample, min(nodes, _NODES)))


def _fitted(sample: _Sample, nodes: int) -> FloatArray:
    """Return log scale and power minus 1, of code and of phase, (4,), that are most likely."""
    found = search_constrained(sample.differences, nodes, sample.prior)
    sure = _sure(found)
    law = _most_likely(sample, found, sure, nodes)
    if sure.any():
        again = search_constrained(sample.at(sure).with_law(law), nodes, sample.at(sure).prior)
        same = (again.cycles == found.cycles[sure]).all()
        if not (same and _sure(again).all()):
            law = _most_likely(sample, found, np.zeros_like(sure), nodes)
    law[[0, 2]] += np.log(_ROUGHNESS / (_ROUGHNESS - 2.0))  # the mean of the epochs' variances
    return law


def _sure(found: ConstrainedSearch) -> BoolArray:
    """Return the epochs, (n,), whose integers are beyond doubt."""
    return np.asarray((found.status == PROVEN) & (found.wrong_probability < _DOUBT))


def _most_likely(
    sample: _Sample, found: ConstrainedSearch, sure: BoolArray, nodes: int
) -> FloatArray:
    """Return the law under which epochs, some with integers held, are most likely."""
    from scipy.optimize import minimize  # noqa: PLC0415  # heavy, and seldom needed

    used = sample.differences.resolvable.any(axis=1)
    flat = [np.ptp(np.log(part[used])) < _SETTLED for part in (sample.code, sample.phase)]
    free = np.array([True, not flat[0], True, not flat[1]])
    sigma = np.array([2 * _STATED_LOG_SIGMA, _STATED_POWER_SIGMA] * 2)[free]
    known, doubtful = sample.at(sure), sample.at(~sure)
    held = hold(known.differences, found.rows(np.flatnonzero(sure)), known.prior)

    def misfit(x: FloatArray) -> float:
        law = _whole(x, free)
        likely = 0.0
        if sure.any():
            likely += _log_held(held, known.variances_m2(law))
        if not sure.all():
            likely += _log_searched(doubtful.with_law(law), doubtful.prior, nodes)
        return 0.5 * float(np.sum((x / sigma) ** 2)) - likely

    start = np.zeros(free.sum())
    corners = np.vstack([start, np.diag(np.array([-1.0, -0.5, -1.0, -0.5])[free])])
    options = {
        "initial_simplex": corners,
        "xatol": _SETTLED,
        "fatol": 2 * _SETTLED,
        "maxfev": _TRIALS,
    }
    return _whole(minimize(misfit, start, method="Nelder-Mead", options=options).x, free)


def _whole(x: FloatArray, free: BoolArray) -> FloatArray:
    law = np.zeros(len(free))
    law[free] = x
    return law


def _log_held(held: Held, variances_m2: tuple[FloatArray, FloatArray]) -> float:
    cost, rest = held.log_likelihoods(*variances_m2)
    return float(np.sum(rest - 0.5 * cost + _student(cost, held.degrees)))


def _log_searched(d: DoubleDifferences, prior: AttitudePrior | None, nodes: int) -> float:
    found = search_constrained(d, nodes, prior)
    sound = found.status == PROVEN
    epochs = epochs_of(d)
    determinants = _log_determinants(epochs, d.code_variance_m2)
    determinants += _log_determinants(epochs, d.phase_variance_m2)
    student = _student(found.costs[sound, 0], found.degrees[sound])
    return float(np.sum(found.log_evidence[sound] + student - 0.5 * determinants[sound]))


def _student(cost: FloatArray, degrees: IntArray) -> FloatArray:
    """Return what makes a Gaussian's ``-cost / 2`` Student's.

    That of the best integers; what other candidates and the volume add stays as it is.
    """
    return np.asarray(0.5 * (cost - (_ROUGHNESS + degrees) * np.log1p(cost / _ROUGHNESS)))


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
