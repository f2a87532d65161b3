"""Fixtures shared by all tests."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def shared() -> Path:
    """Return the folder of reference data, which is not part of the repository."""
    folder = Path(os.environ.get("FGNAV_SHARED") or ROOT.parent / "shared")
    if not folder.is_absolute():
        folder = ROOT / folder
    if not (folder / "data").is_dir():
        if os.environ.get("FGNAV_SHARED"):
            pytest.fail(f"FGNAV_SHARED={folder} has no folder 'data'")
        pytest.skip("FGNAV_SHARED: the folder of reference data is absent")
    return folder / "data"


@pytest.fixture(autouse=True)
def _no_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let what is printed go to a pipe, whose width nobody states: pytest's workers state one."""
    monkeypatch.delenv("COLUMNS", raising=False)
