"""From simulated epochs to what a network learns from: features, integers, parts, batches."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeAlias

import msgspec
import numpy as np
import torch

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, Unused
from fgnav.io.strict_toml import Positive, Table
from fgnav_models.features import (
    Input,
    ambiguity_inputs,
    by_elevation,
    double_differences,
    wrapped,
)
from fgnav_models.training.ambiguity.nets import N_MAX
from fgnav_sim.data_sets.epochs import array_epochs
from fgnav_sim.data_sets.world import World

Share: TypeAlias = Annotated[float, msgspec.Meta(ge=0, le=1)]
TRAIN, VALIDATION, TEST, NOWHERE = range(4)
_CHUNK = 57_600  # epochs drawn at a time: links, which are dropped, need 20 times the features


class Data(Table, frozen=True):
    """Size of the drawn data, inputs, and shares of training, validation and test."""

    epochs: Annotated[int, msgspec.Meta(ge=1)]
    inputs: tuple[Input, ...] = ("range", "constellation")  # as ``ambiguity_inputs`` names them
    # ``"blocks"``: parts share no block of time and no run, hence no attitude where each run has
    # its own; a run that lies within one block goes with it. ``"simulations"``: parts share no run
    # but all of the time: what the paper seems to do, and a leak where runs share a trajectory.
    split: Literal["blocks", "simulations"] = "blocks"
    block_s: Positive = 3600.0
    shares: tuple[Share, Share, Share] = (0.7, 0.15, 0.15)  # of training, validation and test

    def __post_init__(self) -> None:
        """Check the shares."""
        if abs(sum(self.shares) - 1.0) > 1e-9:
            raise ValueError(f"shares: must add up to 1, got {list(self.shares)}")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Samples:
    """Epochs as networks see them."""

    features: FloatArray  # (n, f)
    cycles: IntArray  # (n, d); the integer of each wrapped double difference; 0 where there is none
    rounded: IntArray  # (n, d); what rounding the range gives
    is_present: BoolArray  # (n, d)
    t_s: FloatArray  # (n,)
    # run, first: (n,); the simulation, and the row of its first epoch
    run: IntArray
    first: IntArray
    satellites: int  # slots: what has fewer is padded
    unused: tuple[Unused, ...] = ()  # differences outside of what the networks can answer


def draw(
    world: World,
    inputs: tuple[Input, ...],
    count: int,
    *,
    rng: np.random.Generator,
    satellites: int = 0,
) -> Samples:
    """Return samples of a world; the same seed gives the same samples.

    Parameters
    ----------
    inputs : tuple of str
        As ``ambiguity_inputs`` names them.
    count : int
        Epochs.
    satellites : int
        Slots at least, the last of them empty where the world has fewer.

    Raises
    ------
    BadInputError
        If the world's signals have several wavelengths or groups: the networks take one.
    """
    length = world.runs.epochs
    chunk = max(1, _CHUNK // length) * length
    sizes = [min(chunk, count - start) for start in range(0, count, chunk)]
    parts = [
        _drawn(world, inputs, size, satellites, generator)
        for size, generator in zip(sizes, rng.spawn(len(sizes)), strict=True)
    ]
    joined = {name: np.concatenate([size[name] for size in parts]) for name in parts[0]}
    index = np.arange(count)
    run = index // length
    outside = np.abs(joined["cycles"]) > N_MAX
    is_present = joined["is_present"] & ~outside
    unused: tuple[Unused, ...] = ()
    if outside.any():
        reason = f"the integer is beyond {N_MAX}, which no network can answer"
        unused = (Unused(what="double difference", reason=reason, count=int(outside.sum())),)
    return Samples(
        features=joined["features"],
        cycles=np.where(is_present, joined["cycles"], 0),
        rounded=np.where(is_present, joined["rounded"], 0),
        is_present=is_present,
        t_s=joined["t_s"],
        run=run,
        first=run * length,
        satellites=joined["e_n"].shape[1],
        unused=unused,
    )


def _drawn(
    world: World,
    inputs: tuple[Input, ...],
    count: int,
    satellites: int,
    rng: np.random.Generator,
) -> dict[str, Any]:
    epochs = array_epochs(world, rng, count)
    if len(np.unique(epochs.wavelength_m)) > 1 or epochs.group.any():
        raise BadInputError("world: the networks take one signal of one constellation, as G 1C")
    wavelength_m = epochs.wavelength_m[0]
    order = by_elevation(epochs.elevation_rad)
    empty = max(0, satellites - order.shape[1])
    code_m, phase_m, arbitrary = (
        double_differences(_ordered(links, order[:, None], empty, np.nan))
        for links in (epochs.code_m, epochs.phase_m, epochs.integers.astype(float))
    )
    e_n = _ordered(epochs.e_n.swapaxes(1, 2), order[:, None], empty, 0.0).swapaxes(1, 2)
    range_cycles = code_m / wavelength_m
    phase_cycles, cycles = wrapped(phase_m / wavelength_m - arbitrary)
    is_present = np.isfinite(range_cycles) & np.isfinite(phase_cycles)
    features = ambiguity_inputs(
        inputs, range_cycles=range_cycles, phase_cycles=phase_cycles, e_n=e_n, t_s=epochs.t_s
    )
    return {
        "features": features,
        "cycles": cycles,
        "rounded": np.round(np.where(is_present, range_cycles, 0.0)).astype(np.int64),
        "is_present": is_present,
        "e_n": e_n,
        "t_s": epochs.t_s,
    }


def _ordered(values: FloatArray, order: IntArray, empty: int, gap: float) -> FloatArray:
    """Return values whose last axis is the satellites' in another order, padded with gaps."""
    ordered = np.take_along_axis(values, order, axis=2)
    return np.pad(ordered, ((0, 0), (0, 0), (0, empty)), constant_values=gap)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Parts:
    """Rows of training, validation and test, those with a whole window before them."""

    train: IntArray
    validation: IntArray
    test: IntArray
    unused: tuple[Unused, ...]


def parts_of(samples: Samples, data: Data, window: int, *, rng: np.random.Generator) -> Parts:
    """Split the rows; those that belong nowhere are counted as unused.

    Raises
    ------
    BadInputError
        If a part whose share is not zero gets no rows.
    """
    runs = int(samples.run[-1]) + 1
    of_run = _dealt(runs, data.shares, rng)
    subset = of_run[samples.run]
    if data.split == "blocks":
        _, block = np.unique(np.floor(samples.t_s / data.block_s), return_inverse=True)
        of_block = _dealt(int(block.max()) + 1, data.shares, rng)[block]
        leaves = block != block[samples.first]
        complete = (np.bincount(samples.run, leaves, runs) == 0)[samples.run]
        subset = np.where(complete | (of_block == subset), of_block, NOWHERE)
    index = np.arange(len(subset))
    early = index - samples.first < window - 1
    across = ~early & (subset[np.maximum(index - window + 1, 0)] != subset)
    unused = [
        Unused(what="epoch", reason=reason, count=int(wrong.sum()))
        for reason, wrong in (
            ("its run and its block of time are in different parts", subset == NOWHERE),
            (
                "there is no whole window before it in its part",
                (early | across) & (subset != NOWHERE),
            ),
        )
        if wrong.any()
    ]
    usable = ~early & ~across
    rows = [np.flatnonzero(usable & (subset == kind)) for kind in (TRAIN, VALIDATION, TEST)]
    for name, share, some in zip(
        ("training", "validation", "test"), data.shares, rows, strict=True
    ):
        if share > 0 and not len(some):
            raise BadInputError(
                f"data: no epoch is left for {name}; draw more epochs, or shorter blocks"
            )
    return Parts(train=rows[0], validation=rows[1], test=rows[2], unused=tuple(unused))


def _dealt(count: int, shares: tuple[float, float, float], rng: np.random.Generator) -> IntArray:
    """Return a part for each of ``count`` things, the shares met as well as they can be."""
    bounds = np.round(np.cumsum(shares) * count).astype(int)
    parts = np.searchsorted(bounds, np.arange(count), side="right")
    return np.asarray(rng.permutation(parts.clip(max=TEST)))


class Rows:
    """Samples on the training device, given out by rows.

    Parameters
    ----------
    columns : ndarray of int
        Double differences wanted, one per target of the network.
    """

    def __init__(self, samples: Samples, columns: IntArray, window: int, device: str) -> None:
        self.samples, self.window, self.device = samples, window, device
        self._back = torch.arange(1 - window, 1, device=device)
        self._features = torch.from_numpy(samples.features).to(device)
        self._cycles = torch.from_numpy(samples.cycles[:, columns]).to(device)
        self._is_present = torch.from_numpy(samples.is_present[:, columns]).to(device)

    def on_device(self, rows: IntArray) -> torch.Tensor:
        """Return rows, (n,), on the training device, each with its window within its run.

        Raises
        ------
        BadInputError
            If a window would reach into another run.
        """
        early = rows - self.samples.first[rows] < self.window - 1
        if early.any():
            raise BadInputError(
                f"window {self.window}: reaches before its run's start, first at row "
                f"{rows[early.argmax()]}"
            )
        return torch.from_numpy(rows).to(self.device)

    def __call__(self, rows: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return windows (n, k, f), integers (n, t) and whether they are there (n, t)."""
        window = rows[:, None] + self._back
        return self._features[window], self._cycles[rows], self._is_present[rows]


@dataclass(slots=True)
class Shuffled:
    """Batches of rows, all of them once per pass, in an order that the seed and the pass give."""

    rows: Rows
    of: IntArray
    batch: int
    seed: int
    _pass: int = -1
    _order: torch.Tensor | None = None

    def __call__(self, step: int) -> tuple[torch.Tensor, ...]:
        """Return the batch of a step."""
        per_pass = -(-len(self.of) // self.batch)
        number, k = divmod(step, per_pass)
        if self._order is None or number != self._pass:
            self._pass = number
            rng = np.random.default_rng([self.seed, number])
            self._order = self.rows.on_device(rng.permutation(self.of))
        return self.rows(self._order[k * self.batch : (k + 1) * self.batch])
