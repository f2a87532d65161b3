"""What of RINEX observations is not used, and why: counted by what and reason."""

from collections import Counter
from typing import TypeAlias

import numpy as np

from fgnav.checks import BadInputError, IntArray, quoted
from fgnav.io.gps_time import TICKS_PER_S, to_ticks
from fgnav.io.rinex.constellations import CONSTELLATIONS, USED
from fgnav.io.rinex.header import Header
from fgnav.io.rinex.scan import COUNT, CUT, NO_EPOCH, SATELLITE, VALUE, Body

Counts: TypeAlias = Counter[tuple[str, str]]
_EVENTS = {2: "antenna starts to move", 3: "new site", 4: "header lines", 5: "external event"}
_EVENTS[6] = "cycle slip records"
# Labels that change what the numbers mean; inside the body they must repeat the header's lines.
_MEANING: tuple[str, ...] = ("# / TYPES OF OBSERV", "SYS / # / OBS TYPES", "SYS / SCALE FACTOR")
_MEANING += ("TIME OF FIRST OBS",)
_RULES = {
    NO_EPOCH: "no epoch begins where one must (date, event flag or number of satellites)",
    COUNT: "announces another number of satellites than it has",
    CUT: "cut at the end of the file",
    SATELLITE: "names a satellite that the header does not, or twice",
    VALUE: "a value must be a number with three decimals, column {column}",
}


def count_faults(header: Header, body: Body, faults: IntArray, counts: Counts) -> None:
    """Count the epochs that were left out, by the rule that they break, with its first line."""
    rules = np.where(faults[:, 1] >= len(body.begins) - 1, CUT, faults[:, 0])
    for rule in np.unique(rules).tolist():
        some = faults[rules == rule]
        reason = _RULES[rule].format(column=some[0, 2])
        reason += f", line {header.lines + 1 + some[0, 1]} first"
        counts[f"{header.path.name} epoch", reason] = len(some)


def count_satellites(letter: str, numbers: IntArray, counts: Counts) -> None:
    """Count a constellation that is not used, or satellites that are not."""
    if letter not in USED:
        what = f"{CONSTELLATIONS[letter].name} observation"
        counts[what, "constellation not used"] += len(numbers)
        return
    for number, count in zip(*np.unique(numbers, return_counts=True), strict=True):
        counts[f"{letter}{number:02d} observation", "of a number that is not used"] += int(count)


def count_events(header: Header, body: Body, events: IntArray, counts: Counts) -> None:
    """Count events; refuse those that change the meaning of what follows."""
    for flag, announced, line, after in events.tolist():
        for k in range(line + 1, min(after, len(body.begins))):
            content = body.text[body.begins[k] : body.ends[k]].tobytes().decode("latin-1")
            label = content[60:].strip()
            if flag in (3, 4) and label in _MEANING and content not in header.content:
                raise BadInputError(
                    f"{header.path}: line {header.lines + 1 + k}: header inside the body must "
                    f"not change the observation types, got {quoted(label)}; split the file "
                    "there"
                )
        counts[f"event {flag} record", f"{_EVENTS[flag]}: not used"] += max(1, announced)


def count_end(header: Header, ticks: IntArray, counts: Counts) -> None:
    """Count the epochs between the last one and the last one that the header announces."""
    if not np.isfinite(header.last_gps_s):
        return
    remainder = to_ticks(header.last_gps_s) - int(ticks[-1])
    if len(ticks) > 1:
        missing = round(remainder / int(np.median(np.diff(ticks))))
    elif header.interval_s:
        missing = round(remainder / (header.interval_s * TICKS_PER_S))
    else:  # of one epoch nothing tells the interval: one at least
        missing = int(remainder > 0)
    reason = "the header announces a later end: the file may be cut"
    counts[f"{header.path.name} epoch", reason] += max(missing, 0)
