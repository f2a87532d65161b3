"""Writing RINEX 3.04 and 4.00: observations of one antenna, broadcast messages."""

from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav.io.gps_time import BDT_BEHIND_GPS_S, TICKS_PER_S, WEEK_S, gps_s_to_date, to_ticks
from fgnav.io.rinex.constellations import USED
from fgnav.io.rinex.navigation import BDT_WEEK, COLUMNS, FIELDS
from fgnav.types.observations import Observations
from fgnav.types.orbits import BroadcastOrbits

RinexVersion: TypeAlias = Literal["3.04", "4.00"]

_EPOCHS_AT_ONCE = 2000
_FIELD = 16  # columns: F14.3, loss-of-lock indicator, signal strength
_FNAV = 1 << 1  # of a Galileo message's data source
_GEO = {f"C{prn:02d}" for prn in (*range(1, 6), *range(59, 64))}  # they broadcast D2
_LARGEST = 999_999_999.999  # of a negative value in F14.3


def _line(content: str, label: str) -> str:
    return f"{content:<60s}{label}\n"


def write_observations(
    path: Path,
    observations: Observations,
    antenna: int,
    *,
    start_gps_s: float,
    marker: str,
    position_e_m: FloatArray,
    version: RinexVersion = "3.04",
) -> None:
    """Write one antenna's observations.

    A value that rounds to zero is written as 0.001, since zero means "not measured" in RINEX.

    Parameters
    ----------
    antenna : int
        Which of its antennas.
    start_gps_s : float
        GPS time of ``t_s = 0``.
    marker : str
        Name of the antenna.
    position_e_m : ndarray, shape (3,)
        Approximate position for the header.
    version : {"3.04", "4.00"}

    Examples
    --------
    >>> flight = load_flight("demo/flight")
    >>> write_observations(
    ...     Path("a.rnx"),
    ...     flight.observations,
    ...     0,
    ...     start_gps_s=flight.start_gps_s,
    ...     marker="a1",
    ...     position_e_m=flight.origin.p_e_m,
    ... )
    """
    _check_version(version)
    for satellite in observations.satellites:
        if satellite[0] not in USED:
            raise BadInputError(f"{path}: satellite must be of {', '.join(USED)}, got {satellite}")
    ticks = to_ticks(start_gps_s) + _ticks(observations.tag_s[:, antenna])
    names, channels, signals = _layout(observations)
    arrays = [
        getattr(observations, name)[:, antenna]
        for name in ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz")
    ]
    flags = (observations.lock_flags[:, antenna] & 3).astype(np.uint8)
    for value in arrays:
        if np.nanmax(np.abs(value), initial=0.0) > _LARGEST:
            raise BadInputError(
                f"{path}: values must be within {_LARGEST}, RINEX has no more columns"
            )
    with path.open("wb") as file:
        file.write(_head(version, marker, position_e_m, signals, ticks).encode("ascii"))
        for k in range(0, len(ticks), _EPOCHS_AT_ONCE):
            part = slice(k, k + _EPOCHS_AT_ONCE)
            values = np.stack([value[part] for value in arrays], axis=-1)
            file.write(_epochs(ticks[part], names, channels, values, flags[part]))


def _epochs(
    ticks: IntArray, names: list[str], channels: IntArray, values: FloatArray, flags: IntArray
) -> bytes:
    """Return epochs as text.

    Parameters
    ----------
    channels : ndarray, (s, c)
        Columns of each satellite's signals, -1 where it has none.
    values : ndarray, (n, m, 4)
        Code, phase, Doppler, carrier-to-noise density; NaN where not measured.
    flags : ndarray, (n, m)
        Loss-of-lock indicators.
    """
    values = np.where(np.abs(values) < 5e-4, np.copysign(1e-3, values), values)
    some = np.where(channels[:, :, None] < 0, np.nan, values[:, channels])  # (n, s, c, 4)
    lost = np.where(channels < 0, 0, flags[:, channels])
    is_measured = np.isfinite(some).any(axis=(2, 3)) | (lost > 0).any(axis=2)
    epoch, satellite = np.nonzero(is_measured)
    some, lost = some[epoch, satellite], lost[epoch, satellite]
    text = ("%14.3f  " * some.size % tuple(some.ravel().tolist())).encode("ascii")
    fields = np.frombuffer(text, np.uint8).reshape(*some.shape, _FIELD).copy()
    fields[~np.isfinite(some)] = ord(" ")
    fields[:, :, 1, 14] = np.where(lost > 0, ord("0") + lost, ord(" "))
    content, width = fields.tobytes(), fields[0].size if len(fields) else 1
    rows = [content[k : k + width].rstrip() for k in range(0, len(content), width)]
    labels = [names[k].encode("ascii") for k in satellite.tolist()]
    lines = [label + row + b"\n" for label, row in zip(labels, rows, strict=True)]
    ends = np.cumsum(is_measured.sum(axis=1)).tolist()
    out = []
    for tick, begin, end in zip(ticks.tolist(), [0, *ends], ends, strict=False):
        date = " ".join(f"{part:02d}" for part in gps_s_to_date(tick // TICKS_PER_S)[:5])
        second = (tick % (60 * TICKS_PER_S)) / TICKS_PER_S
        out += [f"> {date}{second:11.7f}  0{end - begin:3d}\n".encode("ascii"), *lines[begin:end]]
    return b"".join(out)


def _ticks(tag_s: FloatArray) -> IntArray:
    return np.round(tag_s * TICKS_PER_S).astype(np.int64)


def _layout(observations: Observations) -> tuple[list[str], IntArray, dict[str, list[str]]]:
    """Return satellites, (s,), their channels, (s, c), and the signals by constellation."""
    pairs = list(zip(observations.satellites, observations.signals, strict=True))
    signals: dict[str, list[str]] = {}
    for satellite, signal in sorted(pairs):
        mine = signals.setdefault(satellite[0], [])
        if signal not in mine:
            mine.append(signal)
    satellites = sorted(set(observations.satellites))
    column = {pair: k for k, pair in enumerate(pairs)}
    most = max((len(s) for s in signals.values()), default=0)
    channels = np.full((len(satellites), most), -1)
    for row, satellite in enumerate(satellites):
        for k, signal in enumerate(signals[satellite[0]]):
            channels[row, k] = column.get((satellite, signal), -1)
    return satellites, channels, signals


def _head(
    version: str,
    marker: str,
    position_e_m: FloatArray,
    signals: dict[str, list[str]],
    ticks: IntArray,
) -> str:
    """Return the head of an observation file, without date: equal flights give equal files."""
    marker = marker.encode("ascii", "replace").decode("ascii")[:60]
    system = "M (MIXED)" if len(signals) != 1 else next(iter(signals))
    lines = [
        _line(f"{version:>9s}{'':11s}{'OBSERVATION DATA':20s}{system}", "RINEX VERSION / TYPE"),
        _line("fgnav", "PGM / RUN BY / DATE"),
        _line(marker, "MARKER NAME"),
        _line("", "OBSERVER / AGENCY"),
        _line("", "REC # / TYPE / VERS"),
        _line("", "ANT # / TYPE"),
        _line("".join(f"{x:14.4f}" for x in position_e_m), "APPROX POSITION XYZ"),
        _line(f"{0:14.4f}" * 3, "ANTENNA: DELTA H/E/N"),
    ]
    for letter, names in signals.items():
        types = [c + name for name in names for c in "CLDS"]
        for k in range(0, len(types), 13):
            start = f"{letter}  {len(types):3d}" if k == 0 else ""
            content = f"{start:6s}" + "".join(f" {t}" for t in types[k : k + 13])
            lines.append(_line(content, "SYS / # / OBS TYPES"))
    lines.append(_line("DBHZ", "SIGNAL STRENGTH UNIT"))
    if len(ticks) > 1:
        lines.append(_line(f"{np.median(np.diff(ticks)) / TICKS_PER_S:10.3f}", "INTERVAL"))
    for k, label in ((0, "FIRST"), (-1, "LAST")) if len(ticks) else ():
        *date, second = gps_s_to_date(int(ticks[k]) // TICKS_PER_S)
        content = "".join(f"{part:6d}" for part in date)
        content += f"{second:5d}.{int(ticks[k]) % TICKS_PER_S:07d}     GPS"
        lines.append(_line(content, f"TIME OF {label} OBS"))
    lines += [_line(letter, "SYS / PHASE SHIFT") for letter in signals]
    return "".join(lines) + _line("", "END OF HEADER")


def write_navigation(
    path: Path, broadcast: BroadcastOrbits, *, start_gps_s: float, version: RinexVersion = "3.04"
) -> None:
    """Write broadcast messages of GPS, Galileo, BeiDou and QZSS.

    RINEX 4 has no ionosphere in its header: the model is a record of the first GPS satellite.

    Parameters
    ----------
    start_gps_s : float
        GPS time of ``t_s = 0``.
    version : {"3.04", "4.00"}

    Examples
    --------
    >>> flight = load_flight("demo/flight")
    >>> write_navigation(Path("n.rnx"), flight.broadcast, start_gps_s=flight.start_gps_s)
    """
    _check_version(version)
    fourth, model = version == "4.00", broadcast.klobuchar
    lines = [
        _line(f"{version:>9s}{'':11s}{'NAVIGATION DATA':20s}M", "RINEX VERSION / TYPE"),
        _line("fgnav", "PGM / RUN BY / DATE"),
    ]
    if model.any() and not fourth:
        for name, part in (("GPSA", model[:4]), ("GPSB", model[4:])):
            content = f"{name} " + "".join(f"{value:12.4E}" for value in part)
            lines.append(_line(content, "IONOSPHERIC CORR"))
    lines.append(_line("", "END OF HEADER"))
    for record in broadcast.records:
        if fourth:
            lines.append(f"> EPH {record['satellite']} {_type(record)}\n")
        lines.append(_message(path, record, start_gps_s))
    if model.any() and fourth:  # last: RTKLIB 2.5 skips what follows a record it does not know
        lines.append(_ionosphere(model, start_gps_s))
    path.write_text("".join(lines), encoding="ascii")


def _check_version(version: str) -> None:
    if version not in get_args(RinexVersion):
        raise BadInputError(f"RINEX version: must be 3.04 or 4.00, got {version!r}")


def _type(record: NDArray[Any]) -> str:
    """Return the kind of message as RINEX 4 names it."""
    satellite = str(record["satellite"])
    if satellite[0] == "E":
        return "FNAV" if record["data_source"] & _FNAV else "INAV"
    if satellite[0] == "C":
        return "D2" if satellite in _GEO else "D1"
    return "LNAV"


def _ionosphere(klobuchar: FloatArray, start_gps_s: float) -> str:
    """Return the record of the GPS ionosphere model (RINEX 4.00, table A33), worldwide."""
    date = gps_s_to_date(start_gps_s)
    first = "    " + " ".join(f"{part:02d}" for part in date)
    fields = [f"{value:19.12E}" for value in (*klobuchar, 0.0)]
    rows = [
        first + "".join(fields[:3]),
        "    " + "".join(fields[3:7]),
        "    " + "".join(fields[7:]),
    ]
    return "> ION G01 LNAV\n" + "".join(f"{row}\n" for row in rows)


def _message(path: Path, record: NDArray[Any], start_gps_s: float) -> str:
    """Return the eight lines of a message."""
    letter = str(record["satellite"])[0]
    behind_s = BDT_BEHIND_GPS_S if letter == "C" else 0
    toc_s = start_gps_s + float(record["toc_s"]) - behind_s
    if abs(toc_s - round(toc_s)) > 1e-3:
        raise BadInputError(f"{path}: time of clock must be a whole second, got {toc_s:.6f}")
    toe_s, sent_s = (start_gps_s + float(record[n]) - behind_s for n in ("toe_s", "transmission_s"))
    week = int(toe_s // WEEK_S)
    values = {name: float(record[name]) for name in FIELDS} | {
        "root_a": float(np.sqrt(record["semi_major_axis_m"])),
        "week": week - (BDT_WEEK if letter == "C" else 0),
        "delay_1_s": float(record["group_delay_s"][0]),
        "delay_2_s": float(record["group_delay_s"][1]),
        "transmission_s": sent_s - week * WEEK_S,
    }
    if letter not in "EC":
        values |= {"delay_2_s": float(record["issue"]), "fit": 4.0}  # IODC, hours
    date = " ".join(f"{part:02d}" for part in gps_s_to_date(round(toc_s)))
    words = [f"{values.get(name, 0.0):19.12E}" for name in (*COLUMNS, "", "")]
    rows = ["    " + "".join(words[k : k + 4]) for k in range(3, len(words), 4)]
    return "\n".join([f"{record['satellite']} {date}{''.join(words[:3])}", *rows, ""])
