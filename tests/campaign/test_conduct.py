"""Campaigns: the same tables whoever works them off, and whatever interrupts them."""

import csv
import os
import signal
import subprocess
import sys

import msgspec
import pytest

from fgnav.campaign import conduct as conducting
from fgnav.campaign.conduct import conduct
from fgnav.campaign.engines import Local
from fgnav.campaign.fly import fly
from fgnav.checks import BadInputError
from tests.campaign.conftest import here


def interrupted_after(count):
    def engine(work, tasks, lost):  # noqa: ARG001
        for k, task in enumerate(tasks):
            if k == count:
                raise KeyboardInterrupt
            yield work(task)

    return engine


def tables(folder):
    return [(folder / name).read_bytes() for name in ("flights.csv", "report.txt", "report.html")]


def test_every_flight_and_method_has_a_row(whole, order):
    outcome, out = whole
    with (out / "flights.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 * (2 + 1) * 2
    assert outcome.kept == outcome.asked == 9
    assert all(float(row["attitude_rmse_deg"]) > 0 for row in rows)
    assert {row["method"] for row in rows} == set(order.titles)


def test_maximum_likelihood_beats_the_closed_form_by_the_report(whole):
    outcome, _ = whole
    line = next(x for x in outcome.text.splitlines() if x.startswith("quiet"))
    assert float(line.split()[-1]) < 1
    assert "[" not in line  # of three flights, whatever is swept, there is no interval


def test_interrupted_and_resumed_gives_the_same_bytes(whole, order, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        conduct(order, tmp_path / "cut", interrupted_after(4))
    outcome = conduct(order, tmp_path / "cut", here, resume=True)
    assert outcome.flown == 5
    assert tables(tmp_path / "cut") == tables(whole[1])


def test_two_processes_give_the_same_bytes(whole, order, tmp_path):
    conduct(order, tmp_path / "two", Local(2))
    assert tables(tmp_path / "two") == tables(whole[1])


def test_a_folder_of_another_campaign_is_left_alone(order, tmp_path):
    out = tmp_path / "taken"
    conduct(msgspec.structs.replace(order, flights=1), out, here)
    before = tables(out)
    with pytest.raises(BadInputError, match="--resume"):
        conduct(order, out, here)
    with pytest.raises(BadInputError, match="another campaign"):
        conduct(msgspec.structs.replace(order, seed=9), out, here, resume=True)
    assert tables(out) == before


def test_a_run_that_fails_is_counted_and_the_rest_goes_on(order, tmp_path, monkeypatch):
    def fragile(order, run):
        if run.flight == 1:
            raise ZeroDivisionError("one in three")
        return fly(order, run)

    monkeypatch.setattr(conducting, "fly", lambda o, r: _guarded(fragile, o, r))
    outcome = conduct(order, tmp_path / "out", here)
    assert outcome.kept == 9
    assert [(one.count, one.what) for one in outcome.unused] == [(3, "run failed")]


def _guarded(work, order, run):
    from fgnav.campaign.fly import failed

    try:
        return work(order, run)
    except ZeroDivisionError as error:
        return failed(order, run, str(error))


def test_a_full_disk_is_counted_and_the_rest_goes_on(order, tmp_path, monkeypatch):
    from fgnav.campaign.folder import Folder

    keep = Folder.keep

    def full(self, run, record):
        if run.flight == 2:
            raise BadInputError("x: cannot be written: No space left on device")
        keep(self, run, record)

    monkeypatch.setattr(Folder, "keep", full)
    outcome = conduct(order, tmp_path / "out", here)
    assert outcome.kept == 6
    assert "No space left" in outcome.unused[0].reason


def _deadly(task):
    if task == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return task


def _minus(task):
    return -task


def test_a_worker_that_is_killed_takes_only_its_own_run_with_it():
    results = sorted(Local(2)(_deadly, range(8), _minus))
    assert results == sorted([0, 1, 2, -3, 4, 5, 6, 7])


def test_a_worker_whose_parent_is_gone_begins_no_run():
    code = "from fgnav.campaign.engines import _under; _under({}, print, 'begun')"
    for parent, said in ((os.getpid(), "begun\n"), (-1, "")):
        command = [sys.executable, "-c", code.format(parent)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout) == (not said, said)
