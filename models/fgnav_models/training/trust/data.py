"""Epochs for the trust network: drawn from many worlds, searched, and told right from wrong."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.integers.array.candidates import candidates
from fgnav.integers.identification import touched
from fgnav.io.strict_toml import Positive, Table, Vector
from fgnav.types.differences import DoubleDifferences
from fgnav_models.trust_features import OUTLIER, trust_rows
from fgnav_sim.data_sets.differences import double_differences_of, true_cycles
from fgnav_sim.data_sets.epochs import array_epochs
from fgnav_sim.data_sets.world import (
    AnySites,
    AnyTimes,
    NoiseTable,
    OutliersTable,
    SatellitesTable,
    World,
)
from fgnav_sim.gnss.tables import MultipathTable, ReflectorTable
from fgnav_sim.ranges import log_uniform

_CLEAN = 0.25  # share of worlds without links worse than stated, and of those with multipath


class Draw(Table, frozen=True):
    """Worlds of one array each: ranges are drawn from, by logarithm but for ``outliers``."""

    # arrays, epochs: how many are drawn, and epochs of each
    arrays: int
    epochs: int
    # constellations and signals, one of them for each world
    signals: tuple[dict[str, tuple[str, ...]], ...]
    satellites: tuple[int, int] = (4, 24)  # of all constellations together, two of each at least
    antennas: tuple[int, int] = (2, 8)
    box_m: Vector = (2.0, 1.2, 0.4)  # edges, each shortened by a factor of its own
    scale: tuple[Positive, Positive] = (0.3, 2.0)  # of all edges
    code_m: tuple[Positive, Positive] = (0.05, 2.0)
    phase_m: tuple[Positive, Positive] = (0.001, 0.003)
    outliers: tuple[float, float] = (0.0, 0.2)  # share of links worse than stated
    worse: tuple[Positive, Positive] = (0.5, 1.5)  # by so many times 1.5 m and 15 mm
    stated: tuple[Positive, Positive] = (0.8, 1.25)  # stated over true standard deviation
    reflectors: tuple[ReflectorTable, ...] = ()


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class TrustSamples:
    """Rows of the network for epochs whose truth is known."""

    start: IntArray  # (n + 1,); first row of each epoch, and the number of all
    right: BoolArray  # (c,); integers of the differences that no worse link takes part in
    features: FloatArray  # (c, f)

    def __len__(self) -> int:
        """Return the number of epochs."""
        return len(self.start) - 1


def drawn_epochs(draw: Draw, rng: np.random.Generator) -> tuple[DoubleDifferences, IntArray]:
    """Return epochs of one array as a receiver states them, and their true integers."""
    epochs = array_epochs(drawn_world(draw, rng), rng, draw.epochs)
    differences = double_differences_of(epochs)
    stated = log_uniform(draw.stated, rng) ** 2
    differences = replace(
        differences,
        code_variance_m2=differences.code_variance_m2 * stated,
        phase_variance_m2=differences.phase_variance_m2 * stated,
    )
    return differences, true_cycles(epochs, differences)


def drawn_world(draw: Draw, rng: np.random.Generator) -> World:
    """Return a world of one array: antennas at the middle, at a corner and anywhere in a box."""
    signals = draw.signals[rng.integers(len(draw.signals))]
    total = _count(draw.satellites, rng)
    edges_m = log_uniform(draw.scale, rng) * np.array(draw.box_m) * rng.uniform(0.5, 1.0, 3)
    antennas_b_m = edges_m * rng.uniform(-0.5, 0.5, (_count(draw.antennas, rng), 3))
    antennas_b_m[0] = 0.0
    antennas_b_m[1] = 0.5 * edges_m
    code_m, phase_m = log_uniform(draw.code_m, rng), log_uniform(draw.phase_m, rng)
    worse, share = log_uniform(draw.worse, rng), float(rng.uniform(*draw.outliers))
    clean, echoes = rng.random(2) < _CLEAN
    return World(
        sites=AnySites(),
        times=AnyTimes(),
        satellites=SatellitesTable(
            signals=signals, choose=max(2, total // len(signals)), pick="random", mask_deg=10.0
        ),
        antennas_b_m=tuple(map(tuple, antennas_b_m.tolist())),
        noise=NoiseTable(code_m=code_m, phase_m=phase_m, elevation_weights="sine"),
        outliers=OutliersTable(share=share, code_m=1.5 * worse, phase_m=0.015 * worse)
        if share > 0.0 and not clean
        else None,
        multipath=MultipathTable(code_m=code_m, phase_m=0.5 * phase_m, time_constant_s=60.0)
        if echoes
        else None,
        reflectors=draw.reflectors,
    )


def samples_of(draw: Draw, rng: np.random.Generator, *, nodes: int) -> TrustSamples:
    """Return epochs of one array, their candidates and their truth.

    Parameters
    ----------
    nodes : int
        What the search of an epoch may visit.
    """
    differences, true = drawn_epochs(draw, rng)
    listed = candidates(differences, nodes=nodes)
    rows = trust_rows(differences, listed)
    bad = touched(differences.resampled(listed.epoch), rows.worse > OUTLIER)
    kept = differences.resolvable[listed.epoch] & ~bad
    right = (~kept | (listed.cycles == true[listed.epoch])).all(axis=(1, 2))
    return TrustSamples(
        start=np.searchsorted(listed.epoch, np.arange(draw.epochs + 1)),
        right=np.asarray(right),
        features=rows.features,
    )


def joined(parts: list[TrustSamples]) -> TrustSamples:
    """Return several sets as one."""
    rows = np.cumsum([0, *(block.start[-1] for block in parts)])
    starts = [block.start[:-1] + first for block, first in zip(parts, rows[:-1], strict=True)]
    return TrustSamples(
        start=np.append(np.concatenate(starts), rows[-1]),
        right=np.concatenate([block.right for block in parts]),
        features=np.concatenate([block.features for block in parts]),
    )


def _count(span: tuple[int, int], rng: np.random.Generator) -> int:
    """Return a number from a range, both ends included; the smaller, the likelier."""
    return int(log_uniform((span[0], span[1] + 1), rng))
