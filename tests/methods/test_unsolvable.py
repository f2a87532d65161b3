"""Flights without an answer on the command line: one line on what is missing, and no output."""

from dataclasses import replace

import pytest

from fgnav.cli import main
from fgnav.io.flight.folder import save_flight
from tests.assembly.test_unsolvable import CASES, blind
from tests.methods.simulated import flown

FLIGHTS = {
    name: (lambda change=change: change(flown("demo", 5.0)))
    for name, (change, _) in CASES.items()
    if name != "no epoch"  # no such file can be read: bad input
}
FLIGHTS["a detector that never sees"] = blind
# What the line on the command line begins with: a state, or what was not measured.
WORDS = ("attitude: ", "position: ", "rate: ", "motion: ", "antenna a1: no code observation")


@pytest.mark.parametrize("method", ["smoother", "forward"])
@pytest.mark.parametrize("name", FLIGHTS)
def test_the_command_line_leaves_nothing_that_looks_like_a_success(name, method, tmp_path, capsys):
    place, out = tmp_path / "flight", tmp_path / "out"
    save_flight(FLIGHTS[name](), place)
    assert main(["run", str(place), "--method", method, "--out", str(out)]) == 1
    printed = capsys.readouterr().err.splitlines(keepends=True)
    line = "".join(one for one in printed if not one.startswith("check: "))  # findings come first
    assert line.startswith(tuple(f"fgnav: {method}: {word}" for word in WORDS))
    assert line.count("\n") == 1
    assert not out.exists() or not list(out.iterdir())


def test_a_flight_without_a_solution_is_named_by_what_check_finds(tmp_path, capsys):
    """An array a tenth too long."""
    flight = flown("demo", 5.0)
    longer = (replace(one, position_b_m=1.1 * one.position_b_m) for one in flight.antennas)
    save_flight(replace(flight, antennas=tuple(longer)), tmp_path / "flight")
    assert main(["run", str(tmp_path / "flight"), "--out", str(tmp_path / "out")]) == 1
    printed = capsys.readouterr().err
    assert "fgnav: smoother: " in printed
    assert printed.count("check: antennas misplaced: ") == 1
