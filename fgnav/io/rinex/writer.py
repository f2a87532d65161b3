"""Writing RINEX 3.04 and 4.00: observations of one antenna, broadcast messages."""

from collections.abc import Iterable, Sequence
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
_TYPES_A_LINE = 13
_FNAV = 1 << 1  # of a Galileo message's data source
_GEO = {f"C{prn:02d}" for prn in (*range(1, 6), *range(59, 64))}  # they broadcast D2
_LARGEST = 999_999_999.999  # of a negative value in F14.3


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
    marker : str
        Name of the antenna.
    position_e_m : ndarray, shape (3,)
        Approximate position for the header.

    Examples
    --------
    >>> flight = load_flight("demo/flight")
    >>> place = {"start_gps_s": flight.start_gps_s, "position_e_m": flight.origin.p_e_m}
    >>> write_observations(Path("a.rnx"), flight.observations, 0, marker="a1", **place)
    """
    for satellite in observations.satellites:
        if satellite[0] not in USED:
            raise BadInputError(f"{path}: satellite must be of {', '.join(USED)}, got {satellite}")
    tag_s = observations.tag_s[:, antenna]
    ticks = to_ticks(start_gps_s) + np.round(tag_s * TICKS_PER_S).astype(np.int64)
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
    system = "M (MIXED)" if len(signals) != 1 else next(iter(signals))
    head = [_first_line(version, "OBSERVATION DATA", system), *_head(marker, position_e_m, signals)]
    if len(ticks) > 1:
        head.append((f"{np.median(np.diff(ticks)) / TICKS_PER_S:10.3f}", "INTERVAL"))
    for k, label in ((0, "FIRST"), (-1, "LAST")) if len(ticks) else ():
        *date, second = gps_s_to_date(int(ticks[k]) // TICKS_PER_S)
        content = "".join(f"{number:6d}" for number in date)
        content += f"{second:5d}.{int(ticks[k]) % TICKS_PER_S:07d}     GPS"
        head.append((content, f"TIME OF {label} OBS"))
    head += [*((letter, "SYS / PHASE SHIFT") for letter in signals), ("", "END OF HEADER")]
    with path.open("wb") as file:
        file.write(_lines(head).encode("ascii"))
        for k in range(0, len(ticks), _EPOCHS_AT_ONCE):
            some = slice(k, k + _EPOCHS_AT_ONCE)
            values = np.stack([value[some] for value in arrays], axis=-1)
            file.write(_epochs(ticks[some], names, channels, values, flags[some]))


def _lines(head: Iterable[tuple[str, str]]) -> str:
    return "".join(f"{content:<60s}{label}\n" for content, label in head)


def _first_line(version: str, kind: str, system: str) -> tuple[str, str]:
    if version not in get_args(RinexVersion):
        raise BadInputError(f"RINEX version: must be 3.04 or 4.00, got {version!r}")
    return f"{version:>9s}{'':11s}{kind:20s}{system}", "RINEX VERSION / TYPE"


def _head(
    marker: str, position_e_m: FloatArray, signals: dict[str, list[str]]
) -> list[tuple[str, str]]:
    """Return lines of an observation file's head, without date: equal flights give equal files."""
    lines = [
        ("fgnav", "PGM / RUN BY / DATE"),
        (marker.encode("ascii", "replace").decode("ascii")[:60], "MARKER NAME"),
        ("", "OBSERVER / AGENCY"),
        ("", "REC # / TYPE / VERS"),
        ("", "ANT # / TYPE"),
        ("".join(f"{x:14.4f}" for x in position_e_m), "APPROX POSITION XYZ"),
        (f"{0:14.4f}" * 3, "ANTENNA: DELTA H/E/N"),
    ]
    for letter, names in signals.items():
        types = [c + name for name in names for c in "CLDS"]
        for k in range(0, len(types), _TYPES_A_LINE):
            start = f"{letter}  {len(types):3d}" if k == 0 else ""
            content = f"{start:6s}" + "".join(f" {t}" for t in types[k : k + _TYPES_A_LINE])
            lines.append((content, "SYS / # / OBS TYPES"))
    return [*lines, ("DBHZ", "SIGNAL STRENGTH UNIT")]


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
    for i, satellite in enumerate(satellites):
        for k, signal in enumerate(signals[satellite[0]]):
            channels[i, k] = column.get((satellite, signal), -1)
    return satellites, channels, signals


def _epochs(
    ticks: IntArray, names: Sequence[str], channels: IntArray, values: FloatArray, flags: IntArray
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
    records = (content[k : k + width].rstrip() for k in range(0, len(content), width))
    labels = (names[k].encode("ascii") for k in satellite.tolist())
    lines = [label + record + b"\n" for label, record in zip(labels, records, strict=True)]
    ends = np.cumsum(is_measured.sum(axis=1)).tolist()
    out = []
    for tick, begin, end in zip(ticks.tolist(), [0, *ends], ends, strict=False):
        second = (tick % (60 * TICKS_PER_S)) / TICKS_PER_S
        date = f"> {_date(tick // TICKS_PER_S, 5)}{second:11.7f}  0{end - begin:3d}\n"
        out += [date.encode("ascii"), *lines[begin:end]]
    return b"".join(out)


def _date(gps_s: float, numbers: int = 6) -> str:
    """Return year, month, day, hour, minute and second, or the first of these."""
    return " ".join(f"{number:02d}" for number in gps_s_to_date(gps_s)[:numbers])


def write_navigation(
    path: Path, broadcast: BroadcastOrbits, *, start_gps_s: float, version: RinexVersion = "3.04"
) -> None:
    """Write broadcast messages of GPS, Galileo, BeiDou and QZSS.

    RINEX 4 has no ionosphere in its header: the model is a record of the first GPS satellite.

    Examples
    --------
    >>> flight = load_flight("demo/flight")
    >>> write_navigation(Path("n.rnx"), flight.broadcast, start_gps_s=flight.start_gps_s)
    """
    is_fourth, model = version == "4.00", broadcast.klobuchar
    head = [_first_line(version, "NAVIGATION DATA", "M"), ("fgnav", "PGM / RUN BY / DATE")]
    for name, four in (("GPSA", model[:4]), ("GPSB", model[4:])):
        if model.any() and not is_fourth:
            content = "".join(f"{value:12.4E}" for value in four)
            head.append((f"{name} {content}", "IONOSPHERIC CORR"))
    text = [_lines([*head, ("", "END OF HEADER")])]
    for record in broadcast.records:
        if is_fourth:
            text.append(f"> EPH {record['satellite']} {_type(record)}\n")
        text.append(_message(path, record, start_gps_s))
    if model.any() and is_fourth:  # last: RTKLIB 2.5 skips what follows a record it does not know
        words = [_date(start_gps_s), *(f"{value:19.12E}" for value in (*model, 0.0))]
        rows = ["".join(words[k:end]) for k, end in ((0, 4), (4, 8), (8, 10))]
        text += ["> ION G01 LNAV\n", *(f"    {content}\n" for content in rows)]
    path.write_text("".join(text), encoding="ascii")


def _type(record: NDArray[Any]) -> str:
    """Return the kind of message as RINEX 4 names it."""
    satellite = str(record["satellite"])
    if satellite[0] == "E":
        return "FNAV" if record["data_source"] & _FNAV else "INAV"
    if satellite[0] == "C":
        return "D2" if satellite in _GEO else "D1"
    return "LNAV"


def _message(path: Path, record: NDArray[Any], start_gps_s: float) -> str:
    """Return the eight lines of a message."""
    letter = str(record["satellite"])[0]
    behind_s = BDT_BEHIND_GPS_S if letter == "C" else 0
    toc_s, toe_s, sent_s = (
        start_gps_s + float(record[name]) - behind_s
        for name in ("toc_s", "toe_s", "transmission_s")
    )
    if abs(toc_s - round(toc_s)) > 1e-3:
        raise BadInputError(f"{path}: time of clock must be a whole second, got {toc_s:.6f}")
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
    words = [f"{values.get(name, 0.0):19.12E}" for name in (*COLUMNS, "", "")]
    rows = ["    " + "".join(words[k : k + 4]) for k in range(3, len(words), 4)]
    first = f"{record['satellite']} {_date(round(toc_s))}{''.join(words[:3])}"
    return "\n".join([first, *rows, ""])
