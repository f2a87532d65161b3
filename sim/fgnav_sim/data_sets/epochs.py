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
from fgnav_sim.data_sets.world import GivenArray, RandomArray, World

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
    antennas_b_m: FloatArray  # (n, a, 3); NaN beyond the last antenna of an array
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
        """Return some of the epochs."""
        per_slot = ("signals", "group", "wavelength_m")
        return ArrayEpochs(
            **{
                f.name: getattr(self, f.name) if f.name in per_slot else getattr(self, f.name)[rows]
                for f in fields(self)
            }
        )


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
        If files of the world are bad or say nothing of its time, or the count is below one.
    """
    if count < 1:
        raise BadInputError(f"count: must be 1 or more, got {count}")
    sky_rng, array_rng, attitude_rng, integer_rng, link_rng = generator.spawn(5)
    length = world.runs.epochs
    runs = -(-count // length)
    sky = skies(world, runs, rng=sky_rng)
    run = np.repeat(np.arange(runs), length)
    t_run_s = np.tile(world.runs.step_s * np.arange(length), runs)
    R_nb = world.attitudes(t_run_s, run, rng=attitude_rng)
    antennas_b_m = _antennas(world.array, run, rng=array_rng)
    range_m = _ranges_m(R_nb, antennas_b_m, sky.e_n)
    wavelength_m = wavelengths_m(sky.constellations, sky.signals)
    links = disturbed(world, sky, R_nb, range_m, wavelength_m, rng=link_rng)
    missing = np.isnan(range_m) | (sky.satellites == "")[:, None]
    kinds = [c + s for c, s in zip(sky.constellations, sky.signals, strict=True)]
    group = np.array([list(dict.fromkeys(kinds)).index(kind) for kind in kinds])
    integers = _integers(sky.number, run, group, antennas_b_m.shape[1], rng=integer_rng)
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


def _antennas(
    array: GivenArray | RandomArray, run: IntArray, *, rng: np.random.Generator
) -> FloatArray:
    """Return the array of each epoch, (n, a, 3); the first antenna of a random one is at 0."""
    if isinstance(array, GivenArray):
        given = np.array(array.antennas_b_m)
        return np.broadcast_to(given, (len(run), *given.shape))
    runs, most = int(run.max()) + 1, array.antennas[1]
    scale = rng.uniform(*array.scale, (runs, 1, 1))
    antennas_b_m = scale * np.array(array.box_m) * rng.uniform(-0.5, 0.5, (runs, most, 3))
    antennas_b_m[:, 0] = 0.0
    present = rng.integers(*array.antennas, runs, endpoint=True)[:, None] > np.arange(most)
    antennas_b_m[~present] = np.nan
    return np.asarray(antennas_b_m[run])


def _ranges_m(R_nb: FloatArray, antennas_b_m: FloatArray, e_n: FloatArray) -> FloatArray:
    """Return how much nearer than antenna 1 the others are to satellites, negative, (n, a, m)."""
    e_b = e_n @ R_nb
    arms_b_m = antennas_b_m - antennas_b_m[:, :1]
    return np.asarray(-arms_b_m @ e_b.swapaxes(1, 2))


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
