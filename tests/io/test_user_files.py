"""Files of strangers: what is no regular file, too large or packed into a bomb is not read."""

import gzip
import os
import tracemalloc
from pathlib import Path

import pytest

from fgnav.checks import BadInputError
from fgnav.io.strict_toml import read_toml
from fgnav.io.user_files import read_bytes, unpacked


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


def test_holes_of_a_sparse_file_are_refused_and_not_read(tmp_path):
    for name, head in (("a.csv", b""), ("b.rnx", b"text\n" * 300_000)):
        path = tmp_path / name
        path.write_bytes(head)
        os.truncate(path, 1 << 31)
        tracemalloc.start()
        with pytest.raises(BadInputError, match=f"{name}: must be text, got a NUL as byte") as seen:
            read_bytes(path, is_text=True)
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert f"byte {len(head) + 1} of" in str(seen.value)
        assert most < 1 << 23
    plain = os.urandom(2 << 20)
    (tmp_path / "c.gz").write_bytes(gzip.compress(plain))
    assert read_bytes(tmp_path / "c.gz", is_text=True) == plain
    os.truncate(tmp_path / "c.gz", 1 << 31)
    with pytest.raises(BadInputError, match=r"c\.gz: must be text, got a NUL as byte"):
        read_bytes(tmp_path / "c.gz", is_text=True)


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
    inner = unpacked(Path("a.gz"), bomb)
    with pytest.raises(BadInputError, match=r"a\.gz: unpacks to more, at most \d+ are read"):
        unpacked(Path("a.gz"), inner)
    two = gzip.compress(b"one") + gzip.compress(b"two")
    assert unpacked(Path("a.gz"), two) == b"onetwo"


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("a = " + "[" * 5000 + "]" * 5000, "must be TOML of 32 levels or fewer"),
        ("a = " + "[" * 50 + "]" * 50, "key a.*: must be nested 32 deep or less"),
        (".".join("a" * 20_000) + " = 1", "must be TOML of 32 levels or fewer, a key has more"),
        ("[" + ".".join(['"a"'] * 50) + "]", "must be TOML of 32 levels or fewer, a key has more"),
        ("a = " + "9" * 5000, "must be TOML, Exceeds the limit"),
        ("a = 99999999999999999999", "key a: must be a number of 64 bits"),
        ("k" * 300 + " = 1", "key 'kkk.*: must be printable, of 200 characters or fewer"),
        ('a = ["b", "c\\u0000d"]', r"key a\[1\]: must not hold NUL"),
        ("a = 1" + "0" * 100_000 + ".5", None),
    ],
)
def test_hostile_toml_is_refused_in_a_line(tmp_path, text, rule):
    path = tmp_path / "a.toml"
    path.write_text(text)
    if rule is None:
        read_toml(path)  # in no time: a number is no list of keys
        return
    with pytest.raises(BadInputError, match=rule) as caught:
        read_toml(path)
    assert len(str(caught.value)) < 300
