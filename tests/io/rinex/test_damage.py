"""Damaged files: an error, a counted loss, or exactly what stands there; never a silent change."""

import random
from pathlib import Path

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.rinex.header import read_header
from fgnav.io.rinex.observations import to_observations
from fgnav.io.rinex.reader import read_navigation
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
BODY = GOOD.index("\n>") + 1


def scan(text):
    content = np.frombuffer(text.encode("latin-1"), np.uint8)
    header = read_header(Path("a.rnx"), content, "observations")
    return to_observations(header, content, START_GPS_S, {})


def same(a, b) -> bool:
    """Tell whether two readings hold the same epochs, satellites and values."""
    return (a.satellites, a.signals) == (b.satellites, b.signals) and all(
        np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True)
        for name in ("t_s", "code_m", "phase_cycles", "doppler_hz")
    )


def outcome(text, original):
    """Return ``error``, ``loss``, ``same``, or ``silent``."""
    try:
        got = scan(text)
    except BadInputError:
        return "error"
    if got.losses != original.losses:
        return "loss"
    return "same" if same(got, original) else "silent"


@pytest.mark.parametrize("text", [GOOD, observation_2(epochs=4)], ids=["RINEX 3", "RINEX 2"])
def test_file_cut_anywhere_is_noticed(text):
    """A cut between two epochs shows only where the header announces the last one."""
    original = scan(text)
    start = text.index("END OF HEADER") + 14
    marks = [k for k in range(start, len(text)) if text.startswith(("> ", " 20  6"), k)]
    for cut in range(1, len(text)):
        found = outcome(text[:cut], original)
        between = cut in marks or cut - 1 in marks  # a blank that ends a file is no line
        unseen = found == "silent" and between and "TIME OF LAST OBS" not in text
        assert found in ("error", "loss") or unseen, f"cut at {cut}: {found}"


@pytest.mark.parametrize("text", [GOOD, observation_2(epochs=4)], ids=["RINEX 3", "RINEX 2"])
def test_dropped_or_doubled_line_is_noticed(text):
    original = scan(text)
    lines = text.splitlines(keepends=True)
    for k in range(len(lines)):
        for damaged in (lines[:k] + lines[k + 1 :], lines[: k + 1] + lines[k:]):
            found = outcome("".join(damaged), original)
            in_head = k < text[: text.index("END OF HEADER")].count("\n")
            seen = found in ("error", "loss")
            assert seen or (in_head and found == "same"), f"line {k + 1}: {found}"


@pytest.mark.parametrize("character", ["x", " ", ".", "-", "\0", "\xe9", "\n"])
def test_foreign_character_anywhere_in_the_body_is_noticed_or_read_as_it_stands(character):
    """Where no error is raised, what is counted is what a reader of columns would count."""
    original = scan(GOOD)
    generator = random.Random(character)
    for place in generator.sample(range(BODY, len(GOOD)), 150):
        damaged = GOOD[:place] + character + GOOD[place + 1 :]
        found = outcome(damaged, original)
        if found in ("silent", "loss"):
            got = scan(damaged)
            if any(one.what == "a.rnx epoch" for one in got.losses):
                continue
            rows = [row for key, row in values_3(damaged).items() if key[1][0] == "G"]
            mine = [satellite[0] == "G" for satellite in got.satellites]
            assert (
                np.isfinite(got.code_m[..., mine]).sum() == np.isfinite([r[0] for r in rows]).sum()
            )


def test_cut_or_thinned_navigation_file_is_noticed(tmp_path):
    text = navigation_head() + message("G05") + message("G07")
    path = tmp_path / "n.rnx"
    lines = text.splitlines(keepends=True)
    generator = random.Random(3)
    whole = len(navigation_head() + message("G05"))  # a file of one message, and a right one
    damages = [text[:cut] for cut in generator.sample(range(len(text)), 25) if cut != whole]
    damages += ["".join(lines[:k] + lines[k + 1 :]) for k in range(len(lines))]
    path.write_text(text)
    original = read_navigation([path], START_GPS_S)
    for damaged in damages:
        path.write_text(damaged)
        try:
            got = read_navigation([path], START_GPS_S)
        except BadInputError:
            continue
        assert got.losses or np.array_equal(got.records, original.records)
