"""Filter against smoother: where what came later moved the states by more than both say it can."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray
from fgnav.evaluation.reference import common_epochs, minus
from fgnav.evaluation.scores import EULER, hidden
from fgnav.geometry import rotations
from fgnav.types.estimate import Estimate

_COVARIANCES = {
    "attitude": "attitude_covariance_rad2",
    "position": "position_covariance_m2",
    "velocity": "velocity_covariance_m2ps2",
}


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Separation:
    """One vector of a filter less that of a smoother, at the epochs that both have."""

    quantity: str  # ``"attitude"``, ``"position"`` or ``"velocity"``
    t_s: FloatArray  # (n,)
    # (n, 3); attitude in body axes of the smoother, rad; position and velocity in ``n``, m and m/s
    difference: FloatArray
    # (n, 3); its standard deviations; NaN where the smoother states more than the filter
    sigma: FloatArray

    @property
    def ratio(self) -> FloatArray:
        """Difference over its standard deviation, (n, 3): within 3 of two honest passes."""
        return np.asarray(self.difference / self.sigma)


def separations(forward: Estimate, smoothed: Estimate) -> list[Separation]:
    """Return how far a filter is from a smoother of the same flight, state by state.

    What measurements after an epoch add is independent of the smoother's error, so the difference
    of both has the covariance ``P_filter - P_smoother`` [1]_. Only states of which both state a
    covariance are here. A filter that knows other hyperparameters than the smoother is another
    estimator: the statement is then true to first order alone.

    References
    ----------
    .. [1] Rauch, Tung, Striebel: Maximum likelihood estimates of linear dynamic systems, AIAA
       Journal 3, 1965, equation 3.31.
    """
    rows, smooth_rows = common_epochs(forward.t_s, smoothed.t_s)
    if not len(rows):
        return []
    lost = hidden(forward) | hidden(smoothed)
    R_nb = smoothed.R_nb[smooth_rows]
    turn_rad = rotations.log(rotations.transpose(R_nb) @ forward.R_nb[rows])
    of = {
        "attitude": turn_rad,
        "position": minus(forward.p_n_m, smoothed.p_n_m, rows, smooth_rows),
        "velocity": minus(forward.v_n_mps, smoothed.v_n_mps, rows, smooth_rows),
    }
    out = []
    for quantity, difference in of.items():
        P_f, P_s = (getattr(one, _COVARIANCES[quantity]) for one in (forward, smoothed))
        gone = set(EULER) if quantity == "attitude" else {quantity}
        if difference is None or P_f is None or P_s is None or gone & lost:
            continue
        variance = np.diagonal(P_f[rows] - P_s[smooth_rows], axis1=1, axis2=2)
        sigma = np.sqrt(np.where(variance > 0, variance, np.nan))
        t_s = forward.t_s[rows]
        out.append(Separation(quantity=quantity, t_s=t_s, difference=difference, sigma=sigma))
    return out
