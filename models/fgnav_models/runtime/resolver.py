"""``--integers network``: the constrained search proposes, a network says how sure it is."""

from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, Loss
from fgnav.integers.array.candidates import Candidates, candidates
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.integers.snooping import touched
from fgnav.integers.validation import WITHOUT_CODE, not_fixed, phase_links
from fgnav.neural.integers import integer_answers
from fgnav.neural.manifest import Statistic
from fgnav.neural.measures import Sensor
from fgnav.neural.network import Network as Contracted
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers
from fgnav_models.runtime.load import for_resolver
from fgnav_models.trust_features import (
    LINK_FEATURES,
    WHOLE_FEATURES,
    links_of,
    probabilities,
    trust_rows,
)

# Of each candidate of a search, ``fgnav_models.trust_features.trust_rows``.
GIVEN = {
    "residuals of links": Sensor("1", "none", LINK_FEATURES),
    "links that are there": Sensor("1", "none", 1),
    "candidate": Sensor("1", "none", WHOLE_FEATURES),
}
FIGURES = (
    "antennas",
    "satellites",
    "groups",
    "phase_sigma_m",
    "code_sigma_m",
    "sigma_ratio",
    "baseline_m",
    "misfit",
)
_ENOUGH = 30  # epochs whose median residual tells how well the noise is stated


class Trust(NamedTuple):
    """What the network makes of some epochs."""

    cycles: IntArray  # (n, b, m): of the likeliest candidate
    wrong_probability: FloatArray  # (n,)
    ratio: FloatArray  # (n,): second-least over least cost
    outlier: FloatArray  # (n, b + 1, m): probability of a link to be worse than stated
    misfit: FloatArray  # (n,): least cost per degree of freedom


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """Integers of the constrained search, accepted by a network's calibrated probability.

    Epochs outside what the network was trained on go to ``fallback``, and a loss says how many.
    """

    # largest probability that an accepted epoch's integers are not all right
    wrong_max: float = 1e-3
    outlier_max: float = 0.95  # a link more likely than this to be worse than stated is not fixed
    nodes: int = 10**6  # what the search of an epoch may visit
    model: str = "trust"  # a released network, or the path of a manifest
    fallback: Constrained = field(default_factory=Constrained)

    def __post_init__(self) -> None:
        """Reject thresholds that are no probabilities."""
        for name, value in {"wrong_max": self.wrong_max, "outlier_max": self.outlier_max}.items():
            if not 0.0 < value < 1.0:
                raise BadInputError(f"{name}: must be between 0 and 1, got {value}")

    @property
    def name(self) -> str:
        """Return the name the command line knows."""
        return "network"

    def __call__(self, differences: DoubleDifferences, flight: Flight) -> Integers:
        """Resolve every epoch that has code and phase.

        Raises
        ------
        BadInputError
            If onnxruntime is missing or the network's file is not the released one.
        """
        network = _loaded(self.model)
        outside = outside_domain(differences, network.manifest.domain)
        out = np.array([bool(text) for text in outside])
        if out.all():
            return self._beyond(differences, flight, np.arange(len(out)), outside)
        inside, at = np.flatnonzero(~out), np.flatnonzero(out)
        some = differences.resampled(inside) if len(at) else differences
        trust = trusted(some, network, nodes=self.nodes)
        misfit = next(one for one in network.manifest.domain if one.name == "misfit")
        median = np.asarray(np.median(trust.misfit))
        if len(inside) >= _ENOUGH and not misfit.holds(median):
            outside = (f"median {misfit.beyond}, {median:.2g}",) * len(out)
            return self._beyond(differences, flight, np.arange(len(out)), outside)
        own = self._accepted(some, trust)
        if not len(at):
            return own
        other = self._beyond(differences.resampled(at), flight, at, outside)
        return _merged(len(out), (inside, own), (at, other), self.name)

    def _accepted(self, differences: DoubleDifferences, trust: Trust) -> Integers:
        links = differences.resolvable
        is_present = links.any(axis=(1, 2))
        sure = is_present & (trust.wrong_probability <= self.wrong_max)
        bad = touched(differences, np.arange(len(sure)), trust.outlier > self.outlier_max) & links
        doubt = f"probability of wrong integers above {self.wrong_max:g} by the network"
        worse = "part of a link that the network takes for worse than stated"
        fixed = links & sure[:, None, None] & ~bad
        reasons = np.where(is_present, "", "no link with code and phase").astype(object)
        reasons[sure & bad.any(axis=(1, 2))] = worse
        reasons[is_present & ~sure] = doubt
        missing = {
            WITHOUT_CODE: phase_links(differences) & ~links,
            doubt: links & ~sure[:, None, None],
            worse: links & sure[:, None, None] & bad,
        }
        return Integers(
            resolver=self.name,
            cycles=np.where(fixed, trust.cycles, 0),
            fixed=fixed,
            ratio=np.where(links.any(axis=2), trust.ratio[:, None], np.nan),
            wrong_probability=trust.wrong_probability,
            reasons=tuple(reasons.tolist()),
            losses=not_fixed(missing),
        )

    def _beyond(
        self,
        differences: DoubleDifferences,
        flight: Flight,
        at: IntArray,
        outside: tuple[str, ...],
    ) -> Integers:
        """Return what the fallback makes of epochs outside the domain, and say so."""
        found = self.fallback(differences, flight)
        texts, counts = np.unique([outside[k] for k in at], return_counts=True)
        losses = [
            Loss(
                what="epoch's trust",
                reason=f"{text}, the network's training domain: left to {self.fallback.name}",
                count=int(count),
            )
            for text, count in zip(texts, counts, strict=True)
        ]
        return Integers(
            resolver=self.name,
            cycles=found.cycles,
            fixed=found.fixed,
            ratio=found.ratio,
            wrong_probability=found.wrong_probability,
            reasons=found.reasons,
            losses=(*losses, *found.losses),
        )


def outside_domain(
    differences: DoubleDifferences, domain: tuple[Statistic, ...]
) -> tuple[str, ...]:
    """Return why each epoch is not what the network was trained on, length n; empty where it is.

    Parameters
    ----------
    domain : tuple of Statistic
        Of the network's manifest.
    """
    links = links_of(differences)
    antennas, used = np.asarray(links.any(axis=2)), np.asarray(links.any(axis=1))
    groups = differences.group == np.arange(differences.reference.shape[1])[:, None]
    length_m = np.linalg.norm(differences.baselines_b_m, axis=1)
    is_present = links.any(axis=(1, 2))
    phase_m = _range(np.sqrt(differences.phase_variance_m2), used)
    code_m = _range(np.sqrt(differences.code_variance_m2), used)
    texts = np.full(len(links), "", dtype=object)
    counted = {
        "antennas": (antennas.sum(axis=1),) * 2,
        "satellites": (used.sum(axis=1),) * 2,
        "groups": ((used[:, None] & groups).any(axis=2).sum(axis=1),) * 2,
        "phase_sigma_m": (phase_m[0],) * 2,
        "code_sigma_m": (code_m[0],) * 2,
        "sigma_ratio": (np.ones(len(links)), np.maximum(*(v[1] / v[0] for v in (phase_m, code_m)))),
        "baseline_m": _range(np.broadcast_to(length_m, antennas[:, 1:].shape), antennas[:, 1:]),
    }
    for one in domain:
        if one.name in counted:
            least, most = counted[one.name]
            texts[is_present & ~(one.holds(least) & one.holds(most)) & (texts == "")] = one.beyond
    return tuple(texts.tolist())


def trusted(differences: DoubleDifferences, network: Contracted, *, nodes: int) -> Trust:
    """Return the likeliest integers of each epoch, and how likely they are wrong.

    Parameters
    ----------
    differences : DoubleDifferences
        Within the network's domain.
    network : fgnav.neural.network.Network
    nodes : int
        What the search of an epoch may visit.
    """
    n, b, m = differences.phase_m.shape
    found = candidates(differences, nodes=nodes)
    rows = trust_rows(differences, found)
    wrong, cycles = np.ones(n), np.zeros((n, b, m), dtype=np.int64)
    outlier = np.zeros((n, (b + 1) * m))
    ratio, misfit = _costs(differences, found)
    if not len(found.epoch):
        return Trust(cycles, wrong, ratio, outlier.reshape(n, b + 1, m), misfit)
    answers = integer_answers(
        network, [rows.links, rows.is_present[:, :, None], rows.whole[:, None]]
    )
    if answers.sure is None or answers.outlier is None:
        raise BadInputError(
            f"{network.path}: key output.outlier: is missing; name the graph's output that says "
            "which links are worse than stated"
        )
    probability, _, best = probabilities(answers.value[:, 0], answers.sure[:, 0], found.epoch, n)
    some = np.flatnonzero(best >= 0)
    top = best[some]
    wrong[some] = np.where(answers.within[top], np.clip(1.0 - probability[top], 0.0, 1.0), 1.0)
    cycles[some] = found.cycles[top]
    slot = rows.slot[some]
    at, place = np.nonzero(slot >= 0)
    outlier[some[at], slot[at, place]] = 1.0 / (1.0 + np.exp(-answers.outlier[top][at, place]))
    return Trust(cycles, wrong, ratio, outlier.reshape(n, b + 1, m), misfit)


def _costs(differences: DoubleDifferences, found: Candidates) -> tuple[FloatArray, FloatArray]:
    """Return second-least over least cost, and least cost per degree of freedom, (n,)."""
    n = len(differences.t_s)
    degrees = np.maximum(2 * differences.resolvable.sum(axis=(1, 2)) - 3, 1)
    first = np.searchsorted(found.epoch, np.arange(n + 1))
    number = np.diff(first)
    ratio, misfit = np.full(n, np.nan), np.ones(n)
    some, two = np.flatnonzero(number > 0), np.flatnonzero(number > 1)
    misfit[some] = found.cost[first[some]] / degrees[some]
    ratio[two] = found.cost[first[two] + 1] / np.maximum(found.cost[first[two]], 1e-30)
    return ratio, misfit


def _range(value: FloatArray, is_present: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return least and largest value of each epoch, (n,): 1 where there is none."""
    least = np.where(is_present, value, np.inf).min(axis=1, initial=np.inf)
    most = np.where(is_present, value, -np.inf).max(axis=1, initial=-np.inf)
    some = is_present.any(axis=1)
    return np.where(some, least, 1.0), np.where(some, most, 1.0)


def _merged(
    n: int, one: tuple[IntArray, Integers], other: tuple[IntArray, Integers], name: str
) -> Integers:
    """Return the integers of two sets of epochs as those of all."""
    b, m = one[1].cycles.shape[1:]
    cycles, fixed = np.zeros((n, b, m), dtype=np.int64), np.zeros((n, b, m), dtype=np.bool_)
    ratio, wrong = np.full((n, b), np.nan), np.ones(n)
    reasons = np.full(n, "", dtype=object)
    for at, part in (one, other):
        cycles[at], fixed[at], ratio[at] = part.cycles, part.fixed, part.ratio
        if part.wrong_probability is not None:
            wrong[at] = part.wrong_probability
        if part.reasons is not None:
            reasons[at] = part.reasons
    return Integers(
        resolver=name,
        cycles=cycles,
        fixed=fixed,
        ratio=ratio,
        wrong_probability=wrong,
        reasons=tuple(reasons.tolist()),
        losses=(*one[1].losses, *other[1].losses),
    )


@cache
def _loaded(model: str) -> Contracted:
    return for_resolver(model, GIVEN, {"posterior"}, set(FIGURES))
