"""Damaged files of every format: a flight of what is left, or one line and exit status 2.

Where each message has a checksum, whatever is lost is counted: nothing changes in silence.
"""

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.cli import main
from fgnav.io.importers import importer_named
from fgnav.io.importers.settings import Settings
from tests.io.importers import logs, streams, test_pos
from tests.io.importers.streams import gga, rmc, sentence
from tests.io.importers.test_text_columns import FIXES, IMU, ROWS, TRACK

EACH = 12  # damaged files


def kfgins():
    t = 456300 + 0.005 * np.arange(1, 41)
    return "".join(f"{one:.3f} .0005 -.001 .0015 .0025 -.005 -.049\n" for one in t).encode()


def bag(tmp_path, kind):
    place = tmp_path / ("log.bag" if kind == "bag" else "log")
    logs.bag(place, kind)
    return (place if kind == "bag" else next(place.glob(f"*.{kind}"))).read_bytes()


FILES = {
    "imu.csv": (lambda _: ROWS.encode(), IMU, ()),
    "track.csv": (lambda _: TRACK.encode(), FIXES, ()),
    "rover.pos": (lambda _: (test_pos.HEAD + test_pos.ROW).encode(), "", ()),
    "imu.txt": (lambda _: kfgins(), "", ("--format", "kfgins")),
    "log.ulg": (lambda _: logs.ulog(), "", ("--format", "ulog")),
    "log.BIN": (lambda _: logs.ardupilot(), "", ()),
    "a.bag": (lambda path: bag(path, "bag"), "", ("--format", "rosbag")),
    "a.mcap": (lambda path: bag(path, "mcap"), "", ("--format", "mcap")),
    "a.db3": (lambda path: bag(path, "db3"), "", ("--format", "rosbag")),
    "rover.ubx": (lambda _: streams.raw_ubx(), "", ("--format", "ubx")),
}
SENTENCES = "".join(
    rmc(f"12000{k}.00") + gga(f"12000{k}.00") + sentence("GPHDT,123.5,T") for k in range(5)
)
CHECKED = {
    "nmea": SENTENCES.encode(),
    "ubx": streams.ubx(),
    "sbf": streams.sbf(),
    "novatel": streams.novatel() + streams.novatel_ascii(),
}


def damaged(content, rng):
    """Return a file cut, with bytes changed, taken out, or put in."""
    at, size = int(rng.integers(len(content))), int(rng.integers(1, 60))
    return (
        content[:at],
        content[:at] + rng.bytes(min(size, 5)) + content[at + min(size, 5) :],
        content[:at] + content[at + size :],
        content[:at] + rng.bytes(size) + content[at:],
    )[rng.integers(4)]


@pytest.mark.parametrize("name", FILES)
def test_damage_is_a_flight_or_one_line(name, tmp_path, capsys):
    make, settings, words = FILES[name]
    (tmp_path / "s.toml").write_text(settings)
    content, rng = make(tmp_path), np.random.default_rng(11)
    for k in range(EACH):
        file, out = tmp_path / name, tmp_path / f"flight{k}"
        file.write_bytes(damaged(content, rng) if k else content)
        call = ["import", str(file), "--settings", str(tmp_path / "s.toml"), *words]
        status = main([*call, "--out", str(out)])
        said = capsys.readouterr().err.splitlines()
        assert status in ((0, 2) if k else (0,)), said
        assert len(said) == (status == 2)
        assert out.exists() == (status == 0)


@pytest.mark.parametrize("name", CHECKED)
def test_nothing_is_lost_in_silence_where_messages_have_checksums(name, tmp_path):
    def read(content):
        (tmp_path / "a").write_bytes(content)
        return importer_named(name)(tmp_path / "a", Settings(), tmp_path)

    content, rng = CHECKED[name], np.random.default_rng(12)
    whole = read(content)
    for changed in (damaged(content, rng) for _ in range(60)):
        try:
            got = read(changed)
        except BadInputError:
            continue
        rows = {kind: len(table["t_s"]) for kind, table in got.tables.items()}
        known = {kind: len(table["t_s"]) for kind, table in whole.tables.items()}
        assert rows == known or got.unused != whole.unused
        for kind, table in got.tables.items():  # what is read is right
            at_s = table["t_s"] + got.gps_start_s
            known_s = whole.tables[kind]["t_s"] + whole.gps_start_s
            near = np.abs(at_s[:, None] - known_s).argmin(axis=1)
            np.testing.assert_allclose(at_s, known_s[near], atol=1e-5)
            for column in set(table) & set(whole.tables[kind]) - {"t_s"}:
                want = whole.tables[kind][column][near]
                np.testing.assert_allclose(table[column], want, rtol=1e-7)  # single precision
