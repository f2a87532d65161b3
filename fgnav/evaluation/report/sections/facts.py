"""Tables of gaps, exclusions, unused measurements, constants, set-up and versions."""

import platform
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from importlib.metadata import distributions
from typing import Any

import numpy as np

from fgnav.checks import FloatArray
from fgnav.diagnostics.contents import GAP, series_of
from fgnav.evaluation.comparison import Method
from fgnav.evaluation.report.parts import Blocks, folded, paragraph, table
from fgnav.types.flight import Flight

_MOST = 300  # rows of a table
_PACKAGES = ("fgnav", "numpy", "scipy", "numba", "gtsam", "pyrtklib5", "onnxruntime")


def gaps_and_exclusions(flight: Flight, methods: Sequence[Method]) -> Blocks:
    """Return gaps of the answers, measurements left out or mended, and unused, with reasons."""
    gaps = [
        [method.name, f"{a:.2f}", f"{b:.2f}", f"{b - a:.2f}"]
        for method in methods
        if method.estimate is not None
        for a, b in _gaps(method.estimate.t_s)
    ]
    excluded = [
        [
            m.name,
            rejected.what,
            rejected.link,
            f"{rejected.from_s:.2f}",
            f"{rejected.until_s:.2f}",
            rejected.reason,
        ]
        for m in methods
        for rejected in m.rejections
    ]
    lost = [
        [of, loss.what, str(loss.count), loss.reason]
        for of, unused in {
            "flight": flight.unused,
            **{m.name: m.score.unused for m in methods},
        }.items()
        for loss in sorted(unused, key=lambda loss: -loss.count)
    ]
    by_link = ["method", "measurement", "link", "from, s", "until, s", "reason"]
    unused = table(["of", "what", "times", "reason"], lost, "measured and not used", _MOST)
    return (
        table(["method", "answer until, s", "again from, s", "length, s"], gaps, "gaps", _MOST)
        + table(by_link, excluded, "contradicted the rest: mended or left out", _MOST)
        + folded(f"{len(lost)} kinds of unused measurements", unused)
    ) or paragraph("No gap, no exclusion, no loss.")


def _gaps(t_s: FloatArray) -> list[tuple[float, float]]:
    """Return where epochs have no answer: last before, first after."""
    steps_s = np.diff(t_s)
    usual_s = np.median(steps_s) if len(steps_s) else np.inf
    at = np.flatnonzero(steps_s > GAP * usual_s)
    return list(zip(t_s[at].tolist(), t_s[at + 1].tolist(), strict=True))


def constants_table(methods: Sequence[Method]) -> Blocks:
    """Return the calibration parameters that hold for a whole flight."""
    rows = [
        [method.name, constant.name, axis, f"{value:.6g}", f"{sigma:.3g}", constant.unit]
        for method in methods
        for constant in method.solution.calibration
        for axis, value, sigma in zip(
            constant.axes,
            constant.value.tolist(),
            np.sqrt(np.diag(constant.covariance)).tolist(),
            strict=True,
        )
    ]
    return table(["method", "constant", "axis", "value", "1σ", "unit"], rows)


def set_up(flight: Flight) -> Blocks:
    """Return the set-up of a flight as read: positions, noise, rates, and defaults used."""
    rows = [["name", flight.name, ""], ["start", f"{flight.start_gps_s:.3f} s GPS time", ""]]
    for name in ("origin", "gnss_noise", "initial"):
        rows += _fields_of(name, getattr(flight, name))
    rows.append(["elevation mask", f"{np.degrees(flight.elevation_mask_rad):.1f} deg", ""])
    for antenna in flight.antennas:
        position = f"{antenna.position_b_m.tolist()} m, body axes"
        rows.append([f"antenna {antenna.name}", position, ""])
    if flight.observations is not None:
        of = flight.observations
        channels = [f"{s} {c}" for s, c in zip(of.satellites, of.signals, strict=True)]
        rows.append(["observations", _sampling(of.t_s), ", ".join(channels)])
    for name, record in flight.records.items():
        rows.append([name, _sampling(record.t_s), ""])
        rows += _fields_of(name, record)
    if flight.base is not None:
        rows.append(["base", f"{flight.base.position_e_m.tolist()} m, ECEF", ""])
    return table(["what", "as read", "remark"], rows)


def _fields_of(owner: str, record: Any) -> Iterator[list[str]]:  # noqa: ANN401  # a border type
    """Yield numbers and short vectors of a record by name."""
    if not is_dataclass(record):
        return
    for field in fields(record):
        value = getattr(record, field.name)
        if isinstance(value, np.ndarray) and value.shape == (3,):
            text = str(value.tolist())
        elif isinstance(value, bool | int | float | str):
            text = f"{value:.9g}" if isinstance(value, float) else str(value)
        else:
            continue
        is_usual = field.name in getattr(record, "unstated", ())
        remark = "not stated by the flight: the usual figure" if is_usual else ""
        yield [f"{owner} {field.name}", text, remark]


def _sampling(t_s: FloatArray) -> str:
    return str(series_of(t_s)) if len(t_s) else "no samples"


def versions() -> Blocks:
    """Return who computed this."""
    rows = [["Python", platform.python_version()]]
    rows += [[name, package.version] for name in _PACKAGES for package in distributions(name=name)]
    return table(["package", "version"], rows)
