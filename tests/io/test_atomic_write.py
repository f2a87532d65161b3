import os
import resource
import subprocess
import sys

import pytest

from fgnav.checks import BadInputError
from fgnav.io.atomic_write import atomic_file, atomic_folder, check_folder, check_place, write_text


@pytest.mark.parametrize(("make", "name"), [(atomic_file, "a.txt"), (atomic_folder, "a")])
def test_what_is_written_appears_whole_or_not_at_all(tmp_path, make, name):
    path = tmp_path / name

    def write(text, *, breaks=False):
        with make(path) as part:
            (part if name == "a.txt" else part / "file").write_text(text)
            if breaks:
                raise RuntimeError

    with pytest.raises(RuntimeError):
        write("half", breaks=True)
    assert list(tmp_path.iterdir()) == []
    write("all of it")
    assert list(tmp_path.iterdir()) == [path]
    file = path if name == "a.txt" else path / "file"
    with pytest.raises(RuntimeError):
        write("half", breaks=True)
    assert file.read_text() == "all of it"
    assert list(tmp_path.iterdir()) == [path]


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "folder").mkdir()
    with pytest.raises(BadInputError, match=r"absent/a.txt: cannot be written: No such file"):
        write_text(tmp_path / "absent" / "a.txt", "x")
    with pytest.raises(BadInputError, match="its folder does not exist; make it first"):
        check_place(tmp_path / "absent" / "a.txt")
    with pytest.raises(BadInputError, match="is a folder; name a file"):
        check_place(tmp_path / "folder")


def test_a_full_disk_is_named_with_file_and_folder(tmp_path):
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limit[1]))
    try:
        with pytest.raises(BadInputError, match=rf"a.txt: cannot be written: .*in {tmp_path}"):
            write_text(tmp_path / "a.txt", "x" * 5000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    assert not list(tmp_path.iterdir())


def test_what_killed_writers_left_goes_with_the_next_and_what_lives_stays(tmp_path):
    (tmp_path / ".a.txt.999999999.part").write_text("half")
    (tmp_path / ".b.txt.999999999.part").write_text("of another file")
    (tmp_path / ".a.txt.mine.part").write_text("nobody's")
    living = subprocess.Popen(
        [sys.executable, "-c", _WRITER, str(tmp_path / "a.txt")], stdout=subprocess.PIPE
    )
    assert living.stdout.readline()
    write_text(tmp_path / "a.txt", "whole")
    left = {path.name for path in tmp_path.iterdir()}
    part = f".a.txt.{living.pid}.part"
    assert left == {"a.txt", ".b.txt.999999999.part", ".a.txt.mine.part", part}
    living.kill()
    living.wait()
    living.stdout.close()
    write_text(tmp_path / "a.txt", "again")
    assert part not in {path.name for path in tmp_path.iterdir()}


_WRITER = """
import sys, time
from pathlib import Path
from fgnav.io.atomic_write import atomic_file
with atomic_file(Path(sys.argv[1])):
    print("begun", flush=True)
    time.sleep(60)
"""


def test_a_folder_that_cannot_be_is_refused_before_the_work_and_none_is_made(tmp_path, monkeypatch):
    check_folder(tmp_path / "a" / "b")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").touch()
    for place in (tmp_path / "file", tmp_path / "file" / "x"):
        with pytest.raises(BadInputError, match="file: is a file, not a folder; name another"):
            check_folder(place)
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write everywhere
    with pytest.raises(BadInputError, match=f"a: {tmp_path} may not be written"):
        check_folder(tmp_path / "a")
