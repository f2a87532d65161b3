"""The site of the documents builds without a warning: no broken link, no page left out."""

import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import fgnav

ROOT = Path(__file__).parents[2]


def build(pages, site):
    """Return what mkdocs does with a folder of pages."""
    pytest.importorskip("mkdocs")
    text = (ROOT / ".github" / "mkdocs.yml").read_text(encoding="utf-8")
    settings = site.with_suffix(".yml")
    text = text.replace("../docs", str(pages))
    settings.write_text(text.replace("api_page.py", str(ROOT / ".github" / "api_page.py")))
    words = ["build", "--strict", "--config-file", str(settings), "--site-dir", str(site)]
    return subprocess.run(
        [sys.executable, "-m", "mkdocs", *words], check=False, capture_output=True, text=True
    )


def test_the_site_builds_without_a_warning(tmp_path):
    done = build(ROOT / "docs", tmp_path / "site")
    assert done.returncode == 0, done.stderr
    pages = {page.stem for page in (ROOT / "docs").glob("*.md")} - {"index"}
    assert pages <= {folder.name for folder in (tmp_path / "site").iterdir()}

    face = (tmp_path / "site" / "api" / "index.html").read_text(encoding="utf-8")
    assert "One line that names file, line or key, rule and value." in face  # of load_flight


def test_the_page_of_the_face_has_every_public_name():
    listed = set(re.findall(r"^::: fgnav\.(\w+)$", (ROOT / "docs" / "api.md").read_text(), re.M))
    public = {name for name in dir(fgnav) if not isinstance(getattr(fgnav, name), ModuleType | str)}
    assert listed == public


def test_a_broken_link_would_be_seen(tmp_path):
    (tmp_path / "pages").mkdir()
    for page in (ROOT / "docs").glob("*.md"):
        (tmp_path / "pages" / page.name).write_text(page.read_text(encoding="utf-8"))
    with (tmp_path / "pages" / "index.md").open("a") as file:
        file.write("[nowhere](nowhere.md)\n")
    done = build(tmp_path / "pages", tmp_path / "site")
    assert done.returncode != 0
    assert "nowhere.md" in done.stderr
