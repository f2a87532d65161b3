"""What cannot be simulated is one line with file, key, rule, mend; exit 2; nothing is written."""

from pathlib import Path

import pytest

from fgnav import cli

FLOWN = """
duration_s = 10.0
[flown]
vehicle = "rocket"
start = { v_b_mps = [100.0, 0.0, 0.0], euler_deg = [0.0, 80.0, 0.0] }
"""


def refused(folder: Path, capsys: pytest.CaptureFixture[str], *extra: str) -> str:
    """Return what the command says of a scenario that it refuses."""
    before = sorted(folder.iterdir())
    command = ["simulate", str(folder / "bad.toml"), "--seed", "1", "--out", str(folder / "out")]
    assert cli.main([*command, *extra]) == 2
    assert sorted(folder.iterdir()) == before
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    assert not said.out
    return said.err


@pytest.mark.parametrize("batch", [(), ("--batch", "3")])
def test_a_flight_that_cannot_be_flown(tmp_path, capsys, batch) -> None:
    (tmp_path / "bad.toml").write_text(f"{FLOWN}step_s = 0.5", encoding="utf-8")
    said = refused(tmp_path, capsys, *batch)
    assert "bad.toml: flown.step_s: the integration diverges with 0.5 before t_s" in said


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("navigation", "ESBC00DNK_R_20201770000_01D_MN.rnx"),
        ("orbits", "COD0MGXFIN_20201770000_01D_05M_ORB.SP3"),
    ],
)
def test_an_ephemeris_of_another_date(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], shared: Path, kind: str, name: str
) -> None:
    file = shared / "orbits" / name
    text = f'start = 2023-01-01T00:00:00\nduration_s = 2.0\n[gnss]\n{kind} = ["{file}"]\n'
    (tmp_path / "bad.toml").write_text(text, encoding="utf-8")
    said = refused(tmp_path, capsys)
    assert "bad.toml: gnss: navigation and orbits know no satellite of G at 2023-01-01T00" in said
    assert "name files of that date" in said
