"""``--integers network``: the constrained search proposes, a network says how sure it is."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import NamedTuple

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, Unused
from fgnav.integers.acceptance import HANDED_OVER, WITHOUT_CODE, not_fixed, phase_links
from fgnav.integers.arcs.resolver import Arcs, noise_as_shown
from fgnav.integers.array.candidates import Candidates, candidates
from fgnav.integers.array.noise import with_estimated_noise
from fgnav.integers.identification import touched
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.neural.integers import integer_answers
from fgnav.neural.manifest import Statistic
from fgnav.neural.measures import Sensor
from fgnav.neural.network import Network as Contracted
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers, joined
from fgnav_models.runtime.load import for_resolver
from fgnav_models.trust_features import (
    FEATURES,
    OUTLIER,
    links_of,
    trust_rows,
)

# Of each candidate of a search, ``fgnav_models.trust_features.trust_rows``.
GIVEN = {"candidate": Sensor("1", "none", FEATURES)}
FIGURES = (
    "antennas",
    "satellites",
    "groups",
    "phase_sigma_m",
    "code_sigma_m",
    "sigma_ratio",
    "baseline_m",
)
_NEARLY_ALL = 1.0 - 1e-9  # of a probability: arcs choose by what the network states


def network_arcs() -> Arcs:
    """Integers from slip to slip: of each arc those of the epoch that the network trusts most.

    Of a pair of antennas the network trusts few epochs, which ``constrained`` fixes rightly.
    """
    fallback = Constrained(wrong_max=None, estimate_noise=False)
    inner = Network(wrong_max=_NEARLY_ALL, fallback=fallback, fewest_antennas=3)
    return Arcs(inner=inner, prepare=noise_as_shown)


class Trust(NamedTuple):
    """Integers and probabilities of some epochs by the network."""

    cycles: IntArray  # (n, b, m): of the likeliest candidate
    wrong_probability: FloatArray  # (n,): of any integer that no worse link takes part in
    ratio: FloatArray  # (n,): second-least over least cost
    bad: BoolArray  # (n, b, m): differences that a link worse than stated takes part in


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """Integers of the constrained search, accepted by a network's calibrated probability.

    Epochs outside what the network was trained on go to ``fallback``, and a loss says how many.
    Noise is estimated, and the search limited, as ``fallback`` has it.
    """

    # largest probability that an accepted epoch's integers are not all right
    wrong_max: float = 1e-3
    model: str = "trust"  # a released network, or the path of a manifest
    fallback: Constrained = field(default_factory=Constrained)
    fewest_antennas: int = 2  # of an array; epochs of smaller ones go to ``fallback``
    causal: bool = False  # each epoch by epochs up to it alone, as ``fallback`` then is

    def __post_init__(self) -> None:
        """Reject what is no probability."""
        if not 0.0 < self.wrong_max < 1.0:
            raise BadInputError(f"wrong_max: must be between 0 and 1, got {self.wrong_max}")

    @property
    def name(self) -> str:
        """Return the name the command line knows."""
        return "network"

    @property
    def looks_ahead(self) -> bool:
        """Return True if the noise, or the fallback's acceptance, is of the whole flight."""
        return not self.causal

    def __call__(self, differences: DoubleDifferences, flight: Flight) -> Integers:
        """Resolve every epoch that has code and phase.

        Raises
        ------
        BadInputError
            If onnxruntime is missing or the network's file is not the released one.
        """
        network = _loaded(self.model)
        if self.fallback.estimate_noise:
            nodes = self.fallback.nodes
            differences = with_estimated_noise(differences, nodes, causal=self.causal)
        outside = outside_domain(differences, network.manifest.domain)
        if differences.phase_m.shape[1] + 1 < self.fewest_antennas:
            outside = (f"fewer than {self.fewest_antennas} antennas",) * len(outside)
        out = np.array([bool(text) for text in outside], dtype=np.bool_)
        if out.all():
            return self._beyond(differences, flight, outside)
        if not out.any():
            return self._accepted(differences, network)
        inside, at = np.flatnonzero(~out), np.flatnonzero(out)
        accepted = self._accepted(differences.resampled(inside), network)
        texts = tuple(outside[k] for k in at)
        others = self._beyond(differences.resampled(at), flight, texts)
        order = np.argsort(np.concatenate([inside, at]))
        return joined(self.name, (accepted, others), order)

    def _accepted(self, differences: DoubleDifferences, network: Contracted) -> Integers:
        trust = trusted(differences, network, nodes=self.fallback.nodes)
        links = differences.resolvable
        is_present = links.any(axis=(1, 2))
        sure = is_present & (trust.wrong_probability <= self.wrong_max)
        bad = trust.bad & links
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
            unused=not_fixed(missing),
        )

    def _beyond(
        self, differences: DoubleDifferences, flight: Flight, outside: tuple[str, ...]
    ) -> Integers:
        """Resolve epochs outside the domain by the fallback, and report it."""
        fallback = replace(self.fallback, estimate_noise=False, causal=self.causal)
        integers = fallback(differences, flight)
        unused = [
            Unused(
                what=HANDED_OVER,
                reason=f"{text}, the network's training domain: left to {fallback.name}",
                count=outside.count(text),
            )
            for text in sorted(set(outside))
        ]
        return replace(integers, resolver=self.name, unused=(*unused, *integers.unused))


def handed_over(integers: Integers) -> Mapping[str, int]:
    """Count the epochs outside the network's domain, by reason."""
    return {loss.reason: loss.count for loss in integers.unused if loss.what == HANDED_OVER}


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
    names = np.array(differences.satellites)
    satellites = sum(used[:, names == name].any(axis=1).astype(int) for name in np.unique(names))
    groups = differences.group == np.arange(differences.reference.shape[1])[:, None]
    length_m = np.linalg.norm(differences.baselines_b_m, axis=1)
    is_present = links.any(axis=(1, 2))
    phase_m = _range(np.sqrt(differences.phase_variance_m2), used)
    code_m = _range(np.sqrt(differences.code_variance_m2), used)
    texts = np.full(len(links), "", dtype=object)
    counted = {
        "antennas": (antennas.sum(axis=1),) * 2,
        "satellites": (np.asarray(satellites),) * 2,
        "groups": ((used[:, None] & groups).any(axis=2).sum(axis=1),) * 2,
        "phase_sigma_m": (phase_m[0],) * 2,
        "code_sigma_m": (code_m[0],) * 2,
        "sigma_ratio": (np.ones(len(links)), np.maximum(*(v[1] / v[0] for v in (phase_m, code_m)))),
        "baseline_m": _range(np.broadcast_to(length_m, antennas[:, 1:].shape), antennas[:, 1:]),
    }
    for figure in domain:
        lowest, most = counted[figure.name]
        beyond = is_present & ~(figure.holds(lowest) & figure.holds(most))
        texts[beyond & (texts == "")] = figure.beyond
    return tuple(texts.tolist())


def trusted(differences: DoubleDifferences, network: Contracted, *, nodes: int) -> Trust:
    """Return the likeliest integers of each epoch, and how likely they are wrong.

    Candidates that differ only where a worse link takes part share their probability.

    Parameters
    ----------
    differences : DoubleDifferences
        Within the network's domain.
    network : fgnav.neural.network.Network
    nodes : int
        What the search of an epoch may visit.
    """
    n, b, m = differences.phase_m.shape
    listed = candidates(differences, nodes=nodes)
    wrong, cycles = np.ones(n), np.zeros((n, b, m), dtype=np.int64)
    worse, ratio = np.zeros((n, b + 1, m), dtype=np.bool_), _ratio(n, listed)
    if not len(listed.epoch):
        return Trust(cycles, wrong, ratio, np.zeros((n, b, m), dtype=np.bool_))
    rows = trust_rows(differences, listed)
    answers = integer_answers(network, [rows.features[:, None]])
    assert answers.sure is not None  # noqa: S101  # of the form ``posterior``
    probability, _, best = posteriors(answers.value[:, 0], answers.sure[:, 0], listed.epoch, n)
    some = np.flatnonzero(best >= 0)
    top = best[some]
    cycles[some] = listed.cycles[top]
    worse[some] = rows.worse[top] > OUTLIER
    bad = touched(differences, worse)
    agrees = ((listed.cycles == cycles[listed.epoch]) | bad[listed.epoch]).all(axis=(1, 2))
    right = np.bincount(listed.epoch, probability * agrees, n)
    wrong[some] = np.where(answers.within[top], np.clip(1.0 - right[some], 0.0, 1.0), 1.0)
    return Trust(cycles, wrong, ratio, bad)


def posteriors(
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
    some, first = np.unique(epoch, return_index=True)
    of_none, largest = np.ones(epochs), np.zeros(epochs)
    largest[some] = np.maximum(np.maximum.reduceat(score, first), none[first])
    weight = np.exp(score - largest[epoch])
    of_none[some] = np.exp(none[first] - largest[some])
    total = of_none + np.bincount(epoch, weight, epochs)
    best = np.full(epochs, -1)
    order = np.lexsort((score, epoch))
    best[some] = order[np.append(first[1:], len(order)) - 1]
    return weight / total[epoch], of_none / total, best


def _ratio(n: int, listed: Candidates) -> FloatArray:
    """Return second-least over least cost, (n,)."""
    first = np.searchsorted(listed.epoch, np.arange(n + 1))
    ratio, two = np.full(n, np.nan), np.flatnonzero(np.diff(first) > 1)
    ratio[two] = listed.cost[first[two] + 1] / np.maximum(listed.cost[first[two]], 1e-30)
    return ratio


def _range(value: FloatArray, is_present: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return least and largest value of each epoch, (n,): 1 where there is none."""
    lowest = np.where(is_present, value, np.inf).min(axis=1, initial=np.inf)
    most = np.where(is_present, value, -np.inf).max(axis=1, initial=-np.inf)
    some = is_present.any(axis=1)
    return np.where(some, lowest, 1.0), np.where(some, most, 1.0)


@cache
def _loaded(model: str) -> Contracted:
    return for_resolver(model, GIVEN, {"posterior"}, set(FIGURES))
