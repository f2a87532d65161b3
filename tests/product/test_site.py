"""The site of the documents builds without a warning: no broken link, no page left out."""

import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import fgnav

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


def build(pages, site):
    """Return what mkdocs does with a folder of pages."""
    pytest.importorskip("material")
    pytest.importorskip("latex2mathml")
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    text = text.replace("docs_dir: docs", f"docs_dir: {pages}").replace(
        "docs/site_hooks", f"{DOCS}/site_hooks"
    )
    settings = site.with_suffix(".yml")
    settings.write_text(text)
    words = ["build", "--strict", "--config-file", str(settings), "--site-dir", str(site)]
    return subprocess.run(
        [sys.executable, "-m", "mkdocs", *words], check=False, capture_output=True, text=True
    )


def test_the_site_builds_without_a_warning_or_a_raw_equation(tmp_path):
    done = build(DOCS, tmp_path / "site")
    assert done.returncode == 0, done.stderr
    pages = [page.relative_to(DOCS).with_suffix("") for page in DOCS.rglob("*.md")]
    shown = {
        page: tmp_path / "site" / page / "index.html" for page in pages if page.name != "index"
    }
    texts = {page: file.read_text(encoding="utf-8") for page, file in shown.items()}
    assert not [page for page, text in texts.items() if re.search(r"arithmatex|\\tag", text)]
    assert "One line that names file, line or key, rule and value." in texts[Path("reference/api")]
    assert "--strict" in texts[Path("reference/cli")]  # of fgnav run
    assert "E401" in texts[Path("reference/messages")]
    fetched = re.findall(r"<(?:script|img|link)[^>]+https?://[^>]*>", texts[Path("theory/solvers")])
    assert not fetched


def test_the_page_of_the_face_has_every_public_name():
    page = (DOCS / "reference" / "api.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^::: fgnav\.(\w+)$", page, re.MULTILINE))
    public = {name for name in dir(fgnav) if not isinstance(getattr(fgnav, name), ModuleType | str)}
    assert listed == public


def test_a_broken_link_would_be_seen(tmp_path):
    (tmp_path / "pages").mkdir()
    (tmp_path / "pages" / "index.md").write_text("[nowhere](nowhere.md)\n")
    done = build(tmp_path / "pages", tmp_path / "site")
    assert done.returncode != 0
    assert "nowhere.md" in done.stderr
