"""The stable face of the library."""

import subprocess
import sys

import pytest

import fgnav


@pytest.mark.parametrize("name", fgnav.__all__)
def test_every_name_of_the_face_is_there(name):
    assert getattr(fgnav, name) is not None


def test_a_name_that_is_not_there_says_so():
    with pytest.raises(AttributeError, match="module 'fgnav' has no attribute 'magic'"):
        _ = fgnav.magic
    with pytest.raises(AttributeError, match=r"module 'fgnav.integers' has no attribute 'magic'"):
        _ = fgnav.integers.magic


def test_importing_the_library_brings_nothing_heavy():
    code = "import fgnav, sys; print(sorted({'numpy','numba','gtsam','scipy'} & set(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
