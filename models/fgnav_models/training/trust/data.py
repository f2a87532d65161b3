"""Epochs for the trust network: drawn from many worlds, searched, and told right from wrong."""

from dataclasses import dataclass, fields, replace

import msgspec
import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.integers.array.candidates import candidates
from fgnav_models.trust_features import SATELLITES, TrustRows, links_of, trust_rows
from fgnav_sim.data_sets.differences import double_differences_of, true_cycles
from fgnav_sim.data_sets.epochs import array_epochs
from fgnav_sim.data_sets.world import GivenArray, OutliersTable, RandomArray, World

NONE = -1  # truth of an epoch whose true integers were not found


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class TrustSamples:
    """Rows of the network for epochs whose truth is known."""

    start: IntArray  # (n + 1,); first row of each epoch, and the number of all
    # (n,); the true candidate, counted within its epoch; ``NONE`` where it is not among them
    truth: IntArray
    # links, is_present, whole: as in ``TrustRows``
    links: FloatArray
    is_present: FloatArray
    whole: FloatArray
    outlier: FloatArray  # (c, l); links worse than stated
    # cost, degrees: (n,); least cost of an epoch, and its degrees of freedom
    cost: FloatArray
    degrees: IntArray

    def __len__(self) -> int:
        """Return the number of epochs."""
        return len(self.truth)

    @property
    def satellites(self) -> IntArray:
        """How many an epoch has, (n,); 0 where it has no candidate."""
        out = np.zeros(len(self), dtype=np.int64)
        some = np.diff(self.start) > 0
        out[some] = np.rint(8.0 * self.whole[self.start[:-1][some], SATELLITES])
        return out

    def chosen(self, epochs: BoolArray) -> "TrustSamples":
        """Return some of the epochs, (n,)."""
        number = np.diff(self.start)
        rows = np.repeat(epochs, number)
        return TrustSamples(
            start=np.append(0, np.cumsum(number[epochs])),
            truth=self.truth[epochs],
            links=self.links[rows],
            is_present=self.is_present[rows],
            whole=self.whole[rows],
            outlier=self.outlier[rows],
            cost=self.cost[epochs],
            degrees=self.degrees[epochs],
        )


def samples_of(
    world: World, rng: np.random.Generator, count: int, *, nodes: int, stated: float = 1.0
) -> TrustSamples:
    """Return epochs of a world with one array, their candidates and their truth.

    Parameters
    ----------
    world : World
        With a given array.
    nodes : int
        What the search of an epoch may visit.
    stated : float
        Stated over true standard deviation of noise.
    """
    drawn = array_epochs(world, rng, count)
    differences = double_differences_of(drawn)
    differences = replace(
        differences,
        code_variance_m2=differences.code_variance_m2 * stated**2,
        phase_variance_m2=differences.phase_variance_m2 * stated**2,
    )
    found = candidates(differences, nodes=nodes)
    rows = trust_rows(differences, found)
    true = true_cycles(drawn, differences)
    start = np.searchsorted(found.epoch, np.arange(count + 1))
    right = np.flatnonzero((found.cycles == true[found.epoch]).all(axis=(1, 2)))
    truth = np.full(count, NONE)
    truth[found.epoch[right]] = right - start[found.epoch[right]]
    some = np.diff(start) > 0
    least = np.full(count, np.nan)
    least[some] = found.cost[start[:-1][some]]
    return TrustSamples(
        start=start,
        truth=truth,
        links=rows.links,
        is_present=rows.is_present,
        whole=rows.whole,
        outlier=_outliers(drawn.outlier & links_of(differences), rows),
        cost=least,
        degrees=2 * differences.resolvable.sum(axis=(1, 2)) - 3,
    )


def _outliers(outlier: BoolArray, rows: TrustRows) -> FloatArray:
    flat = outlier.reshape(len(outlier), -1)
    own = np.take_along_axis(flat, rows.slot.clip(0), axis=1) & (rows.slot >= 0)
    return np.asarray(own[rows.epoch], dtype=np.float32)


def joined(parts: list[TrustSamples]) -> TrustSamples:
    """Return several sets as one, links padded to the longest."""
    length = max(part.is_present.shape[1] for part in parts)
    rows = np.cumsum([0, *(part.start[-1] for part in parts)])
    starts = [part.start[:-1] + first for part, first in zip(parts, rows[:-1], strict=True)]
    out = {"start": np.append(np.concatenate(starts), rows[-1])}
    for field in fields(TrustSamples):
        name = field.name
        if name == "start":
            continue
        values = [getattr(part, name) for part in parts]
        if name in ("links", "is_present", "outlier"):
            values = [_padded(value, length) for value in values]
        out[name] = np.concatenate(values)
    return TrustSamples(**out)


def _padded(value: FloatArray, length: int) -> FloatArray:
    width = [(0, 0), (0, length - value.shape[1]), *[(0, 0)] * (value.ndim - 2)]
    return np.pad(value, width)


def random_world(
    world: World, array: RandomArray, outliers: tuple[float, float], rng: np.random.Generator
) -> World:
    """Return a world with one array drawn, as ``RandomArray`` says, and its own share of outliers.

    Parameters
    ----------
    array : RandomArray
    outliers : tuple of float
        Range of the share of links worse than stated; a quarter of worlds have none.
    """
    number = int(rng.integers(*array.antennas, endpoint=True))
    box = rng.uniform(*array.scale) * np.array(array.box_m)
    antennas_b_m = box * rng.uniform(-0.5, 0.5, (number, 3))
    antennas_b_m[0] = 0.0
    share = float(rng.uniform(*outliers)) if rng.random() > 0.25 else 0.0
    return msgspec.structs.replace(
        world,
        array=GivenArray(antennas_b_m=tuple(map(tuple, antennas_b_m.tolist()))),
        outliers=OutliersTable(share=share) if share > 0.0 else None,
    )
