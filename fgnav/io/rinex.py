"""Reading RINEX 2, 3 and 4: checked by our own scan, decoded by RTKLIB in a child process."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from fgnav.checks import BadInputError
from fgnav.io.decoder import Decoder, Job
from fgnav.io.rinex_header import Header, read_header
from fgnav.io.rinex_messages import to_broadcast
from fgnav.io.rinex_navigation import scan_navigation
from fgnav.io.rinex_records import to_observations
from fgnav.io.rinex_scan import Scan, scan_observations
from fgnav.io.rinex_text import Bytes, is_plain, read_text
from fgnav.io.signal_choice import choose_signals
from fgnav.observations import Observations
from fgnav.orbits import BroadcastOrbits


def read_observations(path: Path, start_gps_s: float) -> Observations:
    """Read one receiver's RINEX observation file.

    Parameters
    ----------
    path : Path
        RINEX 2, 3 or 4, plain, .gz or Hatanaka.
    start_gps_s : float
        GPS time of ``t_s = 0``.

    Returns
    -------
    Observations
        Of one antenna.

    Raises
    ------
    BadInputError
        Naming file, line, rule and value.
    """
    return read_receivers([path], start_gps_s)[0]


def read_navigation(paths: Sequence[Path], start_gps_s: float) -> BroadcastOrbits:
    """Read broadcast messages.

    Parameters
    ----------
    paths : sequence of Path
        RINEX 2, 3 or 4 navigation files, plain or .gz.
    start_gps_s : float
        GPS time of ``t_s = 0``.

    Returns
    -------
    BroadcastOrbits
        GPS, Galileo, BeiDou and QZSS; everything else is counted.

    Raises
    ------
    BadInputError
        Naming file, line, rule and value.
    """
    if not paths:
        raise BadInputError("navigation: must name a file, the list is empty")
    with TemporaryDirectory(prefix="fgnav-") as name, Decoder(len(paths), Path(name)) as decoder:
        headers, scans, jobs = [], [], []
        for k, path in enumerate(paths):
            text = read_text(path)
            header = read_header(path, text, "navigation")
            scan = scan_navigation(header, text)
            plain = Path(name) / f"file{k}.rnx"
            plain.write_bytes(scan.text.tobytes())
            headers.append(header)
            scans.append(scan)
            jobs.append(Job(kind="navigation", source=path, path=plain))
        return to_broadcast(headers, scans, decoder.decode(jobs), start_gps_s)


def read_receivers(paths: Sequence[Path], start_gps_s: float) -> list[Observations]:
    """Read several receivers' files at once; they agree on signals where they can.

    Parameters
    ----------
    paths : sequence of Path
    start_gps_s : float

    Returns
    -------
    list of Observations
        Of one antenna each, in the order of the paths.

    Raises
    ------
    BadInputError
        As ``read_observations``.
    """
    if not paths:
        return []
    with TemporaryDirectory(prefix="fgnav-") as name, Decoder(len(paths), Path(name)) as decoder:
        checked = [_checked(path, Path(name) / f"file{k}.rnx") for k, path in enumerate(paths)]
        choices = choose_signals([header for header, _, _ in checked])
        jobs = [
            Job(kind="observations", source=header.path, path=plain, options=choice.options)
            for (header, _, plain), choice in zip(checked, choices, strict=True)
        ]
        decoded = decoder.decode(jobs)
        return [
            to_observations(header, scan, choices[k], decoded.records(k), decoded, start_gps_s)
            for k, (header, scan, _) in enumerate(checked)
        ]


def _checked(path: Path, plain: Path) -> tuple[Header, Scan, Path]:
    """Return header and scan of a file, and where RTKLIB finds it: plain, without events."""
    text = read_text(path)
    header = read_header(path, text, "observations")
    scan = scan_observations(header, text)
    if is_plain(path, text) and not scan.events:
        plain.symlink_to(path.resolve())
    else:
        plain.write_bytes(_without(text, scan.events).tobytes())
    return header, scan, plain


def _without(text: Bytes, ranges: Sequence[tuple[int, int]]) -> Bytes:
    """Return the text without ranges of bytes: RTKLIB takes some events for observations."""
    if not ranges:
        return text
    keep = np.ones(len(text), bool)
    for start, end in ranges:
        keep[start:end] = False
    return text[keep]
