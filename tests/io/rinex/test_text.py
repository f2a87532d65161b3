"""The bytes of a file: plain, packed, damaged in its packing."""

import bz2
import gzip

import numpy as np
import pytest
from hatanaka import rnx2crx
from ncompress import compress

from fgnav.checks import BadInputError
from fgnav.io.rinex.reader import read_rinex
from fgnav.io.rinex.text import read_text
from tests.io.rinex_texts import observation_2, observation_3

PLAIN = observation_3().encode()


def test_plain_gzip_and_hatanaka_give_the_same_text(tmp_path):
    packed = {"a.rnx": PLAIN, "a.rnx.gz": gzip.compress(PLAIN), "a.crx": rnx2crx(PLAIN)}
    packed["a.crx.gz"] = gzip.compress(packed["a.crx"])
    packed |= {"a.20o.Z": compress(PLAIN), "a.bz2": bz2.compress(PLAIN)}
    packed["a.20d.Z"] = compress(packed["a.crx"])
    for name, content in packed.items():
        path = tmp_path / name
        path.write_bytes(content)
        text = read_text(path)
        body = b"".join(line.rstrip() + b"\n" for line in text.tobytes().splitlines())
        assert body == b"".join(line.rstrip() + b"\n" for line in PLAIN.splitlines())


@pytest.mark.parametrize(
    ("content", "rule"),
    [
        (b"", "must hold text, the file is empty"),
        (b"\n\n  \n", "must hold text, the file is empty"),
        (gzip.compress(PLAIN)[:-20], "damaged gzip file"),
        (gzip.compress(PLAIN)[:60] + b"\0\1\2" + gzip.compress(PLAIN)[63:], "damaged gzip file"),
        (b"\x1f\x9d\x90abc", "damaged compress file"),
        (b"PK\x03\x04abc", "damaged zip file"),
        (b"BZh91AY", "damaged bzip2 file"),
        (
            rnx2crx(PLAIN).replace(b"1.0  ", b"9.9  ").replace(b"3.0  ", b"9.9  "),
            "damaged Hatanaka file",
        ),
    ],
)
def test_damaged_packing_is_named(tmp_path, content, rule):
    path = tmp_path / "a.rnx"
    path.write_bytes(content)
    with pytest.raises(BadInputError, match=rule) as caught:
        read_text(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("made", [observation_3, observation_2])
def test_a_cut_hatanaka_file_is_read_to_its_last_whole_epoch(tmp_path, made):
    whole = rnx2crx(made().encode())
    path = tmp_path / "a.crx"
    path.write_bytes(whole)
    (want,) = read_rinex([], [path], 1_277_078_400.0)[1]
    for cut in (whole[:-9], whole[:-1], b"".join(whole.splitlines(keepends=True)[:-1])):
        path.write_bytes(cut)
        (got,) = read_rinex([], [path], 1_277_078_400.0)[1]
        np.testing.assert_array_equal(got.code_m, want.code_m[:-1])
        (loss,) = got.unused
        assert (loss.what, loss.count) == ("a.crx epoch", 1)
        assert loss.reason.startswith("cut at the end of the file")
