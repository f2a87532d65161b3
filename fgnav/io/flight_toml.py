"""``flight.toml``: its keys as structures, read strictly and written."""

import json
import re
import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin

import msgspec
import numpy as np

from fgnav.checks import BadInputError
from fgnav.flight import ElevationWeights, GnssNoise
from fgnav.io.gps_time import GPS_EPOCH
from fgnav.io.rinex_text import read_bytes

FORMAT = "fgnav-flight/1"
_START = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,9})?")
_WHERE = re.compile(r"(.*?)(?: - at `\$\.?(.*)`)?", re.DOTALL)

_NOISE = GnssNoise()

Vector = tuple[float, float, float]


class Place(msgspec.Struct, frozen=True, kw_only=True):
    """WGS-84 coordinates."""

    latitude_deg: float
    longitude_deg: float
    height_m: float


class AntennaTable(msgspec.Struct, frozen=True, kw_only=True):
    """``[[antenna]]``."""

    name: str
    position_b_m: Vector
    observations: str | None = None


class BaseTable(msgspec.Struct, frozen=True, kw_only=True):
    """``base`` of ``[gnss]``."""

    observations: str
    position_e_m: Vector


class GnssTable(msgspec.Struct, frozen=True, kw_only=True):
    """``[gnss]``."""

    navigation: list[str] = []
    orbits: list[str] = []
    elevation_mask_deg: float = 10.0
    code_noise_m: float = _NOISE.code_m
    phase_noise_m: float = _NOISE.phase_m
    doppler_noise_mps: float = _NOISE.doppler_mps
    elevation_weights: ElevationWeights = _NOISE.elevation_weights
    base: BaseTable | None = None


class ImuTable(msgspec.Struct, frozen=True, kw_only=True):
    """``[imu]``."""

    samples: str
    position_b_m: Vector = (0.0, 0.0, 0.0)
    accelerometer_noise_mps2_per_sqrt_hz: float
    accelerometer_bias_mps2: float
    accelerometer_bias_walk_mps2_per_sqrt_s: float
    gyroscope_noise_radps_per_sqrt_hz: float | None = None
    gyroscope_bias_radps: float | None = None
    gyroscope_bias_walk_radps_per_sqrt_s: float | None = None


class FixesTable(msgspec.Struct, frozen=True, kw_only=True):
    """``[fixes]``."""

    samples: str
    antenna: str


class SeekerTable(msgspec.Struct, frozen=True, kw_only=True):
    """``[seeker]``."""

    samples: str
    position_b_m: Vector
    landmark: Place
    detector_radius_m: float
    focal_length_m: float
    calibration: str


class TruthTable(msgspec.Struct, frozen=True, kw_only=True):
    """``[truth]``."""

    samples: str


class FlightTable(msgspec.Struct, frozen=True, kw_only=True):
    """The whole file."""

    format: str
    name: str
    start: str
    origin: Place
    antenna: list[AntennaTable] = []
    gnss: GnssTable = GnssTable()
    imu: ImuTable | None = None
    fixes: FixesTable | None = None
    seeker: SeekerTable | None = None
    truth: TruthTable | None = None


def read_flight_toml(path: Path) -> FlightTable:
    """Read and check ``flight.toml``.

    Parameters
    ----------
    path : Path

    Returns
    -------
    FlightTable

    Raises
    ------
    BadInputError
        Naming file, key, rule and value; of an unknown key also the nearest known one.
    """
    content = read_bytes(path)
    try:
        tables = tomllib.loads(content.decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadInputError(f"{path}: must be TOML, {error}") from error
    if not tables:
        raise BadInputError(f"{path}: must describe a flight, the file is empty")
    got = tables.get("format")
    if got != FORMAT:
        raise BadInputError(f"{path}: key format: must be {FORMAT!r}, got {got!r}")
    _check_keys(path, FlightTable, tables, "")
    _check_finite(path, tables, "")
    try:
        return msgspec.convert(tables, FlightTable)
    except msgspec.ValidationError as error:
        match = _WHERE.fullmatch(str(error))
        rule, where = match.groups() if match else (str(error), None)
        raise BadInputError(f"{path}: key {where or 'top level'}: {_plain(rule)}") from error


def _plain(rule: str) -> str:
    """Return msgspec's sentence in our own manner of speaking."""
    missing = re.fullmatch(r"Object missing required field `(.*)`", rule)
    if missing:
        return f"{missing.group(1)!r} is missing; add it"
    return rule.replace("Expected ", "must be ").replace("`", "")


def _check_keys(
    path: Path, kind: type[msgspec.Struct], table: Mapping[str, Any], where: str
) -> None:
    """Raise on the first key that the structure does not know, and name the nearest."""
    fields = {field.name: field.type for field in msgspec.structs.fields(kind)}
    for key, value in table.items():
        if key not in fields:
            near = get_close_matches(key, fields, n=1, cutoff=0.0)[0]
            raise BadInputError(
                f"{path}: key {where}{key}: unknown; the nearest known key is {where}{near}"
            )
        inner = _structure(fields[key])
        rows = value if isinstance(value, list) else [value]
        for k, row in enumerate(rows):
            if inner is not None and isinstance(row, dict):
                index = f"[{k}]" if isinstance(value, list) else ""
                _check_keys(path, inner, row, f"{where}{key}{index}.")


def _structure(kind: Any) -> type[msgspec.Struct] | None:  # noqa: ANN401  # a type expression
    """Return the structure in ``T``, ``T | None`` or ``list[T]``."""
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        return kind
    if get_origin(kind) in (list, Union, UnionType):
        return next((s for s in map(_structure, get_args(kind)) if s is not None), None)
    return None


def _check_finite(path: Path, value: Any, where: str) -> None:  # noqa: ANN401  # any TOML value
    """Raise on the first number that is nan or inf."""
    if isinstance(value, float) and not np.isfinite(value):
        raise BadInputError(f"{path}: key {where}: must be finite, got {value}")
    if isinstance(value, dict):
        for key, inner in value.items():
            _check_finite(path, inner, f"{where}.{key}" if where else key)
    elif isinstance(value, list):
        for k, inner in enumerate(value):
            _check_finite(path, inner, f"{where}[{k}]")


def gps_seconds(path: Path, start: str) -> float:
    """Return seconds since 1980-01-06 of a GPS date and time.

    Raises
    ------
    BadInputError
        If the text is no date such as ``2020-06-25T00:00:00.5``, or before 1980-01-06.
    """
    rule = f"{path}: key start: must be a GPS date and time, 2020-06-25T00:00:00, got {start!r}"
    if not _START.fullmatch(start):
        raise BadInputError(rule)
    try:
        whole = np.datetime64(start[:19], "s")
    except ValueError as error:
        raise BadInputError(rule) from error
    seconds = float((whole - GPS_EPOCH) / np.timedelta64(1, "s"))
    if seconds < 0:
        raise BadInputError(f"{path}: key start: must not be before 1980-01-06, got {start!r}")
    return seconds + float("0" + start[19:])


def gps_date(start_gps_s: float) -> str:
    """Return the text of a start, to the microsecond."""
    microseconds = round(start_gps_s * 1e6)
    date = str(GPS_EPOCH + np.timedelta64(microseconds, "us"))
    return date.rstrip("0").rstrip(".") if microseconds % 1_000_000 else date[:19]


def write_flight_toml(path: Path, table: FlightTable) -> None:
    """Write ``flight.toml``; keys at their default are left out."""
    lines: list[str] = []
    plain = {k: v for k, v in msgspec.to_builtins(table).items() if v not in (None, [], {})}
    tables = {k: v for k, v in plain.items() if isinstance(v, dict)}
    lists = {k: v for k, v in plain.items() if isinstance(v, list)}
    lines += [f"{k} = {_toml(v)}" for k, v in plain.items() if k not in tables and k not in lists]
    for key, rows in lists.items():
        for row in rows:
            lines += ["", f"[[{key}]]", *_entries(row)]
    for key, row in tables.items():
        lines += ["", f"[{key}]", *_entries(row)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _entries(table: Mapping[str, Any]) -> list[str]:
    return [f"{key} = {_toml(value)}" for key, value in table.items() if value not in (None, [])]


def _toml(value: Any) -> str:  # noqa: ANN401  # any TOML value
    """Return the TOML of a value; nested tables inline."""
    if isinstance(value, dict):
        return "{ " + ", ".join(_entries(value)) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
