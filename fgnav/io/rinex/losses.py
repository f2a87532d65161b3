"""What of RINEX observations is not used, and why."""

from collections import Counter

import numpy as np

from fgnav.checks import BadInputError, IntArray, Loss, quoted
from fgnav.io.gps_time import TICKS_PER_S, to_ticks
from fgnav.io.rinex.epochs import (
    COUNT,
    CUT,
    NO_EPOCH,
    SATELLITE,
    VALUE,
    Body,
    Event,
    Fault,
)
from fgnav.io.rinex.header import Header

# Highest satellite number of each constellation in use.
KNOWN_SATELLITES = {"G": 32, "E": 36, "C": 46, "J": 10, "R": 27}
CONSTELLATIONS = {"R": "GLONASS", "S": "SBAS", "I": "NavIC"}
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


def losses_of_faults(header: Header, body: Body, faults: list[Fault]) -> list[Loss]:
    """Return the epochs that were left out, by the rule that they break."""
    n = len(body.begins)
    by_rule: dict[int, list[Fault]] = {}
    for fault in sorted(faults, key=lambda one: one.line):
        by_rule.setdefault(CUT if fault.line >= n - 1 else fault.rule, []).append(fault)
    return [
        Loss(
            what=f"{header.path.name} epoch",
            reason=f"{_RULES[rule].format(column=some[0].column)}, line "
            f"{header.lines + 1 + some[0].line} first",
            count=len(some),
        )
        for rule, some in sorted(by_rule.items())
    ]


def losses_of_unused_satellites(letter: str, numbers: IntArray) -> list[Loss]:
    """Return the losses of a constellation that is not used, or of satellites that are not."""
    if letter not in KNOWN_SATELLITES:
        what, reason = f"{CONSTELLATIONS[letter]} observation", "constellation not used"
        return [Loss(what=what, reason=reason, count=len(numbers))]
    counts = Counter(numbers.tolist())
    reason = "of a number that is not used"
    return [
        Loss(what=f"{letter}{one:02d} observation", reason=reason, count=count)
        for one, count in sorted(counts.items())
    ]


def losses_of_events(header: Header, body: Body, events: list[Event]) -> list[Loss]:
    """Return the count of events; refuse those that change the meaning of what follows."""
    counts = Counter[int]()
    for event in events:
        for k in range(event.line + 1, min(event.after, len(body.begins))):
            content = body.text[body.begins[k] : body.ends[k]].tobytes().decode("latin-1")
            label = content[60:].strip()
            if event.flag in (3, 4) and label in _MEANING and content not in header.content:
                raise BadInputError(
                    f"{header.path}: line {header.lines + 1 + k}: header inside the body must "
                    f"not change the observation types, got {quoted(label)}; split the file "
                    "there"
                )
        counts[event.flag] += max(1, event.announced)
    return [
        Loss(what=f"event {flag} record", reason=f"{_EVENTS[flag]}: not used", count=count)
        for flag, count in counts.items()
    ]


def losses_of_end(header: Header, ticks: IntArray) -> list[Loss]:
    """Count the epochs between the last one and the last one that the header announces."""
    if not np.isfinite(header.last_gps_s):
        return []
    rest = to_ticks(header.last_gps_s) - int(ticks[-1])
    if len(ticks) > 1:
        missing = round(rest / int(np.median(np.diff(ticks))))
    elif header.interval_s:
        missing = round(rest / (header.interval_s * TICKS_PER_S))
    else:  # of one epoch nothing tells the interval: one at least
        missing = int(rest > 0)
    if missing <= 0:
        return []
    reason = "the header announces a later end: the file may be cut"
    return [Loss(what=f"{header.path.name} epoch", reason=reason, count=missing)]
