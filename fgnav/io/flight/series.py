"""What a flight's records are read from, and written as: tables of samples, and their keys."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, FloatArray, quoted
from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import from_euler
from fgnav.io.flight.baselines import baseline_blocks, baseline_of
from fgnav.io.flight.columns import (
    BASELINE_GROUPS,
    CALIBRATION,
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
    Block,
    Samples,
    columns_to_vectors,
    stated_sigma,
)
from fgnav.io.flight.integers import read_integers
from fgnav.io.flight.keys import values_of
from fgnav.io.flight.local_frame import (
    attitude_of_n,
    attitude_to_n,
    place_of_n,
    place_to_n,
    velocity_of_n,
    velocity_to_n,
)
from fgnav.io.flight.toml import FORWARD_RIGHT_DOWN, ImuTable, PhotodetectorTable, TruthTable
from fgnav.io.tables import read_table
from fgnav.types.flight import Baseline, Fixes, Imu, Photodetector, Truth
from fgnav.types.instruments import (
    USUAL_POSITION_SIGMA_M,
    USUAL_VELOCITY_SIGMA_MPS,
    imu_noise,
)
from fgnav.types.surroundings import Barometer, Magnetometer

# Of each table: the columns it must have, and groups that are there in full or not at all.
COLUMNS: Mapping[str, tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]] = {
    "imu": (("t_s", *FORCE), (RATE,)),
    "fixes": (("t_s", *PLACE), (VELOCITY, POSITION_SIGMA, VELOCITY_SIGMA)),
    "baseline": (("t_s",), BASELINE_GROUPS),
    "barometer": (("t_s", *HEIGHT), ()),
    "magnetometer": (("t_s", *FIELD), ()),
    "photodetector": (("t_s", *CURRENTS), ()),
    "truth": (
        ("t_s", *PLACE, *VELOCITY, *EULER),
        (POSITION_SIGMA, VELOCITY_SIGMA, EULER_SIGMA),
    ),
}


@dataclass(frozen=True, eq=False, slots=True)
class Surroundings:
    """What a table of samples needs to become a record."""

    folder: Path
    origin: Origin
    antennas: tuple[str, ...]
    fixes: tuple[Fixes, ...] = ()  # those of baselines' receivers


def read_record(kind: str, keys: Any, at: Surroundings) -> Any:  # noqa: ANN401  # of that kind
    """Return the record that a table of flight.toml names the samples of.

    Raises
    ------
    BadInputError
        Naming file, line, column, rule and value.
    """
    file = at.folder / keys.samples
    return _READERS[kind](read_table(file, *COLUMNS[kind]), keys, at, file)


def blocks_of(record: Any, origin: Origin, fixes: Sequence[Fixes]) -> list[Block]:  # noqa: ANN401
    """Return the columns of a record, beside its times."""
    blocks: list[tuple[tuple[str, ...], FloatArray | None]]
    if isinstance(record, Baseline):
        return baseline_blocks(record, origin, fixes)
    if isinstance(record, Imu):
        blocks = [(FORCE, record.f_b_mps2), (RATE, record.w_b_radps)]
    elif isinstance(record, Photodetector):
        blocks = [(CURRENTS, record.currents)]
    elif isinstance(record, Barometer):
        blocks = [(HEIGHT, record.height_m[:, None])]
    elif isinstance(record, Magnetometer):
        blocks = [(FIELD, record.field_b_ut)]
    else:
        p_n_m, v_n_mps = record.p_n_m, record.v_n_mps
        unstated = getattr(record, "unstated", ())
        blocks = [(PLACE, place_of_n(origin, p_n_m))]
        if v_n_mps is not None:
            blocks.append((VELOCITY, velocity_of_n(origin, p_n_m, v_n_mps)))
        if isinstance(record, Truth):
            blocks.append((EULER, attitude_of_n(origin, p_n_m, record.R_nb)))
            sigma_rad = record.euler_sigma_rad
            blocks.append((EULER_SIGMA, None if sigma_rad is None else np.degrees(sigma_rad)))
        if "position" not in unstated:
            blocks.append((POSITION_SIGMA, record.position_sigma_m))
        if "velocity" not in unstated:
            blocks.append((VELOCITY_SIGMA, record.velocity_sigma_mps))
    return [(names, block) for names, block in blocks if block is not None]


def _imu(samples: Samples, keys: ImuTable, _at: Surroundings, _file: Path) -> Imu:
    """Return an inertial unit: its axes rotated to the body's, its clock set."""
    R_bu = mounting(keys.axes, keys.mounting_deg)
    gyroscope = RATE[0] in samples
    sigma_s = keys.clock_offset_sigma_s
    return Imu(
        t_s=samples["t_s"] + keys.clock_offset_s,
        clock_offset_sigma_s=within_a_sample_s(samples["t_s"]) if sigma_s is None else sigma_s,
        f_b_mps2=columns_to_vectors(samples, FORCE) @ R_bu.T,
        w_b_radps=columns_to_vectors(samples, RATE) @ R_bu.T if gyroscope else None,
        position_b_m=np.array(keys.position_b_m),
        **imu_noise(keys, gyroscope=gyroscope),
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


def _fixes(samples: Samples, keys: Any, at: Surroundings, file: Path) -> Fixes:  # noqa: ANN401
    """Return fixes; standard deviations stay as they are, since the axes differ by 0.02 deg."""
    p_n_m = place_to_n(at.origin, columns_to_vectors(samples, PLACE))
    if VELOCITY_SIGMA[0] in samples and VELOCITY[0] not in samples:
        raise BadInputError(f"{file}: line 1: {VELOCITY_SIGMA[0]} needs {', '.join(VELOCITY)}")

    def sigma(names: tuple[str, ...], usual: tuple[float, ...]) -> FloatArray:
        stated = stated_sigma(file, samples, names)
        return np.tile(np.array(usual), (len(p_n_m), 1)) if stated is None else stated

    moves = VELOCITY[0] in samples
    velocity = columns_to_vectors(samples, VELOCITY) if moves else np.zeros((0, 3))
    sigmas = (("position", POSITION_SIGMA), ("velocity", VELOCITY_SIGMA))
    return Fixes(
        t_s=samples["t_s"],
        antenna=keys.antenna,
        p_n_m=p_n_m,
        v_n_mps=velocity_to_n(at.origin, p_n_m, velocity) if moves else None,
        position_sigma_m=sigma(POSITION_SIGMA, USUAL_POSITION_SIGMA_M),
        velocity_sigma_mps=sigma(VELOCITY_SIGMA, USUAL_VELOCITY_SIGMA_MPS) if moves else None,
        unstated=tuple(name for name, columns in sigmas if columns[0] not in samples),
    )


def _baseline(samples: Samples, keys: Any, at: Surroundings, file: Path) -> Baseline:  # noqa: ANN401
    return baseline_of(samples, keys.antennas, at.origin, at.fixes, file)


def _photodetector(
    samples: Samples, keys: PhotodetectorTable, at: Surroundings, _file: Path
) -> Photodetector:
    table = read_table(at.folder / keys.calibration, CALIBRATION, increasing=CALIBRATION[0])
    landmark = np.array([[getattr(keys.landmark, name) for name in PLACE]])
    values = values_of(keys, Photodetector) | {
        "calibration": columns_to_vectors(table, CALIBRATION)
    }
    return Photodetector(
        t_s=samples["t_s"],
        currents=columns_to_vectors(samples, CURRENTS),
        landmark_n_m=place_to_n(at.origin, landmark)[0],
        **values,
    )


def _barometer(samples: Samples, keys: Any, _at: Surroundings, _file: Path) -> Barometer:  # noqa: ANN401
    height_m = samples[HEIGHT[0]]
    return Barometer(t_s=samples["t_s"], height_m=height_m, **values_of(keys, Barometer))


def _magnetometer(samples: Samples, keys: Any, _at: Surroundings, _file: Path) -> Magnetometer:  # noqa: ANN401
    field_b_ut = columns_to_vectors(samples, FIELD)
    return Magnetometer(t_s=samples["t_s"], field_b_ut=field_b_ut, **values_of(keys, Magnetometer))


def _truth(samples: Samples, keys: TruthTable, at: Surroundings, file: Path) -> Truth:
    """Return the truth, or a reference taken as such."""
    integers = read_integers(at.folder / keys.integers) if keys.integers else None
    for name in sorted(set(integers.antennas) - set(at.antennas) if integers is not None else ()):
        raise BadInputError(
            f"{at.folder / str(keys.integers)}: true integers antenna: {name!r} is not one of "
            f"{list(at.antennas)}"
        )
    euler_sigma_deg = stated_sigma(file, samples, EULER_SIGMA)
    p_n_m = place_to_n(at.origin, columns_to_vectors(samples, PLACE))
    return Truth(
        t_s=samples["t_s"],
        p_n_m=p_n_m,
        v_n_mps=velocity_to_n(at.origin, p_n_m, columns_to_vectors(samples, VELOCITY)),
        R_nb=attitude_to_n(at.origin, p_n_m, columns_to_vectors(samples, EULER)),
        integers=integers,
        source=keys.source,
        position_sigma_m=stated_sigma(file, samples, POSITION_SIGMA),
        velocity_sigma_mps=stated_sigma(file, samples, VELOCITY_SIGMA),
        euler_sigma_rad=None if euler_sigma_deg is None else np.radians(euler_sigma_deg),
    )


_READERS: dict[str, Callable[..., Any]] = {
    "imu": _imu,
    "fixes": _fixes,
    "baseline": _baseline,
    "photodetector": _photodetector,
    "barometer": _barometer,
    "magnetometer": _magnetometer,
    "truth": _truth,
}
