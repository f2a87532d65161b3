"""Integers of a rigid array, of least constrained cost, accepted by their chance to be wrong."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.special import chdtrc

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, Unused
from fgnav.integers.acceptance import (
    WITHOUT_CODE,
    not_fixed,
    phase_links,
    ratio,
    share_so_far,
    share_threshold,
)
from fgnav.integers.array.kernel import ILL, PROVEN, UNFINISHED, UNPROVEN
from fgnav.integers.array.noise import with_estimated_noise
from fgnav.integers.array.search import ConstrainedSearch, search_constrained
from fgnav.integers.identification import Residuals, exclude_links, touched, w_tests
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers

LEFT_OUT = "left out: its residual is no noise, and without it the epoch's others are"
_APART_M = 1e-3  # an array smaller than the noise of phase constrains nothing
_GIVEN_UP = {
    "integer search given up before anything fitted": UNFINISHED,
    "integer search given up before its best was proven": UNPROVEN,
    "covariance of the float solution is not positive definite": ILL,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Constrained:
    """Integer least squares under the known shape of the array, one epoch at a time.

    Three or more antennas that span a plane turn as one rotation; two, or several in a line, keep
    their length. An epoch is fixed or refused as a whole, but for links known to be bad.

    Attributes
    ----------
    wrong_max : float or None
        Share of wrong epochs to be expected among the accepted; None accepts all. At 1e-3, of two
        antennas 1 m apart under 7 satellites, none of 4000 simulated sets whose best integers turn
        the array by more than a degree was accepted, with noise as stated or 1.5 times that, 5 %
        bad links, or multipath; chi-square alone catches a tenth at most.
    tail : float or None
        Epochs whose residuals after fixing are larger than noise makes them in this share of epochs
        are refused; None accepts all.
    links_out : int
        How many bad links, antenna to satellite, may be left out of an epoch with such residuals;
        0 refuses it at once.
    estimate_noise : bool
        Let the epochs themselves show how large code and phase variances are; the probabilities
        then hold for receivers better or worse than stated, also where few integers are sure: of
        2000 simulated epochs of three antennas under four satellites 149 were accepted, none of
        them wrong, and 137 where the noise was known. Fewer than 30 epochs, or epochs that too
        many integers fit, are taken as stated.
    nodes : int
        What the search of an epoch may visit before it is given up: a tenth of a second.
    causal : bool
        Each epoch by epochs up to it alone: noise by the first 30, 120, 480, … epochs, as stated
        until then; the share as if the flight ended with the epoch.
    """

    name: ClassVar[str] = "constrained"
    wrong_max: float | None = 1e-2
    tail: float | None = 1e-4
    links_out: int = 3
    estimate_noise: bool = True
    nodes: int = 10**6
    causal: bool = False

    def __post_init__(self) -> None:
        """Reject thresholds that are no probabilities, and counts of nothing."""
        for name, value in {"wrong_max": self.wrong_max, "tail": self.tail}.items():
            if value is not None and not 0.0 < value < 1.0:
                raise BadInputError(f"{name}: must be between 0 and 1, or None, got {value}")
        for name, least in {"nodes": 1, "links_out": 0}.items():
            count = getattr(self, name)
            if count < least:
                raise BadInputError(f"{name}: must be {least} or more, got {count}")

    @property
    def looks_ahead(self) -> bool:
        """Return True if noise or share are those of the whole flight."""
        return not self.causal and (self.estimate_noise or self.wrong_max is not None)

    def __call__(self, differences: DoubleDifferences, flight: Flight) -> Integers:
        """Resolve every epoch that has code and phase.

        Raises
        ------
        BadInputError
            If all antennas are at one place.
        """
        if np.linalg.norm(differences.baselines_b_m, axis=-1).max(initial=0.0) < _APART_M:
            raise BadInputError(
                f"flight {flight.name}: key antenna.position_b_m: all antennas are at one place, "
                "so no array constrains integers; state where they are, or take --integers lambda"
            )
        if self.estimate_noise:
            differences = with_estimated_noise(differences, self.nodes, causal=self.causal)
        sets = _Sets(
            differences,
            search_constrained(differences, self.nodes),
            np.zeros(differences.phase_m.shape, dtype=np.bool_),
            self,
        )
        sets, left_out = exclude_links(sets, differences.resolvable, self.links_out)
        searched = sets.searched
        accepted, refused = self._validated(searched, sets.fails())
        refused = {reason: affected for reason, affected in refused.items() if affected.any()}
        links = differences.resolvable
        fixed = links & accepted[:, None, None]
        lacking = fixed & sets.without_links
        fixed &= ~lacking
        reasons = {reason: links & affected[:, None, None] for reason, affected in refused.items()}
        antennas = tuple(antenna.name for antenna in flight.antennas)
        out = left_out & accepted[:, None, None]
        costs = np.where(np.isfinite(searched.costs), searched.costs, np.nan)
        return Integers(
            resolver=self.name,
            cycles=np.where(fixed, searched.cycles, 0),
            fixed=fixed,
            ratio=np.where(links.any(axis=2), ratio(costs)[:, None], np.nan),
            wrong_probability=searched.wrong_probability,
            reasons=_reasons(refused, lacking, links),
            unused=(
                *not_fixed({WITHOUT_CODE: phase_links(differences) & ~links, **reasons}),
                *_left_out_losses(differences, antennas, out),
            ),
        )

    def _validated(
        self, searched: ConstrainedSearch, spoilt: BoolArray
    ) -> tuple[BoolArray, dict[str, BoolArray]]:
        """Return the epochs accepted, (n,), and the others by reason."""
        refused = {reason: searched.status == end for reason, end in _GIVEN_UP.items()}
        accepted = (searched.status == PROVEN) & ~spoilt
        if self.tail is not None:
            refused[f"residuals of the array above chi-square at {self.tail:g}"] = spoilt
        if self.wrong_max is not None:
            wrong, sound = searched.wrong_probability, accepted.copy()
            reason = f"integers too doubtful for a share of {self.wrong_max:g} wrong"
            if self.causal:
                reason, sure = f"{reason} so far", np.zeros(len(wrong), dtype=np.bool_)
                sure[sound] = share_so_far(wrong[sound], self.wrong_max)
            else:
                sure = wrong <= -share_threshold(-wrong[sound], wrong[sound], self.wrong_max)
            refused[reason] = accepted & ~sure
            accepted = accepted & sure
        return accepted, refused


@dataclass(frozen=True, eq=False, slots=True)
class _Sets:
    """Epochs searched, some without some links."""

    differences: DoubleDifferences
    searched: ConstrainedSearch
    without_links: BoolArray  # (n, b, m): differences that links left out take part in
    resolver: Constrained

    def fails(self) -> BoolArray:
        tail, searched = self.resolver.tail, self.searched
        if tail is None:
            return np.zeros(len(searched.status), dtype=np.bool_)
        proven = searched.status == PROVEN
        cost = np.where(proven, searched.costs[:, 0], 0.0)
        return np.asarray(proven & (chdtrc(np.maximum(searched.degrees, 1), cost) < tail))

    def w_tests(self, rows: IntArray) -> FloatArray:
        selected = self.differences.resampled(rows).without_code(self.without_links[rows])
        baselines_n_m = self.searched.baselines_n_m[rows]
        at_reference = np.where(
            selected.is_reference[:, None] & (selected.phase_m == 0), 0.0, np.nan
        )
        range_m = selected.ranges_m(baselines_n_m)
        code_m = selected.code_m - range_m
        phase_m = selected.phase_m - selected.wavelength_m * self.searched.cycles[rows] - range_m
        measured = [
            Residuals(np.where(selected.resolvable, off_m, at_reference), variance_m2)
            for off_m, variance_m2 in (
                (code_m, selected.code_variance_m2),
                (phase_m, selected.phase_variance_m2),
            )
        ]
        return w_tests(selected, measured, baselines_n_m)

    def without(self, rows: IntArray, links: BoolArray) -> "_Sets":
        without_links = self.without_links.copy()
        selected = self.differences.resampled(rows)
        without_links[rows] = touched(selected, links)
        selected = selected.without_code(without_links[rows])
        searched = self.searched.with_rows(rows, search_constrained(selected, self.resolver.nodes))
        return replace(self, searched=searched, without_links=without_links)


def _left_out_losses(
    differences: DoubleDifferences, antennas: tuple[str, ...], left_out: BoolArray
) -> tuple[Unused, ...]:
    """Return a loss for every antenna and channel of which links, (n, b + 1, m), were left out.

    A double difference that lacks two such links is counted with the first.
    """
    unused, counted = [], ~differences.resolvable
    for a, j in np.argwhere(left_out.any(axis=0)):
        links = np.zeros_like(left_out)
        links[:, a, j] = left_out[:, a, j]
        lost = touched(differences, links) & ~counted
        counted = counted | lost
        # of two antennas nothing tells which one it is
        antenna = " or ".join(antennas) if len(antennas) == 2 else antennas[a]
        what = f"{antenna} {differences.satellites[j]} {differences.signals[j]} link"
        unused.append(Unused(what=what, reason=LEFT_OUT, count=int(lost.sum())))
    return tuple(unused)


def _reasons(
    refused: dict[str, BoolArray], left_out: BoolArray, links: BoolArray
) -> tuple[str, ...]:
    """Return the reason of each epoch, length n."""
    texts = [""] * len(links)
    without = {
        "no link with code and phase": ~links.any(axis=(1, 2)),
        f"a link {LEFT_OUT}": left_out.any(axis=(1, 2)),
    }
    for reason, affected in (without | refused).items():
        for k in np.flatnonzero(affected):
            texts[k] = reason
    return tuple(texts)
