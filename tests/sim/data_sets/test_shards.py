"""Data sets on disk: nothing changes on the way, and the same seed gives the same bytes."""

import json

import msgspec
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fgnav.checks import BadInputError
from fgnav.cli import main
from fgnav_sim.data_sets.epochs import array_epochs
from fgnav_sim.data_sets.gravity import gravity_epochs
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.data_sets.shards import MANIFEST, write_data_set
from fgnav_sim.data_sets.world import (
    OutliersTable,
    RunsTable,
    SatellitesTable,
    World,
)

WORLD = World(
    epochs=50, shard_epochs=20, runs=RunsTable(epochs=5), outliers=OutliersTable(share=0.1)
)
GRAVITY = GravityWorld(epochs=50, shard_epochs=40)


def content(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.mark.parametrize(
    ("world", "draw", "number"),
    [
        (WORLD, array_epochs, "run"),
        (GRAVITY, gravity_epochs, "flight"),
    ],
    ids=["array", "gravity"],
)
def test_a_shard_holds_what_is_drawn_for_it(tmp_path, world, draw, number):
    sizes = write_data_set(world, 3, tmp_path / "set")
    stated, runs = json.loads((tmp_path / "set" / MANIFEST).read_text())["columns"], []
    for k, (name, count) in enumerate(sizes.items()):
        shard = np.load(tmp_path / "set" / name, allow_pickle=False)
        drawn = draw(world, np.random.default_rng(np.random.SeedSequence(3, spawn_key=(k,))), count)
        runs += shard[number].tolist()
        for column in set(shard.files) - {number}:
            values, expected = shard[column], np.asarray(getattr(drawn, column))
            assert values.dtype == np.dtype(stated[column][0])
            if values.dtype.kind == "S":
                assert_array_equal(values.astype(str), expected)
            else:
                assert_allclose(values, expected, rtol=1e-6, atol=1e-5, err_msg=column)
    assert sum(sizes.values()) == 50
    assert_array_equal(runs, np.arange(50) // (5 if number == "run" else 20))


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(tmp_path):
    for name, seed in (("one", 1), ("again", 1), ("other", 2)):
        write_data_set(WORLD, seed, tmp_path / name)
    assert content(tmp_path / "one") == content(tmp_path / "again")
    assert content(tmp_path / "one") != content(tmp_path / "other")


def test_a_world_from_which_nothing_can_be_drawn_leaves_nothing(tmp_path):
    satellites = SatellitesTable(signals={"J": ("1C",)})
    world = msgspec.structs.replace(WORLD, satellites=satellites)
    with pytest.raises(BadInputError, match="no built-in almanac of constellation 'J'"):
        write_data_set(world, 1, tmp_path / "set")
    assert not list(tmp_path.iterdir())


def test_the_command_writes_a_set_and_says_what_it_holds(tmp_path, capsys):
    world, out = tmp_path / "small.toml", tmp_path / "set"
    world.write_text("epochs = 30\nshard_epochs = 20\n")
    arguments = ["data-set", str(world), "--seed", "5", "--out", str(out)]
    assert main([*arguments, "--json", "-"]) == 0
    summary = json.loads(capsys.readouterr().out)
    size = sum(path.stat().st_size for path in out.glob("*.npz"))
    assert (summary["epochs"], summary["shards"], summary["bytes"]) == (30, 2, size)
    before = content(out)
    assert main(arguments) == 2
    assert "--out: must be a new or an empty folder" in capsys.readouterr().err
    assert content(out) == before


@pytest.mark.parametrize(
    ("text", "seed", "message"),
    [
        ("epochs = 'many'", "1", "world.toml: key epochs: must be int, got"),
        ("", "-1", "--seed: must be 0 or more, got -1"),
    ],
)
def test_a_bad_command_writes_nothing_and_exits_with_two(tmp_path, capsys, text, seed, message):
    world, out = tmp_path / "world.toml", tmp_path / "set"
    world.write_text(text)
    assert main(["data-set", str(world), "--seed", seed, "--out", str(out)]) == 2
    assert message in capsys.readouterr().err
    assert not out.exists()
