"""Epochs of antenna arrays by the hundred thousand, for training and Monte Carlo, without flights.

A flight is simulated from light time up. What an array measures in an epoch depends on far less:
the satellites' directions, the attitude, integers and noise. This is that model, in arrays.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray
from fgnav.gnss.signals import wavelengths_m
from fgnav_sim.data_sets.links import disturbed
from fgnav_sim.data_sets.sky import skies
from fgnav_sim.data_sets.world import World

_LARGEST_INTEGER = 1000  # arbitrary integers are drawn from both sides of zero up to this


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ArrayEpochs:
    """Measurements of antenna arrays, undifferenced, with the truth behind them.

    ``code_m = range_m + noise`` and ``phase_m = range_m + wavelength_m integers + noise`` with
    ``range_m = -e_n . R_nb (antennas_b_m - antennas_b_m[0])``: the range to antenna 1 is removed,
    clocks and hardware delays, which double differences remove, are zero. A slot is a channel:
    what satellite stands in it may change from epoch to epoch.
    """

    t_s: FloatArray  # (n,); GPS time since the world's start
    run: IntArray  # (n,); simulation an epoch belongs to, from 0; its epochs follow each other
    R_nb: FloatArray  # (n, 3, 3); ``n`` is North-East-Down at the epoch's own place
    antennas_b_m: FloatArray  # (a, 3)
    satellites: NDArray[np.str_]  # (n, m); RINEX names; ``""`` in an empty slot
    signals: tuple[str, ...]  # length m
    # (m,); constellation and signal of a slot, numbered from 0: differences stay within
    group: IntArray
    wavelength_m: FloatArray  # (m,)
    e_n: FloatArray  # (n, m, 3); unit vectors to satellites; 0 in an empty slot
    elevation_rad: FloatArray  # (n, m); NaN in an empty slot
    # code_m, phase_m: (n, a, m); NaN where antenna or satellite is none
    code_m: FloatArray
    phase_m: FloatArray
    # (n, a, m); constant in a run for each antenna and satellite; 0 where there is no link
    integers: IntArray
    outlier: BoolArray  # (n, a, m); links with noise of which nobody is told
    # code_sigma_m, phase_sigma_m: (n, m); noise of a link as stated, echoes from anywhere included;
    # 1 in an empty slot
    code_sigma_m: FloatArray
    phase_sigma_m: FloatArray

    def __len__(self) -> int:
        """Return the number of epochs."""
        return len(self.t_s)

    def __getitem__(self, rows: slice | IntArray | BoolArray) -> "ArrayEpochs":
        """Select epochs."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        common = ("antennas_b_m", "signals", "group", "wavelength_m")
        return ArrayEpochs(**{k: v if k in common else v[rows] for k, v in values.items()})


def array_epochs(world: World, generator: np.random.Generator, count: int) -> ArrayEpochs:
    """Return epochs drawn from a world.

    Parameters
    ----------
    generator : numpy.random.Generator
        The same seed gives the same epochs, bit by bit.
    count : int
        How many; the last run is cut where they are not whole runs.

    Raises
    ------
    BadInputError
        If a constellation has no built-in almanac, or the count is below one.
    """
    if count < 1:
        raise BadInputError(f"count: must be 1 or more, got {count}")
    sky_rng, _, attitude_rng, integer_rng, link_rng = generator.spawn(5)
    length = world.runs.epochs
    runs = -(-count // length)
    sky = skies(world, runs, rng=sky_rng)
    run = np.repeat(np.arange(runs), length)
    t_run_s = np.tile(world.runs.step_s * np.arange(length), runs)
    R_nb = world.attitudes(t_run_s, run, rng=attitude_rng)
    antennas_b_m = np.array(world.antennas_b_m)
    range_m = (antennas_b_m[:1] - antennas_b_m) @ (sky.e_n @ R_nb).swapaxes(1, 2)
    wavelength_m = wavelengths_m(sky.constellations, sky.signals)
    links = disturbed(world, sky, R_nb, range_m, wavelength_m, rng=link_rng)
    missing = np.broadcast_to((sky.satellites == "")[:, None], range_m.shape)
    kinds = [c + s for c, s in zip(sky.constellations, sky.signals, strict=True)]
    group = np.array([list(dict.fromkeys(kinds)).index(kind) for kind in kinds])
    integers = _integers(sky.number, run, group, len(antennas_b_m), rng=integer_rng)
    integers[missing] = 0
    phase_m = links.phase_m + wavelength_m * integers
    links.code_m[missing] = phase_m[missing] = np.nan
    epochs = ArrayEpochs(
        t_s=sky.t_s,
        run=run,
        R_nb=R_nb,
        antennas_b_m=antennas_b_m,
        satellites=sky.satellites,
        signals=sky.signals,
        group=group,
        wavelength_m=wavelength_m,
        e_n=sky.e_n,
        elevation_rad=sky.elevation_rad,
        code_m=links.code_m,
        phase_m=phase_m,
        integers=integers,
        outlier=links.outlier & ~missing,
        code_sigma_m=links.code_sigma_m,
        phase_sigma_m=links.phase_sigma_m,
    )
    return epochs[:count]


def _integers(
    number: IntArray, run: IntArray, group: IntArray, antennas: int, *, rng: np.random.Generator
) -> IntArray:
    """Return arbitrary integers, (n, a, m), one for each run, antenna, satellite and signal."""
    runs, low, high = int(run.max()) + 1, -_LARGEST_INTEGER, _LARGEST_INTEGER
    if runs == len(run):  # nothing to keep from epoch to epoch
        return rng.integers(low, high, (runs, antennas, len(group)))
    channel = group * (int(number.max()) + 1) + number
    drawn = rng.integers(low, high, (runs, int(channel.max()) + 1, antennas))
    return np.ascontiguousarray(drawn[run[:, None], channel].swapaxes(1, 2))
