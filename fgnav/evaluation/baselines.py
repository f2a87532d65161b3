"""Baselines between antennas by an estimate: azimuth and elevation, which two antennas determine.

With u the baseline's unit vector in ``n`` and t the attitude's error in body axes, u changes by
``-R_nb [u_b]x t``. What turns about the baseline moves neither angle, however open it is.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray
from fgnav.evaluation.reference import covered, truth_at
from fgnav.geometry.rotations import skew, wrap
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight, Truth

_SHORTEST_M, _ALIGNED = 0.01, 1e-6  # between antennas; second over first singular value


@dataclass(frozen=True, slots=True, kw_only=True)
class BaselineFigures:
    """Medians of 1-sigma of a baseline's angles, degrees, and RMS errors where there is truth."""

    name: str
    azimuth_sigma_deg: float | None = None
    elevation_sigma_deg: float | None = None
    azimuth_rmse_deg: float | None = None
    elevation_rmse_deg: float | None = None


class BaselineAngles(NamedTuple):
    """Azimuth and elevation at n epochs, rad, and their 1-sigma; None where none is stated."""

    t_s: FloatArray
    angles_rad: FloatArray  # (n, 2)
    sigma_rad: FloatArray | None


def reported_baselines(flight: Flight) -> Mapping[str, FloatArray]:
    """Return unit vectors in body axes: of receivers' baselines, and of antennas in a line."""
    place = {antenna.name: antenna.position_b_m for antenna in flight.antennas}
    pairs = {frozenset(one.antennas): one.antennas for one in flight.baselines}
    if len(place) > 1:
        names = list(place)
        from_first = np.stack([place[name] - place[names[0]] for name in names])
        size = np.linalg.svd(from_first, compute_uv=False)
        if (size[1:] <= _ALIGNED * size[0]).all():
            ends = names[0], names[int(np.abs(from_first).sum(axis=1).argmax())]
            pairs.setdefault(frozenset(ends), ends)
    vectors = {" to ".join(ends): place[ends[1]] - place[ends[0]] for ends in pairs.values()}
    lengths = {name: float(np.linalg.norm(vector)) for name, vector in vectors.items()}
    return {name: v / lengths[name] for name, v in vectors.items() if lengths[name] > _SHORTEST_M}


def baseline_angles(estimate: Estimate, unit_b: FloatArray) -> BaselineAngles:
    """Return the angles of a unit vector in body axes, (3,), by an estimate."""
    u_n = estimate.R_nb @ unit_b
    covariance, sigma_rad = estimate.attitude_covariance_rad2, None
    if covariance is not None:
        by_turn = -estimate.R_nb @ skew(unit_b[None])
        north, east = u_n[:, 0], u_n[:, 1]
        level = np.hypot(north, east).clip(1e-9)
        zero = np.zeros_like(level)
        rows = np.array([[-east / level**2, north / level**2, zero], [zero, zero, -1 / level]])
        J = np.moveaxis(rows, 2, 0) @ by_turn
        sigma_rad = np.sqrt(np.einsum("nij,njk,nik->ni", J, covariance, J))
    return BaselineAngles(estimate.t_s, _angles(u_n), sigma_rad)


def baseline_errors_rad(angles: BaselineAngles, truth: Truth, unit_b: FloatArray) -> FloatArray:
    """Return errors of azimuth and elevation, (n, 2); NaN where there is no truth."""
    inside, errors = covered(truth, angles.t_s), np.full((len(angles.t_s), 2), np.nan)
    real = _angles(truth_at(truth, angles.t_s[inside]).R_nb @ unit_b)
    errors[inside] = wrap(angles.angles_rad[inside] - real)
    return errors


def baseline_figures(flight: Flight, estimate: Estimate) -> tuple[BaselineFigures, ...]:
    """Return the figures of all reported baselines of a flight."""
    figures = []
    for name, unit_b in reported_baselines(flight).items():
        angles = baseline_angles(estimate, unit_b)
        if not len(angles.t_s):
            continue
        sigma: list[float | None] = [None, None]
        rmse: list[float | None] = [None, None]
        if angles.sigma_rad is not None:
            sigma = np.degrees(np.median(angles.sigma_rad, axis=0)).tolist()
        if flight.truth is not None:
            errors = baseline_errors_rad(angles, flight.truth, unit_b)
            valid = errors[np.isfinite(errors[:, 0])]
            rmse = np.degrees(np.sqrt((valid**2).mean(axis=0))).tolist() if len(valid) else rmse
        figures.append(
            BaselineFigures(
                name=name,
                azimuth_sigma_deg=sigma[0],
                elevation_sigma_deg=sigma[1],
                azimuth_rmse_deg=rmse[0],
                elevation_rmse_deg=rmse[1],
            )
        )
    return tuple(figures)


def _angles(u_n: FloatArray) -> FloatArray:
    north, east, down = u_n.T
    return np.stack([np.arctan2(east, north), np.arctan2(-down, np.hypot(north, east))], axis=1)
