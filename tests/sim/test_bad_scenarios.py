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


def written(folder: Path, scenario: str, vehicle: str = ROCKET) -> None:
    (folder / "bad.toml").write_text(scenario, encoding="utf-8")
    (folder / "vehicle.toml").write_text(vehicle, encoding="utf-8")


def test_a_step_too_long_for_the_canards(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written(tmp_path, FLOWN + "attitude = {}\nstep_s = 0.5")
    said = "bad.toml: flown.step_s: must be at most twice the canards' lag_s 0.01"
    assert said in refused(tmp_path, capsys)


def test_a_vehicle_that_is_not_there_or_cannot_hold_an_attitude(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written(tmp_path, FLOWN.replace("vehicle.toml", "none.toml"))
    assert "bad.toml: flown.vehicle: no such file" in refused(tmp_path, capsys)
    plain = (VEHICLES / "rigid_body.toml").read_text(encoding="utf-8")
    written(tmp_path, FLOWN + "attitude = {}", plain)
    said = "bad.toml: key flown.attitude: needs a vehicle with a table [autopilot]"
    assert said in refused(tmp_path, capsys)


@pytest.mark.parametrize("batch", [(), ("--batch", "3")])
def test_a_step_that_diverges_leaves_nothing_of_a_batch_either(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], batch: tuple[str, ...]
) -> None:
    written(tmp_path, FLOWN + "step_s = 0.5")
    said = refused(tmp_path, capsys, *batch)
    assert (
        "bad.toml: flown.step_s: the integration of flight 0 diverges with 0.5 before t_s" in said
    )
    assert "take a shorter step" in said


@pytest.mark.parametrize("kind", ["navigation", "orbits"])
def test_an_ephemeris_of_another_date(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], shared: Path, kind: str
) -> None:
    names = {"navigation": "ESBC00DNK_R_20201770000_01D_MN.rnx",
             "orbits": "COD0MGXFIN_20201770000_01D_05M_ORB.SP3"}  # fmt: skip
    file = shared / "orbits" / names[kind]
    text = f'start = 2023-01-01T00:00:00\nduration_s = 2.0\n[gnss]\n{kind} = ["{file}"]\n'
    written(tmp_path, text)
    said = refused(tmp_path, capsys)
    assert "bad.toml: gnss: navigation and orbits know no satellite of G at 2023-01-01T00" in said
    assert "name files of that date" in said
