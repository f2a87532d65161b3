"""The documents' prose: short sentences, few figures, no seeds, no history, no words of our own."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(ROOT.glob("docs/**/*.md"))]
LONGEST, LONGEST_MEAN, MOST_WORDS, MOST_FIGURES = 30, 18, 1200, 3  # figures: in 100 words
WORDS = (
    "loud|louder|doubt|doubts|tells?|told|says?|said|inertial unit|turned|turns|beside|by chance"
    "|lasting|promised?|rivals?|bent|thinned|departed|entering|led|put right|undone|mended|off"
    "|stated|refused|sought|judged|hopeless|looks?|stretch|stretches|swings?|swung|seeker"
)
HISTORY = "now|before|formerly|no longer|used to|previously"
NOT_PROSE = (
    r"## References?\n.*",  # to the end
    r"^```.*?^```",
    r"^ {4,}\S.*?$",
    r"\$\$.*?\$\$",
    r"<!--.*?-->",
    r"^(?:\||#|!\[|:::).*?$",
)


def prose(page):
    """Return a page's paragraphs, code and mathematics in a line as one word."""
    text = page.read_text(encoding="utf-8")
    for pattern in NOT_PROSE:
        text = re.sub(pattern, "\n", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"\$[^$]+\$|`[^`]+`|\(?T\d+b?(\.\d+)?\)?", "X", text)
    return re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", text)


def sentences(text):
    """Yield the words of each sentence."""
    for paragraph in re.split(r"\n\s*\n|\n(?=[-*] |\d+\. )", text):
        for sentence in re.split(r"(?<=[.!?])\s+", re.sub(r"^\s*([-*]|\d+\.) ", "", paragraph)):
            if words := re.findall(r"[\w’'.-]*\w", sentence):
                yield words


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_page_can_be_read(page):
    text = prose(page)
    found = list(sentences(text))
    count = sum(map(len, found))
    assert not [" ".join(words) for words in found if len(words) > LONGEST]
    assert count <= LONGEST_MEAN * len(found)
    assert count <= MOST_WORDS
    assert len(re.findall(r"(?<![\w.,])\d[\d.,]*", text)) <= max(MOST_FIGURES * count / 100, 3)
    assert not re.findall(r"\b\d{6,9}\b|seeds? \d", text)
    history = "" if page.name == "CHANGELOG.md" else f"|{HISTORY}"
    assert not re.findall(rf"\b(?:{WORDS}{history})\b", text, re.IGNORECASE)
