"""Allan deviation of an inertial sensor: its noise by averaging time."""

import numpy as np

from fgnav.checks import BadInputError, FloatArray

_GAP = 1.5  # sample intervals: a longer step ends a run
_PER_DECADE = 12
# Clusters of a tenth of the record are nine independent differences at most, known to a quarter:
# IEEE Std 952-1997, equation C.21.
_LONGEST = 0.1
FEWEST = 10  # samples: a tenth of them is one


def allan_deviation(values: FloatArray, interval_s: float) -> tuple[FloatArray, FloatArray]:
    """Return the overlapping Allan deviation of a record without gaps [1]_.

    Parameters
    ----------
    values : ndarray, shape (n, d)
        Samples of d axes: rates, not angles.
    interval_s : float
        Between samples.

    Returns
    -------
    tau_s : ndarray, shape (k,)
        Averaging times, from one interval to a tenth of the record.
    deviation : ndarray, shape (k, d)
        In the unit of ``values``.

    Raises
    ------
    BadInputError
        If there are fewer than ten samples.

    References
    ----------
    .. [1] Riley: Handbook of Frequency Stability Analysis, NIST Special Publication 1065, 2008,
       equation 11.
    """
    n = len(values)
    if n < FEWEST:
        raise BadInputError(f"allan deviation: needs {FEWEST} samples or more, got {n}")
    longest = int(_LONGEST * n)
    count = 1 + int(np.ceil(_PER_DECADE * np.log10(longest))) if longest > 1 else 1
    m = np.unique(np.geomspace(1, longest, count).round().astype(np.int64))
    # Of values less their first: sums of an hour of gravity would cost digits.
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values - values[0], axis=0)])
    deviation = [_of_clusters(total, k) for k in m.tolist()]
    return m * interval_s, np.stack(deviation)


def _of_clusters(total: FloatArray, k: int) -> FloatArray:
    """Return the deviation, (d,), of means over k samples, of sums (n + 1, d)."""
    second = total[2 * k :] - 2 * total[k:-k] + total[: -2 * k]
    return np.asarray(np.sqrt(0.5 * np.square(second).mean(axis=0)) / k)


def stated_deviation(tau_s: FloatArray, density: float, walk: float) -> FloatArray:
    """Return the Allan deviation of white noise and a random walk of the bias [1]_, (k,).

    Parameters
    ----------
    tau_s : ndarray, shape (k,)
    density : float
        Of the white noise, unit per root hertz.
    walk : float
        Of the bias, unit per root second.

    References
    ----------
    .. [1] IEEE Std 952-1997, equations C.13 and C.17.
    """
    return np.asarray(np.sqrt(density**2 / tau_s + walk**2 * tau_s / 3))


def longest_run(t_s: FloatArray) -> slice:
    """Return the samples of the longest run without a gap."""
    steps_s = np.diff(t_s)
    if not len(steps_s):
        return slice(0, len(t_s))
    ends = np.flatnonzero(steps_s > _GAP * np.median(steps_s)) + 1
    bounds = np.concatenate([[0], ends, [len(t_s)]])
    k = int(np.diff(bounds).argmax())
    return slice(int(bounds[k]), int(bounds[k + 1]))
