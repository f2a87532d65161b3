"""Predict, filter and smooth rates from attitudes and the rate's prior."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.geometry.rotations import exp, log, transpose
from fgnav.process.attitude_series import AttitudeSeries, attitude_series
from fgnav.process.evidence_kernel import PREDICT, Epochs, tape


class Turning(NamedTuple):
    """Rotations and rates at n times, by attitudes."""

    R_nb: FloatArray  # (n, 3, 3)
    rate_b_radps: FloatArray  # (n, 3)
    covariance: FloatArray  # (n, 6, 6), of both, body axes; infinite before the first attitude


def filtered(
    t_s: FloatArray,
    R_nb: FloatArray,
    covariance_rad2: FloatArray,
    valid: BoolArray,
    prior: tuple[FloatArray, FloatArray],
    *,
    past: int | None = None,
) -> Turning:
    """Return each rotation and rate given the attitudes up to it; as given before the second one.

    Parameters
    ----------
    t_s, R_nb, covariance_rad2 : ndarray, shape (n,), (n, 3, 3), (n, 3, 3)
        Only valid attitudes are looked at.
    valid : ndarray of bool, shape (n,)
    prior : tuple of ndarray, shape (n - 1, 3, 3) and (n - 1, 3)
        Poles and variances of each interval.
    past : int, optional
        Attitudes that the filter's beginning may depend on; None: all.
    """
    rows = np.flatnonzero(valid)
    first, n = rows[0], len(t_s) - rows[0]
    out = Turning(np.array(R_nb), np.zeros((len(t_s), 3)), np.full((len(t_s), 6, 6), np.inf))
    out.covariance[first, :3, :3] = covariance_rad2[first]
    if n < 2 or len(rows) < 2:
        return out
    of_attitudes = attitude_series(
        t_s[rows], R_nb[rows], covariance_rad2[rows], np.arange(len(rows)), past or len(rows)
    )
    use = np.full(n, PREDICT)
    use[rows - first] = of_attitudes.epochs.use
    open_axis = np.zeros((n, 3))
    open_axis[rows - first] = of_attitudes.epochs.open_axis
    epochs = Epochs(
        t_s=t_s[first:],
        R_nb=R_nb[first:],
        covariance_rad2=covariance_rad2[first:],
        open_axis=open_axis,
        use=use,
    )
    steps = tape(n)
    series = AttitudeSeries(epochs=epochs, mean_rate=of_attitudes.mean_rate)
    series.log_densities(prior[0][first:], prior[1][first:], steps)
    out.R_nb[first + 1 :] = steps.R_nb[1:]
    out.rate_b_radps[first + 1 :] = steps.state[1:, 0]
    out.covariance[first + 1 :] = steps.covariance[1:, :6, :6]
    return out


def filtered_back(
    t_s: FloatArray,
    R_nb: FloatArray,
    covariance_rad2: FloatArray,
    valid: BoolArray,
    prior: tuple[FloatArray, FloatArray],
) -> Turning:
    """Filter the attitudes backwards in time, in which the process has the same law."""
    poles, variance = prior
    back = filtered(
        -t_s[::-1],
        R_nb[::-1],
        covariance_rad2[::-1],
        valid[::-1],
        (poles[::-1], variance[::-1]),
    )
    sign = np.repeat([1.0, -1.0], 3)  # rates are of the time that runs backwards
    return Turning(
        back.R_nb[::-1], -back.rate_b_radps[::-1], (back.covariance * np.outer(sign, sign))[::-1]
    )


def smoothed(before: Turning, after: Turning) -> Turning:
    """Return rotations and rates by what is known up to each time and from there on, weighted.

    An attitude at the time itself counts twice: a start for a search, and no estimate.
    """
    out = Turning(*(np.array(values) for values in before))
    has_after = np.isfinite(after.covariance).all(axis=(1, 2))
    first = has_after & ~np.isfinite(before.covariance).all(axis=(1, 2))
    for values, other in zip(out, after, strict=True):
        values[first] = other[first]
    both = np.flatnonzero(has_after & ~first)
    P = before.covariance[both]
    gain = np.linalg.solve(P + after.covariance[both], P).swapaxes(1, 2)
    rotation = log(transpose(before.R_nb[both]) @ after.R_nb[both])
    change = np.hstack([rotation, after.rate_b_radps[both] - before.rate_b_radps[both]])
    step = np.einsum("nij,nj->ni", gain, change)
    out.R_nb[both] = before.R_nb[both] @ exp(step[:, :3])
    out.rate_b_radps[both] += step[:, 3:]
    out.covariance[both] = P - gain @ P
    return out
