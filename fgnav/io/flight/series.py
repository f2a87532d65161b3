"""Records of a flight from tables of samples and their keys, and back."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from fgnav.checks import BadInputError, FloatArray, quoted
from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import from_euler
from fgnav.io.flight import columns as col
from fgnav.io.flight.baselines import baseline_blocks, baseline_of
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
from fgnav.io.flight.toml import FORWARD_RIGHT_DOWN, ImuTable, TruthTable
from fgnav.io.tables import read_table
from fgnav.types.flight import Baseline, Fixes, Imu, Photodetector, Truth
from fgnav.types.instruments import (
    USUAL_POSITION_SIGMA_M,
    USUAL_VELOCITY_SIGMA_MPS,
    imu_noise,
)
from fgnav.types.surroundings import Barometer, Magnetometer

_Fields = Mapping[str, tuple[str, ...]]  # columns by a record's field
_POSITION: _Fields = {"p_n_m": col.PLACE}
_SIGMAS: _Fields = {
    "position_sigma_m": col.POSITION_SIGMA,
    "velocity_sigma_mps": col.VELOCITY_SIGMA,
}
# Of each table: fields that it must have, and those that are there in full or not at all. Places go
# before what refers to the axes there.
FIELDS: Mapping[str, tuple[_Fields, _Fields]] = {
    "imu": ({"f_b_mps2": col.FORCE}, {"w_b_radps": col.RATE}),
    "fixes": (_POSITION, {"v_n_mps": col.VELOCITY, **_SIGMAS}),
    "barometer": ({"height_m": col.HEIGHT}, {}),
    "magnetometer": ({"field_b_ut": col.FIELD}, {}),
    "photodetector": ({"currents": col.CURRENTS}, {}),
    "truth": (
        {**_POSITION, "v_n_mps": col.VELOCITY, "R_nb": col.EULER},
        {**_SIGMAS, "euler_sigma_rad": col.EULER_SIGMA},
    ),
}
# Of each table: the columns it must have, and groups that are there in full or not at all.
COLUMNS: Mapping[str, tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]] = {
    kind: (("t_s", *chain(*required.values())), tuple(optional.values()))
    for kind, (required, optional) in FIELDS.items()
} | {"baseline": (("t_s",), col.BASELINE_GROUPS)}
_Convert: TypeAlias = Callable[[Origin, FloatArray, FloatArray], FloatArray]
# From files to records, and back: of an origin, places of the frame ``n``, and values.
_CONVERSIONS: Mapping[tuple[str, ...], tuple[_Convert, _Convert]] = {
    col.PLACE: (
        lambda origin, _, place: place_to_n(origin, place),
        lambda origin, _, p_n_m: place_of_n(origin, p_n_m),
    ),
    col.VELOCITY: (velocity_to_n, velocity_of_n),
    col.EULER: (attitude_to_n, attitude_of_n),
    col.EULER_SIGMA: (lambda _, __, x: np.radians(x), lambda _, __, x: np.degrees(x)),
    col.HEIGHT: (lambda _, __, x: x[:, 0], lambda _, __, x: x[:, None]),
}
_AS_IS: tuple[_Convert, _Convert] = (lambda _, __, x: x, lambda _, __, x: x)


@dataclass(frozen=True, eq=False, slots=True)
class Surroundings:
    """Folder, origin, antennas and fixes that a table of samples needs to become a record."""

    folder: Path
    origin: Origin
    antennas: tuple[str, ...]
    fixes: tuple[Fixes, ...] = ()  # those of baselines' receivers


def read_record(kind: str, keys: Any, at: Surroundings) -> Any:  # noqa: ANN401  # of that kind
    """Return the record that a table of flight.toml names the samples of."""
    file = at.folder / keys.samples
    samples = read_table(file, *COLUMNS[kind])
    if kind == "baseline":
        return baseline_of(samples, keys, at.origin, at.fixes, file)
    values = _values(kind, samples, at.origin, file)
    return _READERS[kind](values, keys, at, file)


def blocks_of(record: Any, origin: Origin, fixes: Sequence[Fixes]) -> list[col.Block]:  # noqa: ANN401
    """Return the columns of a record, beside its times; none of usual figures."""
    if isinstance(record, Baseline):
        return baseline_blocks(record, origin, fixes)
    blocks, unstated = list[col.Block](), getattr(record, "unstated", ())
    required, optional = FIELDS[type(record).__name__.lower()]
    for field, names in {**required, **optional}.items():
        values = getattr(record, field)
        is_usual = names[0].startswith("sigma") and field.partition("_")[0] in unstated
        if values is not None and not is_usual:
            _, convert = _CONVERSIONS.get(names, _AS_IS)
            blocks.append((names, convert(origin, getattr(record, "p_n_m", values), values)))
    return blocks


def _values(kind: str, samples: col.Samples, origin: Origin, file: Path) -> dict[str, Any]:
    """Return the fields of a record, None of those whose columns are not there; and its times."""
    required, optional = FIELDS[kind]
    values: dict[str, Any] = {"t_s": samples["t_s"]}
    for field, names in {**required, **optional}.items():
        is_sigma = names[0].startswith("sigma")
        read = partial(col.stated_sigma, file) if is_sigma else col.columns_to_vectors
        columns = read(samples, names) if names[0] in samples else None
        convert, _ = _CONVERSIONS.get(names, _AS_IS)
        p_n_m: Any = values.get("p_n_m", columns)
        values[field] = None if columns is None else convert(origin, p_n_m, columns)
    return values


def _imu(values: Any, keys: ImuTable, _at: Surroundings, _file: Path) -> Imu:  # noqa: ANN401
    """Return an inertial unit: its axes rotated to the body's, its clock set."""
    R_bu = mounting_rotation(keys.axes, keys.mounting_deg)
    t_s, w_u_radps = values["t_s"], values["w_b_radps"]
    sigma_s = keys.clock_offset_sigma_s
    return Imu(
        t_s=t_s + keys.clock_offset_s,
        clock_offset_sigma_s=within_a_sample_s(t_s) if sigma_s is None else sigma_s,
        f_b_mps2=values["f_b_mps2"] @ R_bu.T,
        w_b_radps=None if w_u_radps is None else w_u_radps @ R_bu.T,
        position_b_m=np.array(keys.position_b_m),
        **imu_noise(keys, gyroscope=w_u_radps is not None),
    )


def mounting_rotation(axes: Sequence[str], angles_deg: Sequence[float]) -> FloatArray:
    """Return R_bu, (3, 3): from the axes in which a unit's samples are to the body's.

    Parameters
    ----------
    axes : sequence of 3 str
        Which axis of the samples points forward, right and down: ``("-x", "y", "-z")``.
    angles_deg : sequence of 3 float
        Roll, pitch, yaw by which the unit, its axes so named, is turned against the body.
    """
    P = np.zeros((3, 3))
    for number, axis in enumerate(axes):
        name = axis.removeprefix("-")
        if name not in FORWARD_RIGHT_DOWN:
            raise BadInputError(f"imu axes: must be x, y, z, -x, -y or -z, got {quoted(axis)}")
        P[number, FORWARD_RIGHT_DOWN.index(name)] = -1.0 if axis.startswith("-") else 1.0
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


def _fixes(values: Any, keys: Any, _at: Surroundings, _file: Path) -> Fixes:  # noqa: ANN401
    """Return fixes; standard deviations stay as they are, since the axes differ by 0.02 deg."""
    unstated = []
    for name, sigma, usual in (
        ("position", "position_sigma_m", USUAL_POSITION_SIGMA_M),
        ("velocity", "velocity_sigma_mps", USUAL_VELOCITY_SIGMA_MPS),
    ):
        if values[sigma] is None:
            unstated.append(name)
            is_measured = name == "position" or values["v_n_mps"] is not None
            values[sigma] = np.tile(usual, (len(values["t_s"]), 1)) if is_measured else None
    return Fixes(antenna=keys.antenna, unstated=tuple(unstated), **values)


def _photodetector(values: Any, keys: Any, at: Surroundings, _file: Path) -> Photodetector:  # noqa: ANN401
    table = read_table(at.folder / keys.calibration, col.CALIBRATION, increasing=col.CALIBRATION[0])
    calibration = col.columns_to_vectors(table, col.CALIBRATION)
    landmark = np.array([[getattr(keys.landmark, name) for name in col.PLACE]])
    stated = values_of(keys, Photodetector) | {"calibration": calibration}
    return Photodetector(**values, landmark_n_m=place_to_n(at.origin, landmark)[0], **stated)


def _truth(values: Any, keys: TruthTable, at: Surroundings, _file: Path) -> Truth:  # noqa: ANN401
    """Return the truth, or a reference taken as such."""
    integers = read_integers(at.folder / keys.integers) if keys.integers else None
    for name in sorted(set(integers.antennas) - set(at.antennas) if integers is not None else ()):
        raise BadInputError(
            f"{at.folder / str(keys.integers)}: true integers antenna: {name!r} is not one of "
            f"{list(at.antennas)}"
        )
    return Truth(integers=integers, source=keys.source, **values)


_READERS: dict[str, Callable[..., Any]] = {
    "imu": _imu,
    "fixes": _fixes,
    "photodetector": _photodetector,
    "barometer": lambda values, keys, *_: Barometer(**values, **values_of(keys, Barometer)),
    "magnetometer": lambda values, keys, *_: Magnetometer(
        **values, **values_of(keys, Magnetometer)
    ),
    "truth": _truth,
}
