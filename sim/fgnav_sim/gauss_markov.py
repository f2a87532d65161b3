"""First-order Gauss-Markov processes: noise that forgets itself within a time constant."""

import numpy as np

from fgnav.checks import FloatArray

_FLICKER_S = (0.01, 10_000.0)  # two decades beyond the 1 s to 100 s that specifications speak of
_FLICKER_PROCESSES = 13  # a factor of 3.2: the plateau ripples by less than 1 %


def gauss_markov(
    time_constant_s: float, step_s: float, shape: tuple[int, ...], *, rng: np.random.Generator
) -> FloatArray:
    """Return processes of variance one and autocorrelation ``exp(-lag / time_constant)``.

    They are stationary from the first sample on.

    Parameters
    ----------
    shape : tuple of int
        Samples first; one process for each place of the rest.
    """
    from scipy.signal import lfilter  # noqa: PLC0415  # lazy: keeps the command line quick

    kept = np.exp(-step_s / time_constant_s)
    drive = rng.standard_normal(shape)
    drive[1:] *= np.sqrt(1 - kept**2)
    return np.asarray(lfilter([1.0], [1.0, -kept], drive, axis=0))


def flicker(
    instability: float, step_s: float, shape: tuple[int, ...], *, rng: np.random.Generator
) -> FloatArray:
    """Return noise whose Allan deviation is flat: bias instability.

    The spectrum ``B^2 / (2 pi f)`` (two-sided; Allan variance ``2 ln 2 B^2 / pi``) [1]_ as a sum of
    Gauss-Markov processes of one variance whose time constants follow each other by a constant
    factor q: the sum of ``2 s^2 T / (1 + (2 pi f T)^2)`` over them is ``s^2 / (2 f ln q)`` between
    the first and the last constant, so ``s^2 = B^2 ln q / pi``.

    Parameters
    ----------
    instability : float
        B.
    shape : tuple of int
        Samples first.

    References
    ----------
    .. [1] IEEE Std 952-1997, annex C (bias instability).
    """
    constants_s = np.geomspace(*_FLICKER_S, _FLICKER_PROCESSES)
    ratio = constants_s[1] / constants_s[0]
    sigma = instability * np.sqrt(np.log(ratio) / np.pi)
    total = np.zeros(shape)
    for constant_s in constants_s:
        total += sigma * gauss_markov(constant_s, step_s, shape, rng=rng)
    return total
