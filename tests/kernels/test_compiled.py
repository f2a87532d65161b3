"""Kernels that call kernels: the same from Python and within each other, compiled once."""

import numpy as np
import pytest

from fgnav.kernels.announcement import announced_to
from fgnav.kernels.compiled import kernel, kernel_with

SOURCE = """
import numpy as np
from fgnav.kernels.compiled import kernel

@kernel
def inverse(x):
    if x == 0.0:
        raise ValueError("no inverse of zero")
    return 1.0 / x

@kernel
def summed(x):
    total = np.zeros(1)
    for value in x:
        total[0] += inverse(value)
    return total[0]
"""


@pytest.fixture
def kernels(tmp_path, monkeypatch):
    """Return a function that imports the same file of two kernels anew."""
    import importlib

    (tmp_path / "a_file_of_kernels.py").write_text(SOURCE)
    monkeypatch.syspath_prepend(tmp_path)

    def imported():
        monkeypatch.delitem(importlib.import_module("sys").modules, "a_file_of_kernels", False)
        return importlib.import_module("a_file_of_kernels")

    return imported


def test_a_kernel_is_the_same_from_python_and_within_another(kernels):
    module = kernels()
    assert module.summed(np.array([1.0, 2.0, 4.0])) == 1.75
    assert module.inverse(4.0) == 0.25
    for call in (lambda: module.inverse(0.0), lambda: module.summed(np.zeros(2))):
        with pytest.raises(ValueError, match="no inverse of zero"):
            call()


def test_only_what_python_calls_is_announced_and_only_when_it_is_compiled(kernels):
    names = []
    with announced_to(names.append):
        for _ in range(2):  # the second time from disk
            assert kernels().summed(np.array([2.0])) == 0.5
    assert names == ["summed"]


def test_a_kernel_rounds_as_its_option_allows():
    def four(a, b, c, d):
        return a + (b + (c + d))

    terms = (1e16, -1e16, 1.0, 1.0)
    assert kernel(four)(*terms) == four(*terms)
    assert np.isfinite(kernel_with(fastmath={"reassoc"})(four)(*terms))
