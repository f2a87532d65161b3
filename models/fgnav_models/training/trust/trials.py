"""The trust network as users run it, beside ``constrained``, in worlds it was not trained on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from scipy.stats import beta

from fgnav.checks import BoolArray, FloatArray
from fgnav.geometry.earth import Origin
from fgnav.integers.array.noise import with_estimated_noise
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Antenna, Flight
from fgnav_models.runtime.load import load
from fgnav_models.runtime.resolver import Network, outside_domain
from fgnav_models.training.order import markdown_table
from fgnav_models.training.trust.data import Draw, drawn_epochs

SURE = 0.999
_COLUMNS = {  # figures, and how the card calls them
    "epochs": "epochs",
    "accepted_percent": "accepted, %",
    "wrong": "wrong",
    "wrong_bound_percent": "at most so, %",
    "constrained_accepted_percent": "`constrained` accepts, %",
    "constrained_wrong": "wrong",
    "right_percent_at_as_many_wrong": "network right at as many wrong, %",
    "constrained_right_percent": "`constrained` right, %",
}


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Judged:
    """Results of network and ``constrained`` for epochs in the network's domain, (n,)."""

    # trust, right: probability of all integers to be right, and whether those it would fix are
    trust: FloatArray
    right: BoolArray
    # accepted, constrained, constrained_right: what each fixes, and whether that is all right
    accepted: BoolArray
    constrained: BoolArray
    constrained_right: BoolArray


def judge(draw: Draw, rng: np.random.Generator, model: Path, nodes: int) -> Judged:
    """Return verdicts on epochs of one array, the search of each limited alike."""
    differences, true = drawn_epochs(draw, rng)
    flight = flight_of(differences)
    differences = with_estimated_noise(differences, nodes)
    domain = load(model).manifest.domain
    within = np.array([not text for text in outside_domain(differences, domain)])
    within &= np.asarray(differences.resolvable.any(axis=(1, 2)))
    fallback = Constrained(estimate_noise=False, nodes=nodes)
    theirs = fallback(differences, flight)
    # all epochs, however doubtful: what is accepted of them is told by the probability
    ours = Network(model=str(model), wrong_max=1.0 - 1e-12, fallback=fallback)(differences, flight)
    right, theirs_right = (
        np.asarray(
            answer.fixed.any(axis=(1, 2))
            & ((answer.cycles == true) | ~answer.fixed).all(axis=(1, 2))
        )
        for answer in (ours, theirs)
    )
    trust = np.zeros(len(true)) if ours.wrong_probability is None else 1 - ours.wrong_probability
    return Judged(
        trust=trust[within],
        right=right[within],
        accepted=np.asarray(ours.fixed.any(axis=(1, 2)) & (trust >= SURE))[within],
        constrained=np.asarray(theirs.fixed.any(axis=(1, 2)))[within],
        constrained_right=theirs_right[within],
    )


def flight_of(differences: DoubleDifferences) -> Flight:
    """Return a flight that has the antennas and nothing else."""
    positions = np.vstack([np.zeros(3), differences.baselines_b_m])
    antennas = (Antenna(name=f"a{k + 1}", position_b_m=p) for k, p in enumerate(positions))
    origin = Origin(latitude_rad=0.0, longitude_rad=0.0, height_m=0.0)
    return Flight(name="drawn", start_gps_s=0.0, origin=origin, antennas=tuple(antennas))


def merged(parts: Sequence[Judged]) -> Judged:
    """Return verdicts of several arrays as one."""
    names = [field.name for field in fields(Judged)]
    return Judged(
        **{name: np.concatenate([getattr(block, name) for block in parts]) for name in names}
    )


def figures(judged: Judged) -> dict[str, float]:
    """Return shares in percent, with the Clopper-Pearson bound at 95 % of the wrong."""
    count, accepted = len(judged.trust), int(judged.accepted.sum())
    wrong = int((judged.accepted & ~judged.right).sum())
    allowed = int((judged.constrained & ~judged.constrained_right).sum())
    # sure epochs that are not accepted lack every link: they are no answers
    trust = np.where(judged.accepted | (judged.trust < SURE), judged.trust, 0.0)
    order = np.argsort(-trust, kind="stable")[: np.count_nonzero(trust > 0.0)]
    most = int(np.searchsorted(np.cumsum(~judged.right[order]), allowed, side="right"))
    percent = 100.0 / max(count, 1)
    return {
        "epochs": float(count),
        "accepted_percent": percent * accepted,
        "wrong": float(wrong),
        "wrong_percent": 100.0 * wrong / max(accepted, 1),
        "wrong_bound_percent": 100.0 * upper_bound(wrong, accepted),
        "constrained_accepted_percent": percent * float(judged.constrained.sum()),
        "constrained_wrong": float(allowed),
        "constrained_wrong_percent": 100.0 * allowed / max(int(judged.constrained.sum()), 1),
        "right_percent_at_as_many_wrong": percent * float(judged.right[order[:most]].sum()),
        "constrained_right_percent": percent
        * float((judged.constrained & judged.constrained_right).sum()),
    }


def upper_bound(wrong: int, count: int) -> float:
    """Return the largest share that leaves so few wrong of so many with a chance of 5 %."""
    return float(beta.ppf(0.95, wrong + 1, count - wrong)) if count > wrong else 1.0


def table(worlds: Mapping[str, Judged]) -> str:
    """Return the figures of worlds as a table, Markdown."""
    rows = [
        (name, *(f"{figures(judged)[key]:.4g}" for key in _COLUMNS))
        for name, judged in worlds.items()
    ]
    return markdown_table(("world", *_COLUMNS.values()), rows)
