"""Reading RINEX 2, 3 and 4: checked by our own scan, decoded by RTKLIB in a child process."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from fgnav.checks import BadInputError
from fgnav.io.decoder import Decoder, Job
from fgnav.io.rinex.header import Header, read_header
from fgnav.io.rinex.messages import to_broadcast
from fgnav.io.rinex.navigation import NavigationScan, scan_navigation
from fgnav.io.rinex.records import to_observations
from fgnav.io.rinex.scan import Scan, scan_observations
from fgnav.io.rinex.text import Bytes, is_plain, read_text
from fgnav.io.signal_choice import choose_signals
from fgnav.progress import steps
from fgnav.types.observations import Observations
from fgnav.types.orbits import BroadcastOrbits


def read_navigation(paths: Sequence[Path], start_gps_s: float) -> BroadcastOrbits:
    """Read broadcast messages, as ``read_rinex`` does, of one file or more."""
    broadcast, _ = read_rinex(paths, [], start_gps_s)
    if broadcast is None:
        raise BadInputError("navigation: must name a file, the list is empty")
    return broadcast


def read_rinex(
    messages: Sequence[Path], receivers: Sequence[Path], start_gps_s: float
) -> tuple[BroadcastOrbits | None, list[Observations]]:
    """Read broadcast messages and several receivers' files, which agree on signals where they can.

    All at once: it takes RTKLIB longer to start than to decode a minute of eight antennas.

    Parameters
    ----------
    messages : sequence of Path
        RINEX 2, 3 or 4 navigation files, plain or .gz.
    receivers : sequence of Path
        RINEX 2, 3 or 4 observation files, plain, .gz or Hatanaka.
    start_gps_s : float
        GPS time of ``t_s = 0``.

    Returns
    -------
    BroadcastOrbits or None
        GPS, Galileo, BeiDou and QZSS; everything else is counted. None without files.
    list of Observations
        Of one antenna each, in the order of the paths.

    Raises
    ------
    BadInputError
        Naming file, line, rule and value.
    """
    paths = [*messages, *receivers]
    if not paths:
        return None, []
    with TemporaryDirectory(prefix="fgnav-") as name, Decoder(paths, Path(name)) as decoder:
        files = [Path(name) / f"file{k}.rnx" for k in range(len(paths))]
        n = len(messages)
        orbits = [_sorted_out(*pair) for pair in zip(messages, files[:n], strict=True)]
        checked = [_checked(receivers[k], files[n + k]) for k in steps(len(receivers))]
        choices = choose_signals([header for header, _ in checked])
        jobs = [
            Job(kind="navigation", source=source, path=path)
            for source, path in zip(messages, files[:n], strict=True)
        ]
        jobs += [
            Job(kind="observations", source=source, path=path, options=choice.options)
            for source, path, choice in zip(receivers, files[n:], choices, strict=True)
        ]
        decoded = decoder.decode(jobs)
        observations = [
            to_observations(header, scan, choice, decoded.records(k), decoded, start_gps_s)
            for k, ((header, scan), choice) in enumerate(zip(checked, choices, strict=True), n)
        ]
        if not n:
            return None, observations
        headers, scans = [header for header, _ in orbits], [scan for _, scan in orbits]
        return to_broadcast(headers, scans, decoded, start_gps_s), observations


def _sorted_out(path: Path, plain: Path) -> tuple[Header, NavigationScan]:
    """Return header and scan of a navigation file, and write what RTKLIB can decode of it."""
    text = read_text(path)
    header = read_header(path, text, "navigation")
    scan = scan_navigation(header, text)
    plain.write_bytes(scan.text.tobytes())
    return header, scan


def _checked(path: Path, plain: Path) -> tuple[Header, Scan]:
    """Return header and scan of an observation file, and put it before RTKLIB without events."""
    text = read_text(path)
    header = read_header(path, text, "observations")
    scan = scan_observations(header, text)
    if is_plain(path, text) and not scan.events:
        plain.symlink_to(path.resolve())
    else:
        plain.write_bytes(_without(text, scan.events).tobytes())
    return header, scan


def _without(text: Bytes, ranges: Sequence[tuple[int, int]]) -> Bytes:
    """Return the text without ranges of bytes: RTKLIB takes some events for observations."""
    if not ranges:
        return text
    keep = np.ones(len(text), bool)
    for start, end in ranges:
        keep[start:end] = False
    return text[keep]
