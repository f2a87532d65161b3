"""Tasks of a user, each in so many lines of what ``import fgnav`` offers; see the notebook."""

import re
from pathlib import Path

import pytest

import fgnav

NOTEBOOK = (Path(__file__).parents[2] / "notebooks" / "07_six_tasks.py").read_text()
LINES = {
    "A flight from arrays": 8,
    "Sigmas": 3,
    "A factor of one's own": 6,
    "A network of one's own": 12,
    "Two resolvers over several flights": 6,
    "Errors with three sigma": 3,
}


def code(title):
    """Return the lines of the last cell under a heading."""
    section = NOTEBOOK.partition(f"# ## {title}\n")[2].partition("# %% [markdown]")[0]
    cell = section.rpartition("# %%\n")[2]
    return [line for line in cell.splitlines() if line.strip() and not line.startswith("#")]


@pytest.mark.parametrize("title", LINES)
def test_a_task_takes_no_more_lines_than_it_is_worth(title):
    assert 0 < len(code(title)) <= LINES[title]


def test_tasks_use_names_of_the_face_alone():
    assert re.findall(r"^(?:from|import) fgnav\b.*", NOTEBOOK, re.MULTILINE) == ["import fgnav"]
    assert set(re.findall(r"\bfgnav\.(\w+)", NOTEBOOK)) <= set(fgnav.__all__)
