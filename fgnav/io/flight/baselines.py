"""Columns of a baseline between two antennas: a vector, or heading, pitch and length."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.geometry.earth import Origin
from fgnav.geometry.interpolation import interpolate
from fgnav.geometry.rotations import from_euler, transpose
from fgnav.io.flight import columns as col
from fgnav.io.flight.toml import BaselineTable
from fgnav.types.instruments import USUAL_BASELINE_SIGMA_M
from fgnav.types.receiver import Baseline, Fixes, Measured

_VERTICAL = 2.0  # sigma of heights over that of places, by the satellites' geometry


def baseline_of(
    samples: col.Samples, keys: BaselineTable, origin: Origin, fixes: Sequence[Fixes], where: Path
) -> Baseline:
    """Return a baseline; sigmas that the samples lack are usual figures.

    Parameters
    ----------
    keys : BaselineTable
        Antennas, from the first to the second, and the offset of headings.
    fixes : sequence of Fixes
        Where the receiver was: its axes are north, east, down there.
    where : Path
        The file, for error texts.
    """
    has_vector, has_heading = (name[0] in samples for name in (col.BASELINE, col.HEADING))
    if has_vector == has_heading:
        rule = f"must have {', '.join(col.BASELINE)}, or {col.HEADING[0]}, and not both"
        raise BadInputError(f"{where}: line 1: {rule}")
    has_sigma = col.POSITION_SIGMA[0] in samples
    if has_sigma and not has_vector:
        needed = f"{col.POSITION_SIGMA[0]} needs {', '.join(col.BASELINE)}"
        raise BadInputError(f"{where}: line 1: {needed}")
    if keys.heading_offset_deg is not None and not has_heading:
        raise BadInputError(f"{where}: line 1: heading_offset_deg needs {col.HEADING[0]}")
    measured: Measured = "vector"
    if has_vector:
        vector_l, P = _of_vector(samples, where)
    else:
        vector_l, P = _of_angles(samples, where, keys.heading_offset_deg or 0.0)
        if col.LENGTH[0] not in samples:
            measured = "direction" if col.PITCH[0] in samples else "heading"
    R_nl = _local_axes(origin, fixes, samples["t_s"])
    return Baseline(
        t_s=samples["t_s"],
        antennas=keys.antennas,
        vector_n_m=np.einsum("kij,kj->ki", R_nl, vector_l),
        covariance_m2=R_nl @ P @ transpose(R_nl),
        measured=measured,
        unstated=() if has_sigma or col.HEADING_SIGMA[0] in samples else ("baseline",),
    )


def _of_vector(samples: col.Samples, where: Path) -> tuple[FloatArray, FloatArray]:
    """Return vectors, (k, 3), and their covariances."""
    vector = col.columns_to_vectors(samples, col.BASELINE)
    sigma = col.stated_sigma(where, samples, col.POSITION_SIGMA)
    if sigma is None:
        sigma = np.tile(np.array(USUAL_BASELINE_SIGMA_M), (len(vector), 1))
    P: FloatArray = sigma[:, None] ** 2 * np.eye(3)
    if col.BASELINE_COVARIANCE[0] in samples:
        i, j = np.triu_indices(3, k=1)
        P[:, i, j] = P[:, j, i] = col.columns_to_vectors(samples, col.BASELINE_COVARIANCE)
    return vector, P


def _of_angles(
    samples: col.Samples, where: Path, offset_deg: float
) -> tuple[FloatArray, FloatArray]:
    """Return vectors, (k, 3), and covariances by heading, and by pitch and length if any."""
    none = np.zeros(len(samples["t_s"]))
    heading = np.radians(samples[col.HEADING[0]] - offset_deg)
    pitch = np.radians(samples.get(col.PITCH[0], none))
    length_m = samples.get(col.LENGTH[0], none + 1.0)
    across_m: FloatArray = USUAL_BASELINE_SIGMA_M[1] + none
    along_m = across_m
    if (sigma_deg := col.stated_sigma(where, samples, col.HEADING_SIGMA)) is not None:
        across_m = length_m * np.radians(sigma_deg[:, 0])
    down_m: FloatArray = across_m * (_VERTICAL if col.PITCH[0] in samples else 1.0)
    if (sigma_deg := col.stated_sigma(where, samples, col.PITCH_SIGMA)) is not None:
        down_m = length_m * np.radians(sigma_deg[:, 0])
    if (sigma_m := col.stated_sigma(where, samples, col.LENGTH_SIGMA)) is not None:
        along_m = sigma_m[:, 0]
    if col.LENGTH[0] not in samples:
        along_m = down_m
    R_la = from_euler(none, pitch, heading)  # of axes along the baseline, right of it, and down
    variances = np.stack([along_m, across_m * np.cos(pitch), down_m], axis=1) ** 2
    P = R_la @ (variances[:, None] * np.eye(3)) @ transpose(R_la)
    return length_m[:, None] * R_la[:, :, 0], P


def baseline_blocks(of: Baseline, origin: Origin, fixes: Sequence[Fixes]) -> list[col.Block]:
    """Return the columns that hold a baseline; a usual covariance is left out."""
    R_nl = _local_axes(origin, fixes, of.t_s)
    vector = np.einsum("kji,kj->ki", R_nl, of.vector_n_m)
    P = transpose(R_nl) @ of.covariance_m2 @ R_nl
    if of.measured == "vector":
        i, j = np.triu_indices(3, k=1)
        blocks: list[col.Block] = [
            (col.BASELINE, vector),
            (col.POSITION_SIGMA, np.sqrt(np.einsum("kii->ki", P))),
            (col.BASELINE_COVARIANCE, P[:, i, j]),
        ]
        return blocks[:1] if of.unstated else blocks
    north, east, down = vector.T
    heading, pitch = np.arctan2(east, north), np.arctan2(-down, np.hypot(north, east))
    R_la = from_euler(np.zeros_like(pitch), pitch, heading)
    sigma = np.degrees(np.sqrt(np.einsum("kji,kjl,kli->ki", R_la, P, R_la)))
    blocks = [(col.HEADING, np.degrees(heading)[:, None])]
    blocks += [] if of.unstated else [(col.HEADING_SIGMA, sigma[:, 1:2] / np.cos(pitch)[:, None])]
    if of.measured == "direction":
        blocks.append((col.PITCH, np.degrees(pitch)[:, None]))
        blocks += [] if of.unstated else [(col.PITCH_SIGMA, sigma[:, 2:])]
    return blocks


def _local_axes(origin: Origin, fixes: Sequence[Fixes], t_s: FloatArray) -> FloatArray:
    """Return the NED axes at a vehicle in ``n``, (k, 3, 3); those of ``n`` without fixes."""
    if not fixes:
        return np.tile(np.eye(3), (len(t_s), 1, 1))
    return origin.local_ned(interpolate(t_s, fixes[0].t_s, fixes[0].p_n_m))
