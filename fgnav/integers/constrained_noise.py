"""How large noise really is, learned from the integers' own search, before any is accepted.

A probability means what it says only as far as the noise model does, and stated noise is often two
or three times off and grows towards the horizon by a rule of thumb. Here each variance becomes
``scale v0 (v / v0)^power`` of the stated v and its median v0, with two scales and two powers, for
code and phase, under which the recorded epochs are most likely: summed over all integer candidates
of each epoch, none of which has to be believed for that (marginal likelihood [1]_). Candidates are
those of the law before, from calm noise on, which has few, until the law stays as it is. Epochs may
be calmer or rougher than the mean, so that a spoilt epoch counts no more than a rough one.

References
----------
.. [1] D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4, 1992.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss.differences import DoubleDifferences
from fgnav.integers.constrained_likelihood import Likelihood, likelihood_of
from fgnav.integers.constrained_prior import AttitudePrior
from fgnav.integers.epochs import epochs_at

_ENOUGH = 30  # epochs
_SAMPLE = 200  # epochs, spread evenly: variance factors to 3 %
_LINKS = 3000  # double differences in a sample are enough; larger arrays get by with fewer epochs
_STATED_LOG_SIGMA = 1.0  # of standard deviations: a factor e beside the stated is nothing unusual
_STATED_POWER_SIGMA = 0.5
_ROUGHNESS = 20.0  # degrees of freedom of an epoch's own scale; 17 to 25 fitted two real receivers
_CALM = (np.log(0.25), 0.0) * 2  # the first law: half the stated standard deviations
_ROUNDS = 8  # two or three do
_NODES = 10**6  # of an epoch: one that takes more tells little
_TRIALS = 120  # of laws, in a round
_EXACT = 1e-6  # of the logarithm of a likelihood: it is some thousands
_SETTLED = 0.1  # of log scale and power: what 200 epochs of two antennas tell them to


class _Sample(NamedTuple):
    differences: DoubleDifferences
    prior: AttitudePrior | None
    code: FloatArray  # (n, m): stated variance by its median, whose logarithm is raised
    phase: FloatArray

    def at(self, epochs: IntArray) -> "_Sample":
        prior = None if self.prior is None else self.prior.at(epochs)
        there = epochs_at(self.differences, epochs)
        return _Sample(there, prior, self.code[epochs], self.phase[epochs])

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

    As they are, where fewer than 30 epochs have links, or so many integers that fit that a search
    cannot list them.

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
    return whole.with_law(_fitted(whole.at(pick), min(nodes, _NODES)))


def _fitted(sample: _Sample, nodes: int) -> FloatArray:
    """Return log scale and power minus 1, of code and of phase, (4,), that are most likely.

    None is below the stated where too few epochs can tell.
    """
    law = np.array(_CALM)
    for _ in range(_ROUNDS):
        likelihood = likelihood_of(sample.with_law(law), nodes, sample.prior)
        if likelihood.epochs < _ENOUGH:
            return np.asarray(np.maximum(law, 0.0))
        last, law = law, _most_likely(sample, likelihood, law)
        if np.abs(law - last).max() < _SETTLED:
            break
    law[[0, 2]] += np.log(_ROUGHNESS / (_ROUGHNESS - 2.0))  # the mean of the epochs' variances
    return law


def _most_likely(sample: _Sample, likelihood: Likelihood, start: FloatArray) -> FloatArray:
    from scipy.optimize import minimize  # noqa: PLC0415  # heavy, and seldom needed

    used = sample.differences.resolvable.any(axis=1)
    flat = [np.ptp(np.log(part[used])) < _SETTLED for part in (sample.code, sample.phase)]
    free = np.array([True, not flat[0], True, not flat[1]])
    sigma = np.array([2 * _STATED_LOG_SIGMA, _STATED_POWER_SIGMA] * 2)[free]

    def misfit(x: FloatArray) -> float:
        likely = likelihood.logarithm(*sample.variances_m2(_whole(x, free)), _ROUGHNESS)
        return 0.5 * float(np.sum((x / sigma) ** 2)) - likely

    options = {"maxfun": _TRIALS, "ftol": _EXACT}
    return _whole(minimize(misfit, start[free], method="L-BFGS-B", options=options).x, free)


def _whole(x: FloatArray, free: BoolArray) -> FloatArray:
    law = np.zeros(len(free))
    law[free] = x
    return law
