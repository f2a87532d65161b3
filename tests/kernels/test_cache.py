"""Kernels compile where nothing can be written, and that is said once."""

import os
import subprocess
import sys
from pathlib import Path

import fgnav.kernels.cache
from fgnav.kernels.cache import ensure_kernel_cache


def test_a_place_that_can_be_written_needs_nothing(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    ensure_kernel_cache(tmp_path)
    assert "NUMBA_CACHE_DIR" not in os.environ


def test_a_named_folder_is_taken(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(fgnav.kernels.cache, "_is_writable", lambda _: False)
    ensure_kernel_cache(tmp_path / "sources")
    assert os.environ["NUMBA_CACHE_DIR"] == str(tmp_path)


def test_without_any_place_kernels_are_kept_for_the_process_alone(tmp_path):
    """Files stand where folders would have to be made."""
    (tmp_path / "__pycache__").write_text("")
    (tmp_path / "cache").write_text("")
    code = (
        "import os, sys; from pathlib import Path; from fgnav.kernels.cache import "
        "ensure_kernel_cache as ensure; os.environ.pop('NUMBA_CACHE_DIR', None);"
        "ensure(Path(sys.argv[1])); ensure(Path(sys.argv[1]));"
        "print(os.environ['NUMBA_CACHE_DIR'], Path(os.environ['NUMBA_CACHE_DIR']).is_dir())"
    )
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
    )
    folder, existed = done.stdout.split()
    assert existed == "True"
    assert not Path(folder).exists()
    assert done.stderr.count("compiled code cannot be kept in") == 1
