"""Reading RINEX 2, 3 and 4."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from fgnav.checks import BadInputError
from fgnav.io.rinex.header import read_header
from fgnav.io.rinex.navigation import to_broadcast
from fgnav.io.rinex.observations import to_observations
from fgnav.io.rinex.signals import check_wanted
from fgnav.io.rinex.text import read_text
from fgnav.progress import steps
from fgnav.types.observations import Observations
from fgnav.types.orbits import BroadcastOrbits


def read_navigation(paths: Sequence[Path], start_gps_s: float) -> BroadcastOrbits:
    """Read broadcast messages, as ``read_rinex`` does, of one file or more.

    Examples
    --------
    >>> read_navigation([Path("demo/flight/broadcast.rnx")], 1_277_078_400.0).records["satellite"]
    array(['C11', 'E07', 'G05', 'J02'], dtype='<U3')
    """
    broadcast, _ = read_rinex(paths, [], start_gps_s)
    if broadcast is None:
        raise BadInputError("navigation: must name a file, the list is empty")
    return broadcast


def read_rinex(
    messages: Sequence[Path],
    receivers: Sequence[Path],
    start_gps_s: float,
    signals: Mapping[str, Sequence[str]] | None = None,
) -> tuple[BroadcastOrbits | None, list[Observations]]:
    """Read broadcast messages and several receivers' files, of RINEX 2, 3 or 4.

    Parameters
    ----------
    messages, receivers : sequence of Path
        Navigation and observation files, plain, packed or Hatanaka.
    signals : mapping of str to sequence of str
        Those wanted, by constellation letter; by default all of three carriers.

    Returns
    -------
    BroadcastOrbits or None
        GPS, Galileo, BeiDou and QZSS; everything else is counted. None without files.
    list of Observations
        Of one antenna each, in the order of the paths.

    Examples
    --------
    >>> _, (observations,) = read_rinex([], [Path("demo/flight/a1.rnx")], 1_277_078_400.0)
    >>> observations.satellites[0], observations.signals[0]
    ('C11', '2I')
    """
    texts = [read_text(path) for path in receivers]
    headers = [read_header(p, t, "observations") for p, t in zip(receivers, texts, strict=True)]
    check_wanted(headers, signals or {})
    observations = [
        to_observations(headers[k], texts[k], start_gps_s, signals or {})
        for k in steps(len(receivers))
    ]
    if not messages:
        return None, observations
    texts = [read_text(path) for path in messages]
    headers = [read_header(p, t, "navigation") for p, t in zip(messages, texts, strict=True)]
    return to_broadcast(headers, texts, start_gps_s), observations
