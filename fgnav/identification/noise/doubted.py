"""Noises that a record leaves open, of a unit that is not as its data sheet has it.

Where one white noise of a unit is louder than stated, its other figures are known no better than
those that nobody states: log-normal about usual ones. Most records do not determine them: of a
gyroscope beside fixes anything up to thirty times a data sheet's may be as likely, and what comes
next shows it. A noise whose size is f times the stated with the density p(f | record) has the
covariance of one with

    f^2 = sum f^2 L(f) p(f) / sum L(f) p(f)

L the likelihood of the thinned chain, all other noises as identified. Each is integrated by itself.
"""

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.frontend.sensors.rest import AT_REST
from fgnav.graph.types.motion import INERTIAL_NOISES
from fgnav.identification.noise.begin import WHITE
from fgnav.identification.noise.noise_search import figure_sigmas
from fgnav.identification.noise.thinned_flight import ThinnedFlight

# Of the trapezoidal rule over all but .3 % of a Gaussian, sigmas from the stated.
_NODES = np.arange(-3.0, 3.01, 0.5)
_WEIGHTS = np.where(np.abs(_NODES) == 3.0, 0.5, 1.0) * np.exp(-(_NODES**2) / 2)


def is_doubted(factors: dict[str, float], unstated: tuple[str, ...]) -> bool:
    """Return whether a unit's white noise is louder than stated, by factors of components."""
    return any(factors.get(name, 1.0) > 1.0 and name not in unstated for name in WHITE)


def mean_squares(flight: ThinnedFlight, identified: dict[str, float]) -> dict[str, float]:
    """Return root mean squares of the factors that a flight leaves open, of its unit's noises.

    Parameters
    ----------
    flight : ThinnedFlight
        Its noise as identified.
    identified : dict of str to float
        Factors that it tells: these are not open.
    """
    factors: dict[str, float] = {}
    names = [one for one in INERTIAL_NOISES if one in flight.names and one not in identified]
    for name, sigma in zip(names, figure_sigmas(tuple(names)).tolist(), strict=True):
        theta = sigma * _NODES
        likelihood = np.array([_likelihood(flight, name, float(f)) for f in np.exp(theta)])
        if not np.isfinite(likelihood).any():
            continue
        weight = _WEIGHTS * np.exp(likelihood - likelihood.max())
        f = float(np.sqrt(weight @ np.exp(2 * theta) / weight.sum()))
        factors |= {one: f for one in (name, name + AT_REST) if one in flight.names}
    return factors


def _likelihood(flight: ThinnedFlight, name: str, factor: float) -> float:
    """Return the logarithm of a flight's likelihood, minus infinity where it has no minimum."""
    try:
        return flight.likelihood_at({name: factor, name + AT_REST: factor})
    except NoSolutionError:
        return -np.inf
