"""GNSS receivers' own formats, turned into RINEX by RTKLIB; RINEX and SP3 as they are."""

from pathlib import Path
from tempfile import mkdtemp

from fgnav.checks import BadInputError, Loss
from fgnav.io.flight.toml import gps_seconds
from fgnav.io.importers.formats.framing import passed_over
from fgnav.io.importers.recording import Recording
from fgnav.io.importers.settings import Settings
from fgnav.io.rinex.text import read_text
from fgnav.io.rtklib_convert import convert
from fgnav.io.user_files import read_bytes

_ANTENNA = "antenna.position_b_m"
_PLACE_UNKNOWN = "where the antenna sits in the body is in no file: state it"


def read_ubx(path: Path, settings: Settings, scratch: Path) -> Recording:
    """Read u-blox's UBX: RXM-RAWX and RXM-SFRBX."""
    return _converted(path, "ubx", settings, scratch)


def read_sbf(path: Path, settings: Settings, scratch: Path) -> Recording:
    """Read Septentrio's SBF: MeasEpoch and navigation blocks."""
    return _converted(path, "sbf", settings, scratch)


def read_novatel(path: Path, settings: Settings, scratch: Path) -> Recording:
    """Read NovAtel's OEM4 to OEM7 binary: RANGE or RANGECMP, and ephemerides."""
    return _converted(path, "novatel", settings, scratch)


def read_rtcm3(path: Path, settings: Settings, scratch: Path) -> Recording:
    """Read RTCM 3: MSM or legacy observations, and ephemerides; ``start`` tells the week."""
    return _converted(path, "rtcm3", settings, scratch)


def _converted(path: Path, format: str, settings: Settings, scratch: Path) -> Recording:  # noqa: A002
    """Convert a file in a child process."""
    if not path.is_file():
        raise BadInputError(f"{path}: no such file; check the name")
    if format == "rtcm3" and settings.start is None:
        raise BadInputError(
            f"{path}: RTCM 3 has no week; state start in --settings, within half a week"
        )
    near_s = "" if settings.start is None else repr(gps_seconds(path, settings.start))
    observations = Path(mkdtemp(dir=scratch)) / "observations"
    convert(path, [format, str(path), str(observations), near_s])
    navigation = observations.with_suffix(".nav")
    files = [one for one in (observations, navigation) if one.is_file() and one.stat().st_size]
    if observations not in files:
        raise BadInputError(
            f"{path}: RTKLIB finds no observations of format {format} in it; look whether the "
            "receiver was set to put out raw measurements, or take its fixes by --format nmea"
        )
    renamed = [
        file.rename(file.with_name(f"{path.stem}{end}"))
        for file, end in zip(files, (".obs", ".nav"), strict=False)
    ]
    kinds, outside = passed_over(read_bytes(path), format)
    reason = f"of {path.name}, in no whole message of {format}: damaged, or of another format"
    names = {kind: f"{kind:04X}" if format == "ubx" else str(kind) for kind in kinds} | {0: "NMEA"}
    losses = [
        Loss(what=f"{names[kind]} message", reason="RTKLIB does not decode it", count=count)
        for kind, count in sorted(kinds.items())
    ]
    return Recording(
        source=path,
        observations=tuple(renamed[:1]),
        navigation=tuple(renamed[1:]),
        losses=(*losses, Loss(what="byte", reason=reason, count=outside)),
        missing={_ANTENNA: _PLACE_UNKNOWN},
    )


def read_rinex_file(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Take a RINEX file as it is: observations of one antenna, or navigation messages."""
    kind = read_text(path)[:60].tobytes()[20:21]
    if kind == b"O":
        return Recording(source=path, observations=(path,), missing={_ANTENNA: _PLACE_UNKNOWN})
    if kind in (b"N", b"G", b"E", b"C", b"J"):
        return Recording(source=path, navigation=(path,))
    raise BadInputError(f"{path}: must be RINEX observations or navigation, is of type {kind!r}")


def read_sp3_file(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Take a file of precise orbits as it is."""
    return Recording(source=path, orbits=(path,))
