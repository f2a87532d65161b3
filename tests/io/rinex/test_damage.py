"""Damaged files: an error, a counted loss, or exactly what stands there; never a silent change."""

import random
from pathlib import Path

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.rinex.header import read_header
from fgnav.io.rinex.navigation import to_broadcast
from fgnav.io.rinex.observations import to_observations
from tests.io.rinex_texts import (
    epoch_3,
    head_3,
    line,
    message,
    navigation_head,
    observation_2,
    values_3,
)

START_GPS_S = 1_277_078_400.0
LAST = line("  2020     6    25     0     0    5.0000000     GPS", "TIME OF LAST OBS")
GOOD = head_3(extra=LAST) + "".join(epoch_3(k) for k in range(6))
TEXTS = {"3": GOOD, "2": observation_2(epochs=4)}
MESSAGES = navigation_head() + message("G05") + message("G07")


def scan(text):
    content = np.frombuffer(text.encode("latin-1"), np.uint8)
    header = read_header(Path("a.rnx"), content, "observations")
    return to_observations(header, content, START_GPS_S, {})


def outcome(text, original):
    """Return ``error``, ``loss``, ``same``, or ``silent``."""
    try:
        got = scan(text)
    except BadInputError:
        return "error"
    if got.unused != original.unused:
        return "loss"
    is_same = (got.satellites, got.signals) == (original.satellites, original.signals) and all(
        np.array_equal(getattr(got, name), getattr(original, name), equal_nan=True)
        for name in ("t_s", "code_m", "phase_cycles", "doppler_hz")
    )
    return "same" if is_same else "silent"


@pytest.mark.parametrize("version", TEXTS)
def test_file_cut_anywhere_is_noticed(version):
    """A cut between two epochs shows only where the header announces the last one."""
    text = TEXTS[version]
    original, start = scan(text), text.index("END OF HEADER") + 14
    marks = [k for k in range(start, len(text)) if text.startswith(("> ", " 20  6"), k)]
    near = {k + shift for k in marks for shift in range(-3, 4)}
    for cut in sorted({*range(1, len(text), 7), *near}):
        found = outcome(text[:cut], original)
        between = cut in marks or cut - 1 in marks  # a blank that ends a file is no line
        unseen = found == "silent" and between and "TIME OF LAST OBS" not in text
        assert found in ("error", "loss") or unseen, f"cut at {cut}: {found}"


@pytest.mark.parametrize("version", TEXTS)
def test_dropped_or_doubled_line_is_noticed(version):
    text = TEXTS[version]
    original, lines = scan(text), text.splitlines(keepends=True)
    for k in range(len(lines)):
        for damaged in (lines[:k] + lines[k + 1 :], lines[: k + 1] + lines[k:]):
            found = outcome("".join(damaged), original)
            in_head = k < text[: text.index("END OF HEADER")].count("\n")
            seen = found in ("error", "loss")
            assert seen or (in_head and found == "same"), f"line {k + 1}: {found}"


@pytest.mark.parametrize("character", ["x", " ", ".", "-", "\0", "\xe9", "\n", "1"])
def test_foreign_character_anywhere_in_the_body_is_noticed_or_read_as_it_stands(character):
    """Where no epoch is lost, every value is what a reader of columns finds."""
    original, generator = scan(GOOD), random.Random(character)
    for place in generator.sample(range(GOOD.index("\n>") + 1, len(GOOD)), 80):
        damaged = GOOD[:place] + character + GOOD[place + 1 :]
        if outcome(damaged, original) in ("error", "same"):
            continue
        got = scan(damaged)
        if any(one.what == "a.rnx epoch" for one in got.unused):
            continue
        column = {pair: m for m, pair in enumerate(zip(got.satellites, got.signals, strict=True))}
        for (epoch, *pair), row in values_3(damaged).items():
            m = column.get(tuple(pair))
            if m is not None:
                found = (got.code_m[epoch, 0, m], got.phase_cycles[epoch, 0, m])
                np.testing.assert_array_equal(found, row[:2])


def test_messages_that_are_damaged_anywhere_are_noticed_or_read_as_they_stand():
    """A cut between two messages leaves a right file of one."""
    lines, generator = MESSAGES.splitlines(keepends=True), random.Random(3)
    whole = len(MESSAGES) - len(message("G07"))
    cuts = [MESSAGES[:cut] for cut in range(1, len(MESSAGES)) if cut != whole]
    drops = ["".join(lines[:k] + lines[k + 1 :]) for k in range(len(lines))]
    doubles = ["".join(lines[: k + 1] + lines[k:]) for k in range(2, len(lines))]
    inside = [generator.randrange(len(navigation_head()), len(MESSAGES)) for _ in range(200)]
    lacks = [MESSAGES[:k] + MESSAGES[k + generator.randint(1, 18) :] for k in inside]

    def read(text):
        content = np.frombuffer(text.encode(), np.uint8)
        header = read_header(Path("n.rnx"), content, "navigation")
        return to_broadcast([header], [content], START_GPS_S)

    original = read(MESSAGES)
    for damaged in cuts + drops + doubles + lacks:
        try:
            got = read(damaged)
        except BadInputError:
            continue
        assert got.unused or np.array_equal(got.records, original.records), damaged
