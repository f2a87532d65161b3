"""What of a body's rate comes and goes between fixes, told from the flight's own measurements.

Without a gyroscope or an array the rate is a random walk, and how far it walks is told by how it
changes over the seconds that such attitudes are good for. An aircraft's roll rate is gone within a
fraction of one: over seconds it is noise, and the attitude wanders by more than the walk says.
"""

from dataclasses import replace

import numpy as np

from fgnav.checks import FloatArray
from fgnav.methods.smoother.density import climbed
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.linear import blocks_of, log_likelihood
from fgnav.methods.smoother.solution import Solution, started_at

_START = 1e-3  # (rad/s)2/Hz, of the search


def with_quick_rates(keyframes: Keyframes, solution: Solution) -> Keyframes:
    """Return keyframes whose rate has a white part beside the walk, of the likeliest intensity.

    That of greatest marginal likelihood of all that the flight measured, linearised about a
    solution without it [1]_; kept off zero, where the likelihood is flat, as in ``density``. The
    walk keeps its own: it is what a filter needs, and carries what is known of rates.

    Parameters
    ----------
    keyframes : Keyframes
    solution : Solution
        Of these keyframes.

    References
    ----------
    .. [1] Laplace's approximation: Tierney, Kadane, J. Am. Stat. Assoc. 81, 1986.
    """
    there = started_at(keyframes, solution)
    block = next(iter(blocks_of(there, [0], len(keyframes.t_s))))

    def score(x: FloatArray) -> float:
        noise = block.samples.noise.copy()
        noise[:, 2:5] = np.exp(x)
        told = block._replace(samples=block.samples._replace(noise=noise))
        return log_likelihood(told) + float(x.sum()) / 2

    found = np.exp(climbed(score, np.full(3, np.log(_START))))
    return replace(keyframes, preintegrate=replace(keyframes.preintegrate, rate_density=found))
