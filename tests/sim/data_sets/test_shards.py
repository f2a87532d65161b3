"""Data sets on disk: nothing changes on the way, and interruptions leave no trace."""

import json
import shutil

import msgspec
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fgnav.checks import BadInputError
from fgnav.cli import main
from fgnav_sim.data_sets.epochs import array_epochs
from fgnav_sim.data_sets.gravity import gravity_epochs
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.data_sets.shards import MANIFEST, load_data_set, make_data_set
from fgnav_sim.data_sets.world import (
    DayTimes,
    OutliersTable,
    RandomArray,
    RunsTable,
    SatellitesTable,
    World,
)

WORLD = World(
    epochs=50, shard_epochs=20, runs=RunsTable(epochs=5), outliers=OutliersTable(share=0.1)
)
GRAVITY = GravityWorld(epochs=50, shard_epochs=40)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the folder of a finished data set."""
    folder = tmp_path_factory.mktemp("data") / "set"
    make_data_set(WORLD, 1, folder)
    return folder


def content(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.mark.parametrize(
    "world", [WORLD, msgspec.structs.replace(WORLD, array=RandomArray())], ids=["given", "random"]
)
def test_epochs_come_back_as_they_were_drawn(tmp_path, world):
    data_set = make_data_set(world, 3, tmp_path / "set")
    assert [len(epochs) for epochs in data_set] == [20, 20, 10]
    assert_array_equal(np.concatenate([e.run for e in data_set]), np.repeat(np.arange(10), 5))
    for k, epochs in enumerate(load_data_set(tmp_path / "set")):
        rng = np.random.default_rng(np.random.SeedSequence(3, spawn_key=(k,)))
        drawn = array_epochs(world, rng, len(epochs))
        for name in ("t_s", "R_nb", "antennas_b_m", "satellites", "e_n", "phase_m", "integers"):
            assert_array_equal(getattr(epochs, name), getattr(drawn, name), err_msg=name)
            assert getattr(epochs, name).dtype.kind == getattr(drawn, name).dtype.kind
        for name in ("signals", "group", "wavelength_m", "outlier"):
            assert_array_equal(getattr(epochs, name), getattr(drawn, name))
        for name in ("code_m", "code_sigma_m", "phase_sigma_m", "elevation_rad"):  # 32 bits
            assert_allclose(getattr(epochs, name), getattr(drawn, name), rtol=1e-6, err_msg=name)
            assert getattr(epochs, name).dtype == np.float64


def test_windows_come_back_as_they_were_drawn(tmp_path):
    first, second = make_data_set(GRAVITY, 3, tmp_path / "set")
    assert (len(first), len(second)) == (40, 10)
    assert_array_equal(second.flight, 2)
    rng = np.random.default_rng(np.random.SeedSequence(3, spawn_key=(0,)))
    drawn = gravity_epochs(GRAVITY, rng, 40)
    assert_array_equal(first.g_b, drawn.g_b)
    assert_allclose(first.f_b_mps2, drawn.f_b_mps2, rtol=0, atol=1e-5)


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(whole, tmp_path):
    for name, seed in (("again", 1), ("other", 2)):
        make_data_set(WORLD, seed, tmp_path / name)
    assert content(whole) == content(tmp_path / "again")
    assert content(whole) != content(tmp_path / "other")


def test_an_interrupted_set_is_finished_as_if_nothing_had_happened(whole, tmp_path):
    class StoppedError(Exception):
        pass

    def stop(share):
        if share > 0.5:
            raise StoppedError

    with pytest.raises(StoppedError):
        make_data_set(WORLD, 1, tmp_path / "stopped", stop)
    stopped = load_data_set(tmp_path / "stopped")
    assert (len(stopped), stopped.planned) == (2, 3)
    with pytest.raises(BadInputError, match="stopped: holds 2 of 3 shards; call fgnav data-set"):
        list(stopped)
    before = (tmp_path / "stopped" / "0001.npz").stat().st_mtime_ns
    make_data_set(WORLD, 1, tmp_path / "stopped")
    assert content(whole) == content(tmp_path / "stopped")
    assert (tmp_path / "stopped" / "0001.npz").stat().st_mtime_ns == before


def test_a_set_goes_on_from_what_a_killed_call_has_left(whole, tmp_path):
    folder = shutil.copytree(whole, tmp_path / "killed")
    manifest = json.loads((folder / MANIFEST).read_text())
    (folder / MANIFEST).write_text(json.dumps(manifest | {"shards": []}))
    (folder / "0003.npz").unlink()
    for name in ("0003.npz", MANIFEST):
        (folder / f".{name}.999999999.part").write_bytes(b"half")
    make_data_set(WORLD, 1, folder)
    assert content(folder) == content(whole)


def test_a_damaged_shard_is_refused_by_readers_and_made_again(whole, tmp_path):
    folder = shutil.copytree(whole, tmp_path / "set")
    (folder / "0002.npz").write_bytes((whole / "0002.npz").read_bytes()[:-1])
    with pytest.raises(BadInputError, match=r"0002.npz: is not the file that was written"):
        load_data_set(folder).read(1)
    (folder / "0001.npz").unlink()
    with pytest.raises(BadInputError, match=r"0001.npz: no such file, but the manifest names it"):
        load_data_set(folder).read(0)
    make_data_set(WORLD, 1, folder)
    assert content(folder) == content(whole)


def test_folders_with_something_else_are_left_alone(whole, tmp_path):
    before = content(whole)
    for world, seed in ((WORLD, 2), (GRAVITY, 1)):
        with pytest.raises(BadInputError, match="holds a data set of another world or seed"):
            make_data_set(world, seed, whole)
    assert content(whole) == before
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    with pytest.raises(BadInputError, match="full: must be new, empty or a data set"):
        make_data_set(WORLD, 1, tmp_path / "full")
    with pytest.raises(BadInputError, match=r"mine\.txt: must be a folder, it is a file"):
        make_data_set(WORLD, 1, tmp_path / "full" / "mine.txt")
    with pytest.raises(BadInputError, match=r"mine\.txt: is a file, not a folder"):
        make_data_set(WORLD, 1, tmp_path / "full" / "mine.txt" / "below")


def test_a_world_from_which_nothing_can_be_drawn_leaves_nothing(tmp_path):
    world = msgspec.structs.replace(
        WORLD, satellites=SatellitesTable(signals={"J": ("1C",)}), epochs=5
    )
    with pytest.raises(BadInputError, match="no built-in almanac of constellation 'J'"):
        make_data_set(world, 1, tmp_path / "set")
    assert not (tmp_path / "set").exists()


def test_a_set_from_files_names_them_without_their_folders(tmp_path, shared):
    file = shared / "orbits" / "ESBC00DNK_R_20201770000_01D_MN.rnx"
    table = SatellitesTable(navigation=(str(file),))
    world = msgspec.structs.replace(
        WORLD, satellites=table, epochs=5, times=DayTimes(duration_s=600.0)
    )
    make_data_set(world, 1, tmp_path / "set")
    before = content(tmp_path / "set")
    manifest = make_data_set(world, 1, tmp_path / "set").manifest
    assert manifest.world.satellites.navigation == (file.name,)
    assert content(tmp_path / "set") == before


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "data_set.json: no such file; a data set is a folder with a data_set.json"),
        ("{", "data_set.json: must be JSON"),
        ("[]", r"data_set.json: must be a JSON object, got \[\]"),
        ('{"format": "fgnav-data-set/2"}', "data_set.json: key format: must be"),
    ],
)
def test_a_bad_manifest_is_refused(tmp_path, text, message):
    if text is not None:
        (tmp_path / MANIFEST).write_text(text)
    with pytest.raises(BadInputError, match=message):
        load_data_set(tmp_path)


def test_the_command_writes_a_set_and_says_what_it_holds(tmp_path, capsys):
    world = tmp_path / "small.toml"
    world.write_text("epochs = 30\nshard_epochs = 20\n")
    arguments = ["data-set", str(world), "--seed", "5", "--out", str(tmp_path / "set")]
    assert main([*arguments, "--json", "-"]) == 0
    summary = json.loads(capsys.readouterr().out)
    size = sum(path.stat().st_size for path in (tmp_path / "set").glob("*.npz"))
    assert summary["epochs"] == 30
    assert (summary["shards"], summary["bytes"]) == (2, size)
    assert load_data_set(tmp_path / "set").manifest.world.name == "small"
    assert main(arguments) == 0
    again = capsys.readouterr()
    assert "shards  2" in again.out
    assert "set: holds 2 of 2 shards, goes on from there" in again.err


def test_a_bad_command_writes_nothing_and_exits_with_two(tmp_path, capsys):
    world = tmp_path / "world.toml"
    world.write_text("epochs = 'many'\n")
    out = tmp_path / "set"
    assert main(["data-set", str(world), "--seed", "1", "--out", str(out)]) == 2
    assert "world.toml: key epochs: must be int, got" in capsys.readouterr().err
    assert main(["data-set", str(world), "--seed", "-1", "--out", str(out)]) == 2
    assert "--seed: must be 0 or more, got -1" in capsys.readouterr().err
    assert not out.exists()
