"""How much an epoch's phases speak for its integers, whoever proposed them.

Wrong integers leave residuals anywhere within half a wavelength, right ones leave noise about one
attitude. The logarithm of the ratio of both densities, the attitude drawn from all there are, is
the evidence of an epoch [1]_: the integers that fit some attitude by chance are counted in it, so
an epoch of few links has little evidence however well it fits.

References
----------
.. [1] D. J. C. MacKay, "Information Theory, Inference, and Learning Algorithms", Cambridge, 2003,
   chapter 28: evidence is likelihood times Occam factor.
"""

from math import log, pi

import numpy as np

from fgnav.attitude.array import AttitudeSolution
from fgnav.checks import BoolArray, FloatArray
from fgnav.integers.arcs.reported import APART_S
from fgnav.types.differences import DoubleDifferences

_ROTATIONS = 8 * pi**2  # volume of all rotations, by the body tangent in rad
BELIEVED_LOG_ODDS = log(0.999 / 0.001)  # odds at which an epoch alone is believed


def epoch_evidence(
    differences: DoubleDifferences,
    links: BoolArray,
    attitude: AttitudeSolution,
    variance_factor: FloatArray,
    *,
    chosen_of: BoolArray | None = None,
) -> FloatArray:
    """Return by how much more likely than of wrong integers residuals are, (n,), log odds.

    Covariances of double differences count in full where baselines have the same links; else the
    evidence comes out a little too small.

    Parameters
    ----------
    differences : DoubleDifferences
    links : ndarray of bool, shape (n, b, m)
        Those that ``attitude`` rests on.
    attitude : AttitudeSolution
        By the stated noise.
    variance_factor : ndarray, shape (n,)
        By which the variance of phases exceeds the stated.
    chosen_of : ndarray of bool, shape (n, b, m), optional
        Links of which some were left out: which ones is counted as a guess.
    """
    from scipy.special import gammaln  # noqa: PLC0415  # lazy: keeps the command line quick

    variance_m2 = differences.phase_variance_m2
    of_channel = links.sum(axis=1)  # (n, m)
    count = of_channel.sum(axis=1)
    log_det = (of_channel * np.log(variance_m2) + np.log1p(of_channel)).sum(axis=1)
    for g in range(differences.reference.shape[1]):
        reference = differences.reference[:, g].clip(0)
        of_reference_m2 = np.take_along_axis(variance_m2, reference[:, None], axis=1)
        ratio = np.where(differences.group == g, of_reference_m2 / variance_m2, 0.0)
        log_det += np.log1p(np.einsum("nbm,nm->nb", links, ratio)).sum(axis=1)
    log_factor = np.log(variance_factor)
    uniform = of_channel @ np.log(differences.wavelength_m)
    normal = (count * (log(2 * pi) + log_factor) + log_det) / 2
    occam = (np.linalg.slogdet(attitude.covariance_rad2)[1] + 3 * (log(2 * pi) + log_factor)) / 2
    fit = attitude.chi_square / variance_factor / 2
    evidence = uniform - normal + np.minimum(occam - log(_ROTATIONS), 0.0) - fit
    if chosen_of is None:
        return np.asarray(evidence)
    of = chosen_of.sum(axis=(1, 2))
    return np.asarray(evidence - gammaln(of + 1) + gammaln(count + 1) + gammaln(of - count + 1))


def votes_of(
    t_s: FloatArray, evidence: FloatArray, sound: BoolArray, wrong: FloatArray | None
) -> FloatArray:
    """Return the weights of epochs in votes on integers of their arcs, (n,), from 0 to 1.

    Full where the epoch alone leaves a chance of 1e-3 that its integers are wrong, by its evidence
    or by what the resolver states; in between as the logarithm of the odds. Epochs so far apart
    that they err independently agree on wrong integers by chance alone, so a sound one counts in
    full a correlation time after the one before.

    Parameters
    ----------
    t_s : ndarray, shape (n,)
    evidence : ndarray, shape (n,)
    sound : ndarray of bool, shape (n,)
        Whose integers, as resolved, pass the chi-square test.
    wrong : ndarray, shape (n,), or None
        As stated by the resolver.
    """
    odds = evidence
    if wrong is not None:
        chance = wrong.clip(1e-300, 1 - 1e-16)
        odds = np.where(sound, np.maximum(odds, np.log1p(-chance) - np.log(chance)), odds)
    apart = np.where(sound, np.diff(t_s, prepend=t_s[:1]) / APART_S, 0.0)
    return np.asarray(np.maximum(odds / BELIEVED_LOG_ODDS, apart).clip(0.0, 1.0))
