"""A dask cluster gives the tables that a process here gives."""

import subprocess
import sys

import pytest

from fgnav.campaign.conduct import conduct
from fgnav.campaign.engines import Dask
from fgnav.checks import BadInputError


@pytest.fixture
def scheduler(tmp_path):
    pytest.importorskip("distributed", reason="dask is an extra: pip install 'fgnav[cluster]'")
    started = []

    def start(*arguments):
        command = [sys.executable, "-m", "distributed.cli." + arguments[0], *arguments[1:]]
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=tmp_path)
        started.append(process)
        return process

    head = start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    address = next(line.split()[-1] for line in head.stderr if "Scheduler at:" in line)
    options = ("--nthreads", "1", "--no-nanny", "--no-dashboard")
    for _ in range(2):
        start("dask_worker", address, *options)
    yield address
    for process in reversed(started):
        process.terminate()
        process.wait(20)
        process.stderr.close()


def test_dask_and_one_process_give_the_same_bytes(whole, order, scheduler, tmp_path):
    conduct(order, tmp_path / "dask", Dask(scheduler))
    for name in ("flights.csv", "flights.parquet", "report.txt"):
        assert (tmp_path / "dask" / name).read_bytes() == (whole[1] / name).read_bytes()


def test_a_scheduler_that_is_not_there_is_one_line(order, tmp_path, monkeypatch):
    pytest.importorskip("distributed", reason="dask is an extra: pip install 'fgnav[cluster]'")
    monkeypatch.setattr("fgnav.campaign.engines._CONNECT_S", 1)
    with pytest.raises(BadInputError, match=r"tcp://127\.0\.0\.1:1"):
        conduct(order, tmp_path / "none", Dask("tcp://127.0.0.1:1"))
