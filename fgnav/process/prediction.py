"""How well a rotation is known between attitudes by the prior of the rate alone."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.process.attitude_series import AttitudeSeries, attitude_series
from fgnav.process.evidence_kernel import PREDICT, Epochs, tape


def predicted_rotation_covariance(
    t_s: FloatArray,
    R_nb: FloatArray,
    covariance_rad2: FloatArray,
    valid: BoolArray,
    prior: tuple[FloatArray, FloatArray],
    *,
    past: int | None = None,
) -> FloatArray:
    """Return the covariance of each rotation given the attitudes up to it, (n, 3, 3), rad2.

    Infinite before the first attitude. The process runs alike backwards in time: the same of
    reversed arrays, times negated, is what the attitudes from there on tell.

    Parameters
    ----------
    t_s, R_nb, covariance_rad2 : ndarray, shape (n,), (n, 3, 3), (n, 3, 3)
        Only valid attitudes are looked at.
    valid : ndarray of bool, shape (n,)
    prior : tuple of ndarray, shape (n - 1, 3)
        Poles and variances of each interval.
    past : int, optional
        Attitudes that the filter's beginning may depend on; None: all.
    """
    rows = np.flatnonzero(valid)
    first, n = rows[0], len(t_s) - rows[0]
    out = np.full((len(t_s), 3, 3), np.inf)
    out[first] = covariance_rad2[first]
    if n < 2 or len(rows) < 2:
        return out
    known = attitude_series(
        t_s[rows], R_nb[rows], covariance_rad2[rows], np.arange(len(rows)), past or len(rows)
    )
    use = np.full(n, PREDICT)
    use[rows - first] = known.epochs.use
    open_axis = np.zeros((n, 3))
    open_axis[rows - first] = known.epochs.open_axis
    epochs = Epochs(
        t_s=t_s[first:],
        R_nb=R_nb[first:],
        covariance_rad2=covariance_rad2[first:],
        open_axis=open_axis,
        use=use,
    )
    steps = tape(n)
    series = AttitudeSeries(epochs=epochs, mean_rate=known.mean_rate)
    series.log_densities(prior[0][first:], prior[1][first:], steps)
    out[first + 1 :] = steps.rotation[1:]
    return out
