"""How often integers of a given precision are right: success rates, exact and bounded.

Bootstrapping fixes one decorrelated integer after the other; the success rate of that is exact and
bounds that of integer least squares from below, while the ambiguity dilution of precision (ADOP)
bounds it from above [1]_. Both hold for Gaussian noise of the stated covariance.

References
----------
.. [1] S. Verhagen, "On the reliability of integer ambiguity resolution", Navigation 52, 2005.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fgnav.integers.ils.decorrelation import decorrelate
from fgnav.integers.ils.search import NOT_POSITIVE, OK, checked_problem, fault, refused


@dataclass(frozen=True, slots=True, kw_only=True)
class SuccessRates:
    """Chances that integers are right.

    Attributes
    ----------
    bootstrapped : float
        Of bootstrapping after decorrelation, exact; integer least squares is right at least as
        often.
    upper : float
        Integer least squares is right at most as often.
    adop_cycles : float
        Geometric mean of the conditional standard deviations, whatever the decorrelation.
    """

    bootstrapped: float
    upper: float
    adop_cycles: float


def success_rates(covariance: ArrayLike) -> SuccessRates:
    """Return the success rates of float ambiguities with a covariance, cycles^2, (n, n).

    Raises
    ------
    BadInputError
        As ``integer_least_squares``.
    """
    from scipy.special import gammainc  # noqa: PLC0415  # lazy

    d = _conditional_variances(covariance)
    n = len(d)
    adop = float(np.exp(0.5 * np.log(d).mean()))
    # the ball of the pull-in region's volume, 1, holds more of the density than any other region
    squared_radius = (n / 2 * math.gamma(n / 2)) ** (2 / n) / math.pi
    return SuccessRates(
        bootstrapped=math.prod(math.erf(1.0 / math.sqrt(8.0 * x)) for x in d),
        upper=float(gammainc(n / 2, squared_radius / (2 * adop**2))),
        adop_cycles=adop,
    )


def _conditional_variances(covariance: ArrayLike) -> NDArray[np.float64]:
    n = len(np.atleast_1d(np.asarray(covariance)))
    still, metric = checked_problem(np.zeros(n), covariance, 1)
    status = fault(still, metric)
    positive, _, d, _ = decorrelate(metric, still[:, None])
    if status != OK or not positive:
        raise refused(status or NOT_POSITIVE)
    return np.asarray(d)
