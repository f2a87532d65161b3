"""What cannot be simulated is one line with file, key, rule, mend; exit 2; nothing is written."""

from pathlib import Path

import pytest

from fgnav import cli

VEHICLES = Path(__file__).resolve().parents[2] / "sim" / "fgnav_sim" / "vehicles"
ROCKET = (VEHICLES / "rocket.toml").read_text(encoding="utf-8")
FLOWN = """
duration_s = 10.0
[flown]
vehicle = "vehicle.toml"
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


PLAIN = (VEHICLES / "rigid_body.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("scenario", "vehicle", "batch", "said"),
    [
        (
            FLOWN + "attitude = {}\nstep_s = 0.5",
            ROCKET,
            (),
            "flown.step_s: must be at most twice the canards' lag_s 0.01",
        ),
        (FLOWN.replace("vehicle.toml", "none.toml"), ROCKET, (), "flown.vehicle: no such file"),
        (
            FLOWN + "attitude = {}",
            PLAIN,
            (),
            "key flown.attitude: needs a vehicle with a table [autopilot]",
        ),
        *(
            (
                FLOWN + "step_s = 0.5",
                ROCKET,
                batch,
                "flown.step_s: the integration diverges with 0.5 before t_s",
            )
            for batch in ((), ("--batch", "3"))
        ),
    ],
)
def test_a_flight_that_cannot_be_flown(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    scenario: str,
    vehicle: str,
    batch: tuple[str, ...],
    said: str,
) -> None:
    (tmp_path / "bad.toml").write_text(scenario, encoding="utf-8")
    (tmp_path / "vehicle.toml").write_text(vehicle, encoding="utf-8")
    assert f"bad.toml: {said}" in refused(tmp_path, capsys, *batch)


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
