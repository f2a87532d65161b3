"""RTKLIB's converter in a child process: a crash or a hang ends as one line."""

import sys

import pytest

from fgnav.checks import BadInputError
from fgnav.io.rtklib_convert import convert


@pytest.mark.parametrize(
    ("program", "text"),
    [
        ("import os; os.kill(os.getpid(), 11)", r"a.ubx: RTKLIB crashed .status -11.; the file"),
        ("import time; time.sleep(60)", "a.ubx: RTKLIB did not end within 0 s"),
        ("import sys; sys.exit('no pyrtklib5')", "RTKLIB cannot run: no pyrtklib5"),
    ],
)
def test_what_goes_wrong_names_the_file(tmp_path, program, text):
    path = tmp_path / "a.ubx"
    path.write_bytes(b"")
    with pytest.raises(BadInputError, match=text):
        convert(path, [], command=(sys.executable, "-c", program), timeout_s=0.3)
