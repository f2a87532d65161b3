"""Several files become one flight: clocks, origin, antennas, what is missing."""

import sys

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.cli import main
from fgnav.io.importers import IMPORTERS
from fgnav.io.importers.formats.readers import reader
from fgnav.io.importers.recognise import recognise_format
from fgnav.io.importers.recording import Recording
from fgnav.io.importers.settings import Settings
from tests.io.importers.helpers import imported, refused, whole_of
from tests.io.importers.test_pos import HEAD, ROW


def unit(tmp_path, name="a", **changes):
    t_s = changes.pop("t_s", np.arange(5.0))
    force = {f"f{axis}_mps2": np.full(len(t_s), 1.0 + k) for k, axis in enumerate("xyz")}
    return Recording(source=tmp_path / name, tables={"imu": {"t_s": t_s, **force}}, **changes)


def fixes(tmp_path, **changes):
    place = {"latitude_deg": np.full(5, 40.0), "longitude_deg": np.full(5, -4.0)}
    table = {"t_s": 3 + np.arange(5.0), **place, "height_m": np.full(5, 700.0)}
    return Recording(source=tmp_path / "b", tables={"fixes": table}, **changes)


def test_a_dated_unit_stays_where_it_was_and_another_starts_with_the_flight(tmp_path):
    places = fixes(tmp_path, gps_start_s=1000.0)
    whole = whole_of([unit(tmp_path, gps_start_s=1000.25), places], Settings())
    assert whole.flight.start_gps_s == 1003
    np.testing.assert_allclose(whole.flight.imu.t_s, np.arange(5.0) - 2.75)
    np.testing.assert_allclose(whole.flight.fixes[0].t_s, np.arange(5.0))
    assert "imu.clock_offset_s" not in whole.missing
    whole = whole_of([unit(tmp_path, clock="own", t_s=100 + np.arange(3.0)), places], Settings())
    np.testing.assert_allclose(whole.flight.imu.t_s, np.arange(3.0))
    assert "`fgnav check` finds it" in whole.missing["imu.clock_offset_s"]


def test_clocks_of_two_receivers_that_may_differ_are_named(tmp_path):
    files = [fixes(tmp_path, clock="own"), fixes(tmp_path, clock="own")]
    assert "have clocks of their own" in whole_of(files, Settings()).missing["fixes"]
    assert "fixes" not in whole_of(files[:1], Settings()).missing


def test_a_missing_date_or_place_is_named(tmp_path):
    whole = whole_of([unit(tmp_path, clock="own")], Settings())
    assert whole.flight.start_gps_s == 0
    assert {"start", "origin", "imu.clock_offset_s"} <= set(whole.missing)
    whole = whole_of([unit(tmp_path, clock="own")], Settings(start="1980-01-06T00:01:00"))
    assert (whole.flight.start_gps_s, "start" in whole.missing) == (60, False)


def test_rows_that_no_flight_can_have_are_left_out(tmp_path):
    t_s = np.array([0.0, 1.0, 1.0, 0.5, 2.0, np.nan])
    table = dict(fixes(tmp_path).tables["fixes"])
    table |= {f"sigma_{axis}_m": np.array([1.0, 1.0, 0.0, 1.0, 1.0]) for axis in "ned"}
    places = Recording(source=tmp_path / "b", tables={"fixes": table})
    whole = whole_of([unit(tmp_path, t_s=t_s), places], Settings())
    assert len(whole.flight.imu.t_s) == 3
    assert len(whole.flight.fixes[0].t_s) == 4
    assert {loss.reason: loss.count for loss in whole.unused} == {
        "its time does not increase (a)": 2,
        "a value is missing, or no instrument has it (a)": 1,
        "a value is missing, or no instrument has it (b)": 1,
    }


def test_what_no_flight_can_have_is_refused(tmp_path):
    with pytest.raises(
        BadInputError, match="c: has imu, as a has; a flight takes those of one instr"
    ):
        whole_of([unit(tmp_path), unit(tmp_path, name="c")], Settings())
    with pytest.raises(BadInputError, match="a: holds nothing that a flight could use"):
        Recording(source=tmp_path / "a")
    with pytest.raises(BadInputError, match="imu: column 'fx_mps2' is missing"):
        Recording(source=tmp_path / "a", tables={"imu": {"t_s": np.zeros(1)}})
    table = unit(tmp_path).tables["imu"] | {"wx_radps": np.zeros(5)}
    with pytest.raises(BadInputError, match="imu: column 'wy_radps' is missing"):
        Recording(source=tmp_path / "a", tables={"imu": table})
    height = {"t_s": np.arange(2.0), "height_m": np.zeros(2)}
    baro = Recording(source=tmp_path / "a", tables={"barometer": height})
    with pytest.raises(BadInputError, match=r"holds barometer alone; state noise in \[barometer\]"):
        whole_of([baro], Settings())


def test_formats_are_told_by_first_bytes_then_by_names(tmp_path):
    for name, content, format_ in [
        ("log", b"ULog\x01\x12\x35\x01", "ulog"),
        ("rover.dat", b"\xb5\x62\x02\x15", "ubx"),
        ("solution.txt", (HEAD + ROW).encode(), "pos"),
        ("brdc", b" " * 60 + b"RINEX VERSION / TYPE\n", "rinex"),
        ("imu.csv", b"1,2,3\n", "csv"),
    ]:
        (tmp_path / name).write_bytes(content)
        assert recognise_format(tmp_path / name, tmp_path)[0] == format_


def test_help_names_every_format(capsys):
    assert main(["import", "--help"]) == 0
    text = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert f"Of all files: {', '.join(IMPORTERS)}, or an installed one" in text


def test_a_format_that_nobody_knows_is_one_line(tmp_path, capsys):
    (tmp_path / "a.xyz").write_bytes(b"\0\1")
    line = refused(capsys, tmp_path, tmp_path / "a.xyz")
    assert r"a.xyz: of no known format, it starts with b'\x00\x01'; state it by" in line
    assert "state it by --format, one of csv, " in line
    assert "nowhere: no such file" in refused(capsys, tmp_path, tmp_path / "nowhere")
    assert "is a folder, and no bag; name the files" in refused(capsys, tmp_path, tmp_path)
    assert main(["import", "--out", str(tmp_path / "none")]) == 2
    assert "name a file to import" in capsys.readouterr().err


def test_a_reader_that_is_not_installed_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyulog", None)
    with pytest.raises(BadInputError, match=r"format ulog needs pyulog .* 'fgnav\[importers\]'"):
        reader("pyulog", "ulog")


def test_an_importer_of_the_working_folder_is_one_too(tmp_path, monkeypatch):
    (tmp_path / "own_format.py").write_text(
        "import numpy as np\n"
        "from fgnav.io.importers.recording import Recording\n"
        "def read(path, settings, scratch):\n"
        "    samples = {f'f{a}_mps2': np.ones(3) for a in 'xyz'}\n"
        "    table = {'t_s': np.arange(3.0), **samples}\n"
        "    return Recording(source=path, tables={'imu': table}, gps_start_s=1e9)\n"
    )
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log.own").write_text("anything")
    _, flight = imported(tmp_path, "own_format:read", tmp_path / "log.own")
    assert (flight.start_gps_s, len(flight.imu.t_s)) == (1e9, 3)
