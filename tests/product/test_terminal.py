"""What a user sees: listings, progress, notebooks, and parts named by module."""

import json
import os
import pty
import subprocess
import sys
from importlib.metadata import EntryPoint

import numpy as np
import pytest

import fgnav
from fgnav import plugins, terminal
from fgnav.checks import BadInputError
from fgnav.cli import main
from fgnav.geometry.earth import Origin
from fgnav.integers.resolvers.registry import RESOLVERS, resolver_named
from fgnav.methods import METHODS
from fgnav.progress import report
from fgnav.types.estimate import Estimate


@pytest.mark.parametrize(
    ("command", "names"),
    [("methods", set(METHODS)), ("resolvers", set(RESOLVERS)), ("factors", {"position"})],
)
def test_parts_are_listed_with_what_they_say_of_themselves(command, names, capsys):
    assert main([command, "--json", "-"]) == 0
    texts = json.loads(capsys.readouterr().out)
    assert names <= set(texts)
    assert all(len(text) > 10 for text in texts.values())
    assert main([command]) == 0
    assert len(capsys.readouterr().out.splitlines()) >= len(texts)


def test_installed_parts_are_listed_with_who_brought_them_or_why_not(monkeypatch):
    broken = EntryPoint(name="broken", value="no_such_module:x", group="fgnav.methods")
    fine = EntryPoint(name="fine", value="pathlib:Path", group="fgnav.methods")
    monkeypatch.setattr(plugins, "entry_points", lambda **_: [broken, fine])
    texts = plugins.descriptions("fgnav.methods", {})
    assert texts["broken"].startswith("cannot be imported: No module named 'no_such_module'")
    assert texts["fine"].endswith("(an installed package)")


def test_a_part_of_a_module_in_the_working_folder_is_named_by_it(tmp_path, monkeypatch):
    (tmp_path / "my_resolvers.py").write_text(
        "from fgnav.integers.resolvers.rounding import Rounding\n\n\nmine = Rounding\n"
    )
    monkeypatch.chdir(tmp_path)
    assert resolver_named("my_resolvers:mine").name == "rounding"
    assert str(tmp_path) not in sys.path
    for name, text in {
        "my_resolvers:yours": "has no attribute 'yours'",
        "no_such_module:x": "No module named 'no_such_module'",
        "nothing": "module:attribute names any other",
    }.items():
        with pytest.raises(BadInputError, match=text):
            resolver_named(name)


@pytest.mark.parametrize("columns", ["80", "60"])
def test_listings_and_help_fit_the_terminal_and_nothing_is_cut(columns, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", columns)
    for words in (["--help"], ["methods"], ["resolvers"], ["factors"], ["scenarios"]):
        assert main(words) == 0
        out = capsys.readouterr().out
        assert max(map(len, out.splitlines())) <= int(columns)
        assert "…" not in out
        assert "..." not in out


def test_notes_are_folded_where_the_width_is_known_and_whole_on_a_pipe(monkeypatch, capsys):
    note = f"smoother: {'a note of many words, ' * 12}and its end"
    monkeypatch.setenv("COLUMNS", "60")
    terminal.show_lines([note, "  table   1.0"])
    *folded, last = capsys.readouterr().out.splitlines()
    assert max(map(len, folded)) <= 60
    assert all(line.startswith("  ") for line in folded[1:])
    assert " ".join(" ".join(folded).split()) == note
    assert last == "  table   1.0"
    monkeypatch.delenv("COLUMNS")
    terminal.show_lines([note])
    assert capsys.readouterr().out == f"{note}\n"


def test_steps_report_the_share_of_all_steps():
    seen = []
    steps = terminal.Steps(4, lambda what, share: seen.append((what, share)))
    with steps("reading"):
        report(0.5)
    with steps("solving"):
        pass
    report(0.9)  # nobody's
    assert seen == [
        ("reading", 0.0),
        ("reading", 0.125),
        ("reading", 0.25),
        ("solving", 0.25),
        ("solving", 0.5),
    ]


def test_progress_within_a_step_is_a_share_of_that_step():
    seen = []
    outer = terminal.Steps(2, lambda _, share: seen.append(share))
    with outer("all"), terminal.progress(2) as inner, inner("first half"):
        report(0.5)
    assert seen == [0.0, 0.0, 0.125, 0.25, 0.5]


def test_a_terminal_sees_share_and_time_left():
    code = (
        "from fgnav.terminal import progress\n"
        "import time\n"
        "with progress(2) as step:\n"
        "    with step('reading'): time.sleep(0.2)\n"
        "    with step('solving'): time.sleep(0.2)\n"
    )
    leader, follower = pty.openpty()
    environment = os.environ | {"TERM": "xterm", "COLUMNS": "80"}
    subprocess.run([sys.executable, "-c", code], stderr=follower, check=True, env=environment)
    os.close(follower)
    text = os.read(leader, 100_000).decode()
    os.close(leader)
    assert "solving" in text
    assert "50%" in text
    assert "left" in text


def test_an_unknown_command_names_the_nearest_and_loads_no_other(capsys):
    assert main(["compre"]) == 2
    assert capsys.readouterr().err == "fgnav: compre: no such command; did you mean compare?\n"


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_installed_and_knows_the_commands(shell, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["--install-completion", "--shell", shell]) == 0
    capsys.readouterr()
    written = "".join(one.read_text() for one in tmp_path.rglob("*") if one.is_file())
    for name in ("compare", "simulate", "export"):
        assert name in written


def test_flight_estimate_and_comparison_show_themselves_in_five_lines():
    place = Origin(latitude_rad=0.7, longitude_rad=0.1, height_m=5.0)
    flight = fgnav.Flight(name="<walk>", start_gps_s=0.0, origin=place)
    estimate = Estimate(
        method="m", t_s=np.arange(3.0), n_epochs=4, R_nb=np.tile(np.eye(3), (3, 1, 1))
    )
    nothing = fgnav.Comparison(flight="walk", epochs=4, methods=(), bound=None)
    for part in (flight, estimate, nothing):
        assert len(repr(part).splitlines()) == 5
        assert max(map(len, repr(part).splitlines())) <= 90
        assert "<table>" in part._repr_html_()
    assert "3 of 4 epochs, 0.000 to 2.000 s" in repr(estimate)
    assert "&lt;walk&gt;" in flight._repr_html_()


def test_dir_shows_the_face_alone():
    assert dir(fgnav) == sorted(fgnav.__all__)
