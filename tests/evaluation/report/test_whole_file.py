import pytest

from fgnav.checks import BadInputError
from fgnav.evaluation.report.whole_file import check_place, made_folder, whole_file, write_text


def test_a_file_appears_whole(tmp_path):
    write_text(tmp_path / "a.txt", "all of it")
    assert (tmp_path / "a.txt").read_text() == "all of it"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_an_error_on_the_way_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def breaks():
        with whole_file(path) as part:
            part.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        breaks()
    assert path.read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "folder").mkdir()
    with pytest.raises(BadInputError, match=r"absent/a.txt: cannot be written: No such file"):
        write_text(tmp_path / "absent" / "a.txt", "x")
    with pytest.raises(BadInputError, match="its folder does not exist; make it first"):
        check_place(tmp_path / "absent" / "a.txt")
    with pytest.raises(BadInputError, match="is a folder; name a file"):
        check_place(tmp_path / "folder")


def test_folders_are_made_and_a_file_in_their_place_is_named(tmp_path):
    assert made_folder(tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").write_text("")
    with pytest.raises(BadInputError, match="file: cannot be made: File exists"):
        made_folder(tmp_path / "file")
