"""Noise estimated from the integers' own search, before any is accepted.

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
from fgnav.integers.array.likelihood import Likelihood, likelihood_of
from fgnav.integers.ils.array_model import spans
from fgnav.kernels.one_thread import one_thread
from fgnav.types.differences import DoubleDifferences

_SUFFICIENT = 30  # epochs
_RENEWED = 4  # times as many epochs tell standard deviations twice as well
_SAMPLE = 200  # epochs, spread evenly: variance factors to 3 %
_LINKS = 3000  # double differences in a sample are enough; larger arrays get by with fewer epochs
_STATED_LOG_SIGMA = 1.0  # of standard deviations: a factor e beside the stated is nothing unusual
_STATED_POWER_SIGMA = 0.5
_FARTHEST = 6.0  # of these: epochs without redundancy fit exactly, and ask for no noise at all
_ROUGHNESS = 20.0  # degrees of freedom of an epoch's own scale; 17 to 25 fitted two real receivers
_CALM = (np.log(0.25), 0.0) * 2  # the first law: half the stated standard deviations
_ROUNDS = 8  # two or three do
_NODES = 10**6  # of an epoch: one that takes more tells little
_TRIALS = 120  # of laws, in a round
_EXACT = 1e-6  # of the logarithm of a likelihood: it is some thousands
_SETTLED = 0.1  # of log scale and power: what 200 epochs of two antennas tell them to


class _Sample(NamedTuple):
    differences: DoubleDifferences
    code: FloatArray  # (n, m): stated variance by its median, whose logarithm is raised
    phase: FloatArray

    def at(self, epochs: IntArray) -> "_Sample":
        rows = self.differences.resampled(epochs)
        return _Sample(rows, self.code[epochs], self.phase[epochs])

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
    differences: DoubleDifferences, nodes: int, *, causal: bool = False
) -> DoubleDifferences:
    """Return differences with code and phase variances as large as the data show.

    As they are, where fewer than 30 epochs have links of antennas apart, or so many integers that
    fit that a search cannot list them.

    Parameters
    ----------
    nodes : int
        What the search of an epoch may visit.
    causal : bool
        Each epoch's variances by epochs up to it alone: renewed when there are 30, 120, 480, ...
    """
    rows = _of_array(differences)
    if len(rows) < _SUFFICIENT:
        return differences
    code_m2, phase_m2 = differences.code_variance_m2.copy(), differences.phase_variance_m2.copy()
    count, start = _SUFFICIENT if causal else len(rows), np.array(_CALM)
    while count <= len(rows):
        past = rows[:count]
        all_epochs = _sample(differences, past)
        sample = all_epochs.at(_picked(differences, past))
        law, is_determined = _typical(sample, min(nodes, _NODES), start)
        later = slice(int(past[-1]) if causal else 0, None)
        variances = all_epochs.variances_m2(_of_mean(law, is_determined))
        code_m2[later], phase_m2[later] = (variance[later] for variance in variances)
        count, start = _RENEWED * count, law if is_determined else np.array(_CALM)
    return replace(differences, code_variance_m2=code_m2, phase_variance_m2=phase_m2)


def _of_array(differences: DoubleDifferences) -> IntArray:
    """Return the epochs whose links are of antennas apart from each other, (k,)."""
    arrays = spans(differences.baselines_b_m, np.any(differences.resolvable, axis=2))
    linked = differences.resolvable.any(axis=(1, 2))
    return np.flatnonzero(linked & (arrays.rank[arrays.pattern] > 0))


def _sample(differences: DoubleDifferences, rows: IntArray) -> _Sample:
    """Return all epochs, variances by their medians over some, (k,)."""
    used = differences.resolvable[rows].any(axis=1)
    stated = (differences.code_variance_m2, differences.phase_variance_m2)
    code, phase = (variance / np.median(variance[rows][used]) for variance in stated)
    return _Sample(differences, code, phase)


def _picked(differences: DoubleDifferences, rows: IntArray) -> IntArray:
    """Select as many of some epochs, (k,), as suffice, spread evenly."""
    links = differences.resolvable[rows].sum(axis=(1, 2)).mean()
    many = int(np.clip(_LINKS / links, _SUFFICIENT, _SAMPLE))
    return rows[np.linspace(0, len(rows) - 1, min(many, len(rows))).astype(np.int64)]


def _typical(sample: _Sample, nodes: int, start: FloatArray) -> tuple[FloatArray, bool]:
    """Return log scale and power minus 1, of code and of phase, (4,), of a typical epoch.

    And whether epochs are enough to determine them.
    """
    law = start
    for _ in range(_ROUNDS):
        likelihood = likelihood_of(sample.with_law(law), nodes)
        if likelihood.epochs < _SUFFICIENT:
            return law, False
        last, law = law, _most_likely(sample, likelihood, law)
        if np.abs(law - last).max() < _SETTLED:
            break
    return law, True


def _of_mean(law: FloatArray, is_determined: bool) -> FloatArray:
    """Return the law of the mean of the epochs' variances; not below the stated if unsure."""
    if not is_determined:
        return np.asarray(np.maximum(law, 0.0))
    of_mean = np.log(_ROUGHNESS / (_ROUGHNESS - 2.0))
    return np.asarray(law + of_mean * np.array([1.0, 0.0, 1.0, 0.0]))


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
    with one_thread():
        bounds = np.stack([-_FARTHEST * sigma, _FARTHEST * sigma], axis=1)
        search = minimize(misfit, start[free], method="L-BFGS-B", bounds=bounds, options=options)
    return _whole(search.x, free)


def _whole(x: FloatArray, free: BoolArray) -> FloatArray:
    law = np.zeros(len(free))
    law[free] = x
    return law
