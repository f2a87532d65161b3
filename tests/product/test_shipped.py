"""What comes along with the packages, by name."""

import json

import pytest

from fgnav.checks import BadInputError
from fgnav.cli import main
from fgnav.io.strict_toml import read_toml
from fgnav.neural.manifest import read_manifest
from fgnav.shipped import file_or_shipped, shipped, summary
from fgnav_sim.data_sets.world import load_world
from fgnav_sim.scenario import load_scenario
from fgnav_sim.vehicle.tables import load_vehicle

KINDS = [
    ("fgnav_sim", "scenarios"),
    ("fgnav_sim", "vehicles"),
    ("fgnav_sim", "worlds"),
    ("fgnav_models", "recipes"),
    ("fgnav_models", "cards"),
]


@pytest.mark.parametrize(("package", "kind"), KINDS)
def test_every_file_says_what_it_is(package, kind):
    files = shipped(package, kind)
    assert files
    assert all(len(summary(file)) > 20 for file in files.values())


def test_every_scenario_vehicle_and_world_loads_by_name():
    for kind, load in (
        ("scenarios", load_scenario),
        ("vehicles", load_vehicle),
        ("worlds", load_world),
    ):
        for name in shipped("fgnav_sim", kind):
            assert load(name).name


def test_every_released_network_has_a_card_and_the_command_that_makes_it_again(capsys):
    networks = shipped("fgnav_models", "weights") | shipped("fgnav_models", "factors")
    assert set(networks) == set(shipped("fgnav_models", "cards"))
    for name, file in networks.items():
        origin = read_manifest(file.with_suffix(".json")).origin
        assert main(["cards", name, "--reproduce"]) == 0
        *notes, command = capsys.readouterr().out.splitlines()
        assert f"# commit: {origin.commit}" in notes
        trained, _, rest = command.removeprefix("fgnav train ").partition(" ")
        assert rest == f"--scale {origin.scale} --out {name}"
        recipe = read_toml(file_or_shipped(trained, "fgnav_models", "recipes"))
        assert origin.scale in recipe["scale"]
        assert origin.metrics
        assert origin.recipe


def test_a_file_of_one_s_own_goes_before_a_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "demo").mkdir()  # a flight's folder is no scenario
    assert file_or_shipped("demo", "fgnav_sim", "scenarios").name == "demo.toml"
    assert file_or_shipped("demo.toml", "fgnav_sim", "scenarios").is_file()
    (tmp_path / "six").write_text("duration_s = 7.0\n")
    assert load_scenario("six").duration_s == 7.0


def test_a_name_that_is_not_there_is_told_with_the_nearest():
    with pytest.raises(BadInputError, match=r"scenarios .*demo.*; did you mean demo\?"):
        load_scenario("demmo")


def test_a_path_that_is_not_there_is_told_as_a_file():
    with pytest.raises(BadInputError, match="nowhere"):
        load_scenario("nowhere/demo.toml")


@pytest.mark.parametrize(
    ("command", "name"),
    [("scenarios", "demo"), ("worlds", "honest"), ("recipes", "trust"), ("cards", "trust")],
)
def test_what_comes_along_is_listed_and_printed(command, name, capsys):
    assert main([command]) == 0
    assert f"\n{name} " in "\n" + capsys.readouterr().out
    assert main([command, "--json", "-"]) == 0
    assert name in json.loads(capsys.readouterr().out)
    assert main([command, name]) == 0
    assert len(capsys.readouterr().out.splitlines()) > 5
