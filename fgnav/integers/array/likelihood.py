"""Likelihood of noise, given the epochs of a rigid array, whichever of their integers are true.

The integers that noise may stand behind are searched once, for one law of noise. For any law nearby
each of them is as likely as ``given_integers`` says, in closed form, and an epoch is as likely as
all of its integers together. Epochs may be calmer or rougher than the mean: their common scale is
integrated out for each vector of integers, which makes Gaussian weights those of Student's
distribution.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.integers.array.given_integers import GivenIntegers, given_integers
from fgnav.integers.array.kernel import PROVEN
from fgnav.integers.array.search import searched
from fgnav.types.differences import DoubleDifferences

# Three antennas, four satellites, code 1 m: 120 integer vectors of an epoch are that near to the
# best, and 41 of them hold 99 % of the posterior.
_MOST = 256
_REACH = 25.0


@dataclass(frozen=True, eq=False, slots=True)
class Likelihood:
    """That of epochs, by their integers."""

    epoch: IntArray  # (c,): to which a vector of integers belongs; rising
    given: GivenIntegers  # those c vectors
    degrees: IntArray  # (c,)

    @property
    def epochs(self) -> int:
        """Return the number of epochs that count."""
        return len(self._first)

    @property
    def _first(self) -> IntArray:
        return np.flatnonzero(np.diff(self.epoch, prepend=-1))

    def logarithm(
        self, code_variance_m2: FloatArray, phase_variance_m2: FloatArray, roughness: float
    ) -> float:
        """Return the sum of logarithms over the epochs, but for a constant.

        Parameters
        ----------
        code_variance_m2, phase_variance_m2 : ndarray, shape (n, m)
            Of all epochs that were searched.
        roughness : float
            Degrees of freedom of an epoch's own scale: the larger, the more alike epochs are.
        """
        of_links = code_variance_m2[self.epoch], phase_variance_m2[self.epoch]
        cost, log_factor = self.given.log_likelihoods(*of_links)
        each = log_factor - 0.5 * (roughness + self.degrees) * np.log1p(cost / roughness)
        return float(np.logaddexp.reduceat(each, self._first).sum()) if len(each) else 0.0


def likelihood_of(differences: DoubleDifferences, nodes: int) -> Likelihood:
    """Return the likelihood of epochs, for noise not far from the nominal.

    Epochs whose integers are too many to be listed are left out, whatever the noise: one that
    counts under calm noise alone would speak for that.

    Parameters
    ----------
    nodes : int
        What the search of an epoch may visit.
    """
    result, _, degrees = searched(differences, _MOST, _MOST, _REACH, nodes, listed=True)
    finite = np.isfinite(result.costs)
    complete = (result.status == PROVEN) & ~finite[:, -1]
    epoch, candidate = np.nonzero(finite & complete[:, None])
    vectors = result.cycles[epoch, candidate], result.columns[epoch, candidate]
    given = given_integers(differences.resampled(epoch), *vectors)
    return Likelihood(epoch, given, degrees[epoch])
