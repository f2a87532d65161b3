"""Disturbances of the links of a data set: noise, outliers, multipath."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav_sim.data_sets.sky import Sky
from fgnav_sim.data_sets.world import Drawn, World
from fgnav_sim.gauss_markov import gauss_markov
from fgnav_sim.propagation.multipath import echoes

_BLOCK = 4096  # epochs of reflections at a time
_LOWEST = np.sin(np.radians(1.0))  # noise grows no more below


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Links:
    """Ranges as code and phase see them, integers left out, (n, a, m); stated noise, (n, m)."""

    code_m: FloatArray
    phase_m: FloatArray
    outlier: BoolArray
    code_sigma_m: FloatArray
    phase_sigma_m: FloatArray


def disturbed(
    world: World,
    sky: Sky,
    R_nb: FloatArray,
    range_m: FloatArray,
    wavelength_m: FloatArray,
    *,
    rng: np.random.Generator,
) -> Links:
    """Return the disturbed ranges of antennas, (n, a, m).

    Each disturbance draws from a generator of its own: switching one on leaves the others' noise.
    """
    level_rng, noise_rng, outlier_rng, echo_rng = rng.spawn(4)
    weight = _weights(world, sky)
    values: list[FloatArray] = []
    sigmas: list[FloatArray] = []
    kinds = (world.noise.code_m, world.noise.phase_m)
    for drawn, kind_rng in zip(kinds, noise_rng.spawn(2), strict=True):
        sigma_m = _levels(drawn, world, len(range_m), rng=level_rng) * weight
        value = kind_rng.standard_normal(range_m.shape)
        value *= sigma_m[:, None]
        value += range_m
        values.append(value)
        sigmas.append(sigma_m)
    outlier = _outliers(world, values, rng=outlier_rng)
    if world.multipath is not None:
        sizes = (world.multipath.code_m, world.multipath.phase_m)
        for k, (size, kind_rng) in enumerate(zip(sizes, echo_rng.spawn(2), strict=True)):
            values[k] += size * weight[:, None] * _processes(world, range_m.shape, rng=kind_rng)
            sigmas[k] = np.hypot(sigmas[k], size * weight)
    if world.reflectors:
        _mirror(world, sky, R_nb, wavelength_m, values)
    empty = sky.satellites == ""
    code_sigma_m, phase_sigma_m = (np.where(empty, 1.0, sigma) for sigma in sigmas)
    return Links(
        code_m=values[0],
        phase_m=values[1],
        outlier=outlier,
        code_sigma_m=code_sigma_m,
        phase_sigma_m=phase_sigma_m,
    )


def _weights(world: World, sky: Sky) -> FloatArray:
    """Return noise against that at the zenith, (n, m)."""
    if world.noise.elevation_weights == "uniform":
        return np.ones_like(sky.elevation_rad)
    return np.asarray(1.0 / np.maximum(-sky.e_n[..., 2], _LOWEST))


def _levels(drawn: Drawn, world: World, epochs: int, *, rng: np.random.Generator) -> FloatArray:
    """Return the standard deviation at the zenith of each epoch's run, (n, 1)."""
    if not isinstance(drawn, tuple):
        return np.full((epochs, 1), drawn)
    low, high = np.log(drawn[0]), np.log(drawn[1])
    of_run = np.exp(rng.uniform(low, high, epochs // world.runs.epochs))
    return np.repeat(of_run, world.runs.epochs)[:, None]


def _outliers(world: World, values: list[FloatArray], *, rng: np.random.Generator) -> BoolArray:
    """Add what nobody is told of to code and phase, in place; return where, (n, a, m)."""
    if world.outliers is None:
        return np.zeros(values[0].shape, dtype=bool)
    outlier = rng.random(values[0].shape) < world.outliers.share
    hit = np.count_nonzero(outlier)
    for value, size in zip(values, (world.outliers.code_m, world.outliers.phase_m), strict=True):
        value[outlier] += size * rng.standard_normal(hit)
    return outlier


def _processes(world: World, shape: tuple[int, ...], *, rng: np.random.Generator) -> FloatArray:
    """Return a Gauss-Markov process of variance one for every link of every run, (n, a, m)."""
    epochs, (n, a, m) = world.runs.epochs, shape
    if world.multipath is None or epochs == 1:
        return rng.standard_normal(shape)
    time_constant_s = world.multipath.time_constant_s
    process = gauss_markov(time_constant_s, world.runs.step_s, (epochs, n // epochs, a, m), rng=rng)
    return process.swapaxes(0, 1).reshape(shape)


def _mirror(
    world: World,
    sky: Sky,
    R_nb: FloatArray,
    wavelength_m: FloatArray,
    values: list[FloatArray],
) -> None:
    """Add what the body mirrors to code and phase, in place."""
    arms_b_m = np.array(world.antennas_b_m)
    for first in range(0, len(R_nb), _BLOCK):
        block = slice(first, first + _BLOCK)
        e_b = sky.e_n[block] @ R_nb[block]
        still = np.zeros((len(e_b), 3))  # the rate concerns Doppler, which is not here
        echo = echoes(world.reflectors, arms_b_m, e_b, still, wavelength_m)
        values[0][block] += echo.code_m
        values[1][block] += echo.phase_m
