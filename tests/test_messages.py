"""The catalogue of messages: codes, words, severities."""

import json
import pickle
import re
from pathlib import Path

import pytest

from fgnav.messages import MESSAGES, SEVERITIES, by_severity, note

PACKAGE = Path(__file__).parents[1] / "fgnav"


@pytest.mark.parametrize("code", MESSAGES)
def test_a_message_is_at_most_forty_words_and_ends_in_a_stop(code):
    assert re.fullmatch(f"[{SEVERITIES}][1-5]\\d\\d", code)
    assert MESSAGES[code].endswith(".")
    assert len(MESSAGES[code].split()) <= 40


def test_every_code_is_used_and_no_other():
    files = [path for path in PACKAGE.rglob("*.py") if path.name != "messages.py"]
    source = "\n".join(path.read_text(encoding="utf-8") for path in files)
    used = set(re.findall(r'"([EWID]\d{3})"', source))
    assert used == MESSAGES.keys()


def test_a_note_is_its_text_for_json_and_stays_itself_through_pickle():
    one = note("E401", method="batch")
    assert json.loads(json.dumps([one])) == [str(one)]
    again = pickle.loads(pickle.dumps(one))
    assert (again, again.code) == (one, "E401")


def test_the_worst_comes_first():
    notes = [note("D209"), "It rained.", note("W404"), note("E401", method="batch")]
    assert [getattr(one, "code", "") for one in by_severity(notes)] == ["E401", "W404", "", "D209"]
