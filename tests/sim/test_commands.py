"""The command ``fgnav simulate``: a folder out, or one line that says why not."""

import json
import subprocess
import sys

import pytest

from fgnav.checks import BadInputError
from fgnav.io.flight.folder import load_flight
from fgnav_sim.commands import simulate

SHORT = """
duration_s = 2.0
antennas_b_m = [[0, 0, 0], [1, 0, 0], [0, 0.5, 0]]
[motion]
path = { kind = "arc" }
yaw = { kind = "sine", amplitude_deg = 20.0 }
[gnss]
signals = { G = ["1C"], E = ["1C"], C = ["2I"] }
[imu]
[fixes]
[baseline]
[barometer]
[magnetometer]
[photodetector]
landmark = { latitude_deg = 40.34 }
field_of_view_deg = 13.0
"""


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text(SHORT, encoding="utf-8")
    return path


def contents(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_the_same_seed_writes_the_same_bytes_and_another_seed_others(scenario, tmp_path):
    for name, seed in (("one", 7), ("two", 7), ("other", 8)):
        simulate(scenario, seed=seed, out=tmp_path / name)
    one, two, other = (contents(tmp_path / name) for name in ("one", "two", "other"))
    assert {"flight.toml", "baseline.csv", "barometer.csv", "magnetometer.csv"} <= one.keys()
    assert one == two
    assert one.keys() == other.keys()
    alike = {name for name in one if one[name] == other[name]}
    assert alike <= {"flight.toml", "truth.csv", "broadcast.rnx", "quadrant.csv"}


def test_the_summary_says_what_was_made(scenario, tmp_path, capsys):
    simulate(scenario, seed=1, out=tmp_path / "flight", json="-")
    summary = json.loads(capsys.readouterr().out)
    assert summary["epochs"] == 20
    assert summary["antennas"] == 3
    assert summary["imu_samples"] == 200
    assert summary["mean_tracked"] > 15
    simulate(scenario, seed=1, out=tmp_path / "again")
    printed = capsys.readouterr()
    assert "mean tracked" in printed.out
    assert not printed.err  # no bar on a pipe


def test_a_batch_is_the_flights_of_seeds_that_follow_each_other(scenario, tmp_path, capsys):
    simulate(scenario, seed=7, out=tmp_path / "batch", batch=3, json="-")
    summary = json.loads(capsys.readouterr().out)
    assert summary["flights"] == 3
    assert summary["seeds"] == "7 to 9"
    assert summary["epochs"] == 20
    assert "flight" not in summary
    folders = sorted((tmp_path / "batch").iterdir())
    assert [folder.name for folder in folders] == ["0001", "0002", "0003"]
    for seed, folder in zip((7, 8, 9), folders, strict=True):
        simulate(scenario, seed=seed, out=tmp_path / f"alone{seed}")
        assert contents(folder) == contents(tmp_path / f"alone{seed}")
    assert contents(folders[0]) != contents(folders[1])
    simulate(scenario, seed=1, out=tmp_path / "one", batch=1)
    assert [folder.name for folder in (tmp_path / "one").iterdir()] == ["0001"]


def test_what_stands_where_a_flight_shall_be_is_refused_and_left_alone(scenario, tmp_path):
    folder = tmp_path / "flight"
    folder.mkdir()
    (folder / "mine.txt").write_text("precious", encoding="utf-8")
    for out in (folder, scenario):
        with pytest.raises(BadInputError, match="--out: must be a new or an empty folder"):
            simulate(scenario, seed=1, out=out)
    with pytest.raises(BadInputError, match=r"short\.toml: is a file, not a folder; name another"):
        simulate(scenario, seed=1, out=scenario / "flight")
    assert contents(folder) == {"mine.txt": b"precious"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"seed": -1}, "--seed: must be 0 or more, got -1"),
        ({"seed": 1, "batch": 0}, "--batch: must be 1 or more, got 0"),
    ],
)
def test_an_option_out_of_its_range_is_refused(scenario, tmp_path, options, message):
    with pytest.raises(BadInputError, match=message):
        simulate(scenario, out=tmp_path / "flight", **options)
    assert not (tmp_path / "flight").exists()


@pytest.mark.parametrize(("key", "version"), [("", "3.04"), ('rinex = "4.00"', "4.00")])
def test_files_are_of_the_rinex_version_that_the_scenario_asks_for(tmp_path, key, version):
    (tmp_path / "s.toml").write_text(f"duration_s = 1.0\n[gnss]\nrate_hz = 2.0\n{key}\n")
    simulate(tmp_path / "s.toml", seed=1, out=tmp_path / "flight")
    for name in ("a1.rnx", "a2.rnx", "broadcast.rnx"):
        assert (tmp_path / "flight" / name).read_text().startswith(f"     {version}")
    assert load_flight(tmp_path / "flight").observations.tracked.all()


def test_the_module_of_the_command_imports_nothing_heavy():
    code = "import sys, fgnav_sim.commands; print(*sys.modules)"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, check=True, text=True
    )
    assert not {"numpy", "scipy", "numba", "msgspec", "rich"} & set(result.stdout.split())


def test_what_was_drawn_is_kept_with_each_flight_of_a_batch(tmp_path, capsys):
    path = tmp_path / "drawn.toml"
    path.write_text(
        """
        duration_s = 2.0
        [flown]
        air = false
        [flown.vehicle.body]
        mass_kg = 10.0
        inertia_kgm2 = [0.4, 0.9, 1.1]
        [imu]
        [dispersions]
        flown.vehicle.body.mass_kg = { relative = 0.02 }
        flown.start.v_n_mps = 1.0
        """,
        encoding="utf-8",
    )
    simulate(path, seed=7, out=tmp_path / "batch", batch=3, json="-")
    summary = json.loads(capsys.readouterr().out)
    assert summary["flights"] == 3
    assert "dispersions" not in summary  # they are each flight's own
    drawn = [
        json.loads((tmp_path / "batch" / f"{k:04d}" / "dispersions.json").read_text())
        for k in (1, 2, 3)
    ]
    assert [one["seed"] for one in drawn] == [7, 8, 9]
    masses = [one["drawn"]["flown.vehicle.body.mass_kg"]["value"] for one in drawn]
    assert len(set(masses)) == 3
    assert drawn[0]["drawn"]["flown.vehicle.body.mass_kg"]["nominal"] == 10.0
    simulate(path, seed=8, out=tmp_path / "alone", json="-")
    alone = json.loads(capsys.readouterr().out)
    assert alone["dispersions"]["flown.vehicle.body.mass_kg"] == masses[1]
    assert contents(tmp_path / "alone") == contents(tmp_path / "batch" / "0002")
    simulate(path, seed=8, out=tmp_path / "said")
    assert f"flown.vehicle.body.mass_kg = {masses[1]:.6g}" in capsys.readouterr().out
