"""Integers of a rigid array, of least constrained cost, accepted by their chance to be wrong."""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from fgnav.checks import BadInputError
from fgnav.flight import Flight
from fgnav.gnss.differences import DoubleDifferences
from fgnav.integers.constrained_noise import with_estimated_noise
from fgnav.integers.constrained_search import (
    ILL,
    PROVEN,
    UNFINISHED,
    UNPROVEN,
    search_constrained,
)
from fgnav.integers.resolver import Integers
from fgnav.integers.validation import WITHOUT_CODE, not_fixed, phase_links


@dataclass(frozen=True, slots=True, kw_only=True)
class Constrained:
    """Integer least squares under the known shape of the array, one epoch at a time.

    Three or more antennas that span a plane turn as one rotation; two, or several in a line, keep
    their length. The whole epoch is fixed or refused together.

    Attributes
    ----------
    wrong_max : float or None
        Epochs whose integers are wrong with a higher probability are refused; None accepts all.
    tail : float or None
        Epochs whose residuals after fixing are larger than noise makes them in this share of epochs
        are refused; None accepts all.
    estimate_noise : bool
        Scale code and phase variances to what the epochs themselves show; the probabilities then
        hold for receivers better or worse than stated. Fewer than 30 epochs are taken as stated.
    nodes : int
        What the search of an epoch may visit before it is given up: a tenth of a second.
    """

    wrong_max: float | None = 1e-3
    tail: float | None = 1e-4
    estimate_noise: bool = True
    nodes: int = 10**6

    def __post_init__(self) -> None:
        """Reject thresholds that are no probabilities."""
        for name, value in {"wrong_max": self.wrong_max, "tail": self.tail}.items():
            if value is not None and not 0.0 < value < 1.0:
                raise BadInputError(f"{name}: must be between 0 and 1, or None, got {value}")
        if self.nodes < 1:
            raise BadInputError(f"nodes: must be 1 or more, got {self.nodes}")

    @property
    def name(self) -> str:
        """Return the name the command line knows."""
        return "constrained"

    def __call__(self, differences: DoubleDifferences, flight: Flight) -> Integers:  # noqa: ARG002
        """Resolve every epoch that has code and phase."""
        if self.estimate_noise:
            differences = with_estimated_noise(differences, self.nodes)
        found = search_constrained(differences, self.nodes)
        links = differences.resolvable
        accepted = found.status == PROVEN
        refused = {
            "integer search given up before anything fitted": found.status == UNFINISHED,
            "integer search given up before its best was proven": found.status == UNPROVEN,
            "covariance of the float solution is not positive definite": found.status == ILL,
        }
        if self.tail is not None:
            cost = np.where(accepted, found.costs[:, 0], 0.0)
            fits = chdtrc(np.maximum(found.degrees, 1), cost) >= self.tail
            refused[f"residuals of the array above chi-square at {self.tail:g}"] = accepted & ~fits
            accepted = accepted & fits
        if self.wrong_max is not None:
            unsure = accepted & ~(found.wrong_probability <= self.wrong_max)
            refused[f"probability of wrong integers above {self.wrong_max:g}"] = unsure
            accepted = accepted & ~unsure
        fixed = links & accepted[:, None, None]
        reasons = {reason: links & there[:, None, None] for reason, there in refused.items()}
        second = np.where(np.isfinite(found.costs[:, 1]), found.costs[:, 1], np.nan)
        ratio = (second / np.maximum(found.costs[:, 0], 1e-30))[:, None]
        return Integers(
            resolver=self.name,
            cycles=np.where(fixed, found.cycles, 0),
            fixed=fixed,
            ratio=np.where(links.any(axis=2), ratio, np.nan),
            wrong_probability=found.wrong_probability,
            losses=not_fixed({WITHOUT_CODE: phase_links(differences) & ~links, **reasons}),
        )
