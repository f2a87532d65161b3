"""The folder of a campaign: a file for each run, at a cost that does not grow with their number."""

from pathlib import Path

from fgnav.campaign.folder import Folder
from fgnav.campaign.order import runs_of


def test_a_run_is_kept_without_a_look_at_all_others(order, tmp_path, monkeypatch):
    folder = Folder(tmp_path, order, resume=False)

    def listed(_path):
        raise AssertionError

    monkeypatch.setattr(Path, "iterdir", listed)
    for run in runs_of(order):
        folder.keep(run, {"case": order.case[run.case].name})
    assert len(list(folder)) == 9


def test_what_a_killed_writer_left_goes_when_the_folder_is_opened(order, tmp_path):
    Folder(tmp_path, order, resume=False)
    left = tmp_path / "runs" / ".000-000-0000000.json.12345.part"
    left.write_text("{")
    folder = Folder(tmp_path, order, resume=True)
    assert not left.exists()
    assert len(folder.missing()) == 9
