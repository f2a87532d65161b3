"""What the trust network sees of integer candidates: residuals of links, and figures of the whole.

Residuals are those of undifferenced links, freed of whatever each antenna and each satellite of a
group could have added, as double differences are: once by least squares, once by
``fgnav_models.trust_fit``. Nothing here knows order, number or reference of antennas and of
satellites, nor place and time.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.integers.array.candidates import Candidates
from fgnav.integers.array.search import PROVEN
from fgnav.integers.ils.array_model import link_arrays
from fgnav.types.differences import DoubleDifferences
from fgnav_models.trust_kernel import (
    CANDIDATE_FEATURES,
    EPOCH_FEATURES,
    LINK_FEATURES,
    Proposed,
    candidate_rows,
    epoch_features,
    links_of_epochs,
    posteriors_of,
    slots,
)

__all__ = [
    "LINK_FEATURES",
    "SATELLITES",
    "WHOLE_FEATURES",
    "TrustRows",
    "links_of",
    "probabilities",
    "trust_rows",
]

WHOLE_FEATURES = CANDIDATE_FEATURES + EPOCH_FEATURES
SATELLITES = CANDIDATE_FEATURES + 1  # among the whole: an epoch's satellites, by 8


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class TrustRows:
    """One row per candidate."""

    epoch: IntArray  # (c,)
    # (c, l, LINK_FEATURES); links that are there, antenna by antenna; 0 beyond the last
    links: FloatArray
    is_present: FloatArray  # (c, l); 1 where a row of ``links`` counts
    # (c, WHOLE_FEATURES); the first is the logarithm of the candidate's posterior, were links as
    # ``trust_fit`` has it
    whole: FloatArray
    # (n, l); antenna and channel of a link, ``antenna m + channel``; -1 beyond the last
    slot: IntArray


def links_of(differences: DoubleDifferences) -> BoolArray:
    """Return the undifferenced links, (n, b + 1, m), behind the resolvable double differences."""
    of_reference = np.ascontiguousarray(differences.reference[:, differences.group])
    return links_of_epochs(differences.resolvable, of_reference)


def trust_rows(differences: DoubleDifferences, found: Candidates) -> TrustRows:
    """Return the network's inputs for every candidate of the epochs.

    Parameters
    ----------
    found : Candidates
        Of the same differences.
    """
    epochs, epoch, group = link_arrays(differences), found.epoch, differences.group
    links = links_of_epochs(epochs.resolvable, epochs.of_reference)
    slot = slots(links)
    proposed = Proposed(epoch, found.cycles, found.baselines_n_m, found.cost, found.log_volume)
    sine = np.sin(differences.elevation_rad)
    own, mask, figures = candidate_rows(epochs, sine, group, proposed, slot)
    groups = (differences.reference >= 0).sum(axis=1)
    of_epoch = epoch_features(
        epochs, differences.baselines_b_m, found.status == PROVEN, groups, links
    )
    whole = np.concatenate([figures, of_epoch[epoch]], axis=1)
    return TrustRows(epoch=epoch, links=own, is_present=mask, whole=whole, slot=slot)


def probabilities(
    score: FloatArray, none: FloatArray, epoch: IntArray, epochs: int
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return posteriors of candidates, (c,), of none of them, (n,), and the best rows, (n,).

    Parameters
    ----------
    score, none : ndarray, shape (c,)
        The network's; of ``none`` the first row of each epoch counts.
    epoch : ndarray of int, shape (c,)
        Rising.
    epochs : int
        Those without a row have none for certain, and best row -1.
    """
    return posteriors_of(score, none, epoch, epochs)
