"""The child processes: a crash, a hang or a foreign library ends as one line."""

import ctypes
import sys
from types import SimpleNamespace

import pytest

from fgnav.checks import BadInputError
from fgnav.io import rtklib
from fgnav.io.decoder import Decoder, Job
from tests.io.rinex_texts import observation_3


@pytest.fixture
def jobs(tmp_path):
    path = tmp_path / "a.rnx"
    path.write_text(observation_3())
    return [Job(kind="observations", source=tmp_path / "flown.crx.gz", path=path)]


def test_several_files_come_back_in_order(tmp_path, jobs):
    longer = tmp_path / "b.rnx"
    longer.write_text(observation_3(epochs=6))
    both = [jobs[0], Job(kind="observations", source=longer, path=longer)]
    with Decoder([job.path for job in both], tmp_path) as decoder:
        decoded = decoder.decode(both)
    assert [len(decoded.records(k)) for k in range(2)] == [20, 30]
    assert decoded.satellites[5] == "G05"
    assert decoded.signals[1] == "1C"


def test_few_bytes_are_decoded_by_one_process_and_many_by_several(tmp_path, jobs, monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    large = tmp_path / "large.rnx"
    with large.open("wb") as file:
        file.truncate(5_000_000)
    for extra, processes in ((jobs[0].path, 1), (tmp_path / "none.rnx", 1), (large, 2)):
        folder = tmp_path / f"out{extra.stem}"
        folder.mkdir()
        with Decoder([jobs[0].path, extra], folder) as decoder:
            decoder.decode(jobs)
        assert len(list(folder.glob("names*.json"))) == processes


def test_crash_names_the_file(tmp_path, jobs):
    crash = (sys.executable, "-c", "import os; os.kill(os.getpid(), 11)")
    rule = "flown.crx.gz: RTKLIB's reader crashed .status -11.; the file is damaged"
    with (
        Decoder([jobs[0].path], tmp_path, command=crash) as decoder,
        pytest.raises(BadInputError, match=rule),
    ):
        decoder.decode(jobs)


def test_hang_names_the_file(tmp_path, jobs):
    hang = (sys.executable, "-c", "import time; time.sleep(60)")
    rule = "flown.crx.gz: RTKLIB's reader did not end within 0 s"
    with (
        Decoder([jobs[0].path], tmp_path, command=hang, timeout_s=0.2) as decoder,
        pytest.raises(BadInputError, match=rule),
    ):
        decoder.decode(jobs)


def test_program_that_cannot_run_says_why(tmp_path, jobs):
    broken = (sys.executable, "-c", "import sys; sys.exit('no pyrtklib5')")
    with (
        Decoder([jobs[0].path], tmp_path, command=broken) as decoder,
        pytest.raises(BadInputError, match="RTKLIB's reader cannot run: no pyrtklib5"),
    ):
        decoder.decode(jobs)


def test_decoder_takes_one_list_only(tmp_path, jobs):
    with Decoder([jobs[0].path], tmp_path) as decoder:
        decoder.decode(jobs)
        with pytest.raises(BadInputError, match="takes one list of jobs only"):
            decoder.decode(jobs)


def stand_in(structure):
    """Return a record as the binding would show it: moments of 1 s, arrays of 7, zeros."""
    record = SimpleNamespace()
    for name, kind in structure._fields_:
        value = [7] * 6 if issubclass(kind, ctypes.Array) else 0
        setattr(record, name, SimpleNamespace(time=1, sec=0.0) if kind is rtklib.Moment else value)
    return record


def another_binding():
    """Return a stand-in for the binding, whose records differ from the memory that is viewed."""
    data, eph = stand_in(rtklib.Record), stand_in(rtklib.Message)
    table = SimpleNamespace(n=2, data=[data] * 2, eph=[eph] * 2)
    return SimpleNamespace(
        obs_t=lambda: table, nav_t=lambda: table, sta_t=lambda: None, readrnx=lambda *_: 1
    )


def test_another_memory_layout_is_noticed(tmp_path, monkeypatch):
    library = ctypes.CDLL(None)

    def zeros(count):
        return lambda _, kind, *__: (rtklib.STRUCTURES[kind] * count)()

    monkeypatch.setattr(rtklib, "read", zeros(2))
    wrong = rtklib.differing_fields(another_binding(), library, str(tmp_path))
    assert wrong[:2] == ["observations: time", "observations: LLI"]
    assert wrong[-1] == "navigation: tgd"
    assert "observations: sat" not in wrong
    monkeypatch.setattr(rtklib, "read", zeros(1))
    wrong = rtklib.differing_fields(another_binding(), library, str(tmp_path))
    assert wrong == ["observations: number of records"]
