"""How large noise really is, learned from the integers' own search, before any is accepted.

A probability means what it says only as far as the noise model does, and stated noise is often two
or three times off. Expectation maximisation [1]_ finds the variance factors of code and phase under
which the recorded epochs are most likely, summed over all integer candidates of each epoch: no
candidate has to be believed for that. The stated noise enters as a few measurements more.

References
----------
.. [1] A. P. Dempster, N. M. Laird, D. B. Rubin, "Maximum likelihood from incomplete data via the EM
   algorithm", J. Royal Statistical Society B 39, 1977.
"""

from dataclasses import fields, replace

import numpy as np

from fgnav.checks import IntArray
from fgnav.gnss.differences import DoubleDifferences
from fgnav.integers.constrained_search import PROVEN, search_constrained

_ENOUGH = 30  # epochs
_SAMPLE = 200  # epochs, spread evenly: variance factors to 3 %
_STATED = 10.0  # double differences that the stated noise counts as
_ROUNDS = 30
_SETTLED = 0.01  # relative change of a variance factor


def with_estimated_noise(differences: DoubleDifferences, nodes: int) -> DoubleDifferences:
    """Return the same differences with code and phase variances as large as the data show.

    As they are, where fewer than 30 epochs have links.

    Parameters
    ----------
    differences : DoubleDifferences
    nodes : int
        What the search of an epoch may visit.
    """
    there = np.flatnonzero(differences.resolvable.any(axis=(1, 2)))
    if len(there) < _ENOUGH:
        return differences
    pick = np.linspace(0, len(there) - 1, min(_SAMPLE, len(there)))
    sample = _epochs_of(differences, there[pick.astype(np.int64)])
    code, phase = 1.0, 1.0
    for _ in range(_ROUNDS):
        found = search_constrained(_scaled(sample, code, phase), nodes)
        sound = found.status == PROVEN
        links = sample.resolvable.sum(axis=(1, 2))[sound]
        of_code = found.expected[sound, 0].sum() * code
        of_phase = found.expected[sound, 1].sum() * phase
        before = np.array([code, phase])
        # attitude costs degrees of freedom of phase alone: next to it code says nothing of it
        code = (_STATED + of_code) / (_STATED + links.sum())
        phase = (_STATED + of_phase) / (_STATED + (found.degrees[sound] - links).sum())
        if (np.abs(np.array([code, phase]) - before) < _SETTLED * before).all():
            break
    return _scaled(differences, code, phase)


def _scaled(differences: DoubleDifferences, code: float, phase: float) -> DoubleDifferences:
    return replace(
        differences,
        code_variance_m2=differences.code_variance_m2 * code,
        phase_variance_m2=differences.phase_variance_m2 * phase,
    )


def _epochs_of(differences: DoubleDifferences, epochs: IntArray) -> DoubleDifferences:
    n = len(differences.t_s)
    of_channel = {"satellites", "signals", "wavelength_m", "group", "baselines_b_m", "losses"}
    parts = {
        field.name: getattr(differences, field.name)[epochs]
        for field in fields(differences)
        if field.name not in of_channel and len(getattr(differences, field.name)) == n
    }
    return replace(differences, **parts)
