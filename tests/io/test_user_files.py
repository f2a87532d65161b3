"""Files of strangers: what is no regular file, too large or packed into a bomb is not read."""

import gzip
import os
from pathlib import Path

import pytest

from fgnav.checks import BadInputError
from fgnav.io.flight.toml import FlightTable
from fgnav.io.strict_toml import as_table, read_toml
from fgnav.io.user_files import read_bytes, unpack


def test_a_file_that_is_too_large_is_refused_unread(tmp_path, monkeypatch):
    path = tmp_path / "a"
    path.write_bytes(b"abcd")
    with pytest.raises(BadInputError, match="a: has 4 bytes, at most 3 are read"):
        read_bytes(path, 3)
    monkeypatch.setenv("FGNAV_MAX_BYTES", "2")
    with pytest.raises(BadInputError, match="a: has 4 bytes, at most 2 are read; FGNAV_MAX_BYTES"):
        read_bytes(path)
    os.truncate(path, 1 << 40)  # takes no room
    monkeypatch.delenv("FGNAV_MAX_BYTES")
    with pytest.raises(BadInputError, match="at most 4000000000 are read"):
        read_bytes(path)


def test_what_is_no_regular_file_is_named_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path, kind in ((tmp_path / "pipe", "a pipe"), ("/dev/zero", "a device"), (tmp_path, "a f")):
        with pytest.raises(BadInputError, match=f"must be a regular file, is {kind}"):
            read_bytes(Path(path))
    with pytest.raises(BadInputError, match="is no name of a file"):
        read_bytes(tmp_path / "a\0b")
    if Path("/proc/self/environ").exists():
        assert read_bytes(Path("/proc/self/environ")) == b""


def test_a_bomb_is_refused_before_it_is_unpacked():
    bomb = gzip.compress(gzip.compress(bytes(100_000_000)))
    inner = unpack(Path("a.gz"), bomb)
    with pytest.raises(BadInputError, match=r"a\.gz: unpacks to more, at most \d+ are read"):
        unpack(Path("a.gz"), inner)
    two = gzip.compress(b"one") + gzip.compress(b"two")
    assert unpack(Path("a.gz"), two) == b"onetwo"


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("a = " + "[" * 5000 + "]" * 5000, "must be TOML, maximum recursion depth"),
        ("a = " + "9" * 5000, "must be TOML, Exceeds the limit"),
        ("format = 99999999999999999999", "key format: must be a number of 64 bits"),
        ("k" * 300 + " = 1", "key kkk.*: unknown; the nearest known key is"),
        ('"\\u001b[31m" = 1', r"key .x1b.31m: unknown"),
        ('name = "c\\u0000d"', "key name: must not hold NUL"),
    ],
)
def test_hostile_toml_is_refused_in_a_line(tmp_path, text, rule):
    path = tmp_path / "a.toml"
    path.write_text(text)
    with pytest.raises(BadInputError, match=rule) as caught:
        as_table(path, read_toml(path), FlightTable)
    assert len(str(caught.value)) < 300
