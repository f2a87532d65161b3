"""Columns of samples as parts of a flight, whoever has read them: files of a folder, importers."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray, quoted
from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import from_euler
from fgnav.io.flight import usual_noise
from fgnav.io.flight.columns import (
    BASELINE_GROUPS,
    CURRENTS,
    EULER,
    EULER_SIGMA,
    FIELD,
    FORCE,
    HEIGHT,
    PLACE,
    POSITION_SIGMA,
    RATE,
    VELOCITY,
    VELOCITY_SIGMA,
)
from fgnav.io.flight.keys import values_of
from fgnav.io.flight.local_frame import attitude_to_n, columns_to_vectors, place_to_n, velocity_to_n
from fgnav.io.flight.toml import FORWARD_RIGHT_DOWN, BarometerKeys, ImuKeys, MagnetometerKeys
from fgnav.types.flight import Fixes, Imu, LinkIntegers, Truth, TruthSource
from fgnav.types.surroundings import Barometer, Magnetometer

# Of each table: the columns it must have, and groups that are there in full or not at all.
COLUMNS: Mapping[str, tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]] = {
    "imu": (("t_s", *FORCE), (RATE,)),
    "fixes": (("t_s", *PLACE), (VELOCITY, POSITION_SIGMA, VELOCITY_SIGMA)),
    "baseline": (("t_s",), BASELINE_GROUPS),
    "barometer": (("t_s", *HEIGHT), ()),
    "magnetometer": (("t_s", *FIELD), ()),
    "seeker": (("t_s", *CURRENTS), ()),
    "truth": (
        ("t_s", *PLACE, *VELOCITY, *EULER),
        (POSITION_SIGMA, VELOCITY_SIGMA, EULER_SIGMA),
    ),
}

LEAST_SIGMA = 1e-6  # m, m/s, deg: no receiver knows its place or velocity better


def imu(samples: Mapping[str, FloatArray], table: ImuKeys) -> Imu:
    """Return an inertial unit: its axes turned to the body's, its clock set."""
    R_bu = mounting(table.axes, table.mounting_deg)
    gyroscope = RATE[0] in samples
    stated = {name: getattr(table, name) for name in usual_noise.IMU}
    sigma_s = table.clock_offset_sigma_s
    return Imu(
        t_s=samples["t_s"] + table.clock_offset_s,
        clock_offset_sigma_s=within_a_sample_s(samples["t_s"]) if sigma_s is None else sigma_s,
        f_b_mps2=columns_to_vectors(samples, FORCE) @ R_bu.T,
        w_b_radps=columns_to_vectors(samples, RATE) @ R_bu.T if gyroscope else None,
        position_b_m=np.array(table.position_b_m),
        **usual_noise.imu_noise(stated, gyroscope=gyroscope),
    )


def mounting(axes: Sequence[str], angles_deg: Sequence[float]) -> FloatArray:
    """Return R_bu, (3, 3): from the axes in which a unit's samples are to the body's.

    Parameters
    ----------
    axes : sequence of 3 str
        Which axis of the samples points forward, right and down: ``("-x", "y", "-z")``.
    angles_deg : sequence of 3 float
        Roll, pitch, yaw by which the unit, its axes so named, is turned against the body.

    Raises
    ------
    BadInputError
        If the axes are no right-handed triad.
    """
    P = np.zeros((3, 3))
    for row, axis in enumerate(axes):
        name = axis.removeprefix("-")
        if name not in FORWARD_RIGHT_DOWN:
            raise BadInputError(f"imu axes: must be x, y, z, -x, -y or -z, got {quoted(axis)}")
        P[row, FORWARD_RIGHT_DOWN.index(name)] = -1.0 if axis.startswith("-") else 1.0
    if round(float(np.linalg.det(P))) != 1:  # 0: an axis twice; -1: left-handed
        raise BadInputError(
            f"imu axes: must be a right-handed triad such as -x, y, -z, got {', '.join(axes)}; "
            "look at the signs"
        )
    return np.asarray(from_euler(*np.radians(angles_deg)[:, None])[0] @ P)


def within_a_sample_s(t_s: FloatArray) -> float:
    """Return the 1-sigma of tags of samples at t_s, (k,), of which nothing is stated.

    Loggers write values at a tag, or means over the interval before, about or after it: a tag is
    off by up to half an interval, uniformly.
    """
    return float(np.median(np.diff(t_s)) / np.sqrt(12)) if len(t_s) > 1 else 0.0


def fixes(
    samples: Mapping[str, FloatArray], origin: Origin, antenna: str, *, where: Path | str
) -> Fixes:
    """Return fixes; standard deviations stay as they are, since the axes differ by 0.02 deg.

    Parameters
    ----------
    samples : mapping of str to ndarray, shape (k,)
    antenna : str
        Whose they are.
    where : Path or str
        The file, for error texts.
    """
    p_n_m = place_to_n(origin, columns_to_vectors(samples, PLACE))
    if VELOCITY_SIGMA[0] in samples and VELOCITY[0] not in samples:
        raise BadInputError(f"{where}: line 1: {VELOCITY_SIGMA[0]} needs {', '.join(VELOCITY)}")
    v_n_mps = velocity_sigma_mps = None
    if VELOCITY[0] in samples:
        v_n_mps = velocity_to_n(origin, p_n_m, columns_to_vectors(samples, VELOCITY))
        velocity_sigma_mps = _sigma(where, samples, VELOCITY_SIGMA, usual_noise.VELOCITY_SIGMA_MPS)
    return Fixes(
        t_s=samples["t_s"],
        antenna=antenna,
        p_n_m=p_n_m,
        v_n_mps=v_n_mps,
        position_sigma_m=_sigma(where, samples, POSITION_SIGMA, usual_noise.POSITION_SIGMA_M),
        velocity_sigma_mps=velocity_sigma_mps,
        unstated=tuple(
            name
            for name, sigma in (("position", POSITION_SIGMA), ("velocity", VELOCITY_SIGMA))
            if sigma[0] not in samples
        ),
    )


def _sigma(
    where: Path | str,
    samples: Mapping[str, FloatArray],
    names: tuple[str, ...],
    default: tuple[float, ...],
) -> FloatArray:
    stated = stated_sigma(where, samples, names)
    return np.tile(np.array(default), (len(samples["t_s"]), 1)) if stated is None else stated


def stated_sigma(
    where: Path | str, samples: Mapping[str, FloatArray], names: tuple[str, ...]
) -> FloatArray | None:
    """Return standard deviations, (k, c); None where the samples have none.

    Raises
    ------
    BadInputError
        If one is not positive.
    """
    if names[0] not in samples:
        return None
    sigma = columns_to_vectors(samples, names)
    wrong = sigma < LEAST_SIGMA
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise BadInputError(
            f"{where}: line {row + 2}: {names[column]} must be {LEAST_SIGMA:g} or more, "
            f"got {sigma[row, column]:.9g}"
        )
    return sigma


def barometer(samples: Mapping[str, FloatArray], table: BarometerKeys) -> Barometer:
    """Return a barometer."""
    return Barometer(
        t_s=samples["t_s"],
        height_m=samples[HEIGHT[0]],
        **values_of(table, Barometer),
    )


def magnetometer(samples: Mapping[str, FloatArray], table: MagnetometerKeys) -> Magnetometer:
    """Return a magnetometer."""
    return Magnetometer(
        t_s=samples["t_s"],
        field_b_ut=columns_to_vectors(samples, FIELD),
        **values_of(table, Magnetometer),
    )


def truth(
    samples: Mapping[str, FloatArray],
    origin: Origin,
    integers: LinkIntegers | None = None,
    *,
    source: TruthSource | None = None,
    where: Path | str,
) -> Truth:
    """Return the truth, or a reference taken as such; ``where`` as of ``fixes``."""
    euler_sigma_deg = stated_sigma(where, samples, EULER_SIGMA)
    p_n_m = place_to_n(origin, columns_to_vectors(samples, PLACE))
    return Truth(
        t_s=samples["t_s"],
        p_n_m=p_n_m,
        v_n_mps=velocity_to_n(origin, p_n_m, columns_to_vectors(samples, VELOCITY)),
        R_nb=attitude_to_n(origin, p_n_m, columns_to_vectors(samples, EULER)),
        integers=integers,
        source=source,
        position_sigma_m=stated_sigma(where, samples, POSITION_SIGMA),
        velocity_sigma_mps=stated_sigma(where, samples, VELOCITY_SIGMA),
        euler_sigma_rad=None if euler_sigma_deg is None else np.radians(euler_sigma_deg),
    )
