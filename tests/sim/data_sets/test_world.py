"""World files: those that are shipped, and what is wrong with others, in one line."""

from pathlib import Path

import pytest

from fgnav.checks import BadInputError
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.data_sets.world import World, load_world

WORLDS = Path(__file__).resolve().parents[3] / "sim" / "fgnav_sim" / "worlds"


@pytest.mark.parametrize("path", sorted(WORLDS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_world_that_is_shipped_loads(path):
    world = load_world(path)
    assert world.name == path.stem
    assert isinstance(world, GravityWorld if path.stem == "gravity" else World)


def test_the_papers_world_is_a_hundred_days_over_madrid():
    world = load_world(WORLDS / "paper.toml")
    assert world.epochs == 100 * 24 * 3600 / 15
    assert (world.runs.epochs, world.runs.step_s) == (5760, 15.0)
    assert world.sites.places[0].latitude_deg == 40.33
    assert (world.satellites.choose, len(world.array.antennas_b_m)) == (6, 8)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("kind = 'sky'", r"key kind: must be array or gravity, got 'sky'"),
        ("epochs = 0", r"key epochs: must be int >= 1, got 0"),
        ("nosie = {}", r"key nosie: unknown; the nearest known key is noise"),
        ("shard_epochs = 10\nruns = { epochs = 3 }", r"shard_epochs: must hold whole runs of 3"),
        ("runs = { epochs = 5761 }\nshard_epochs = 5761", r"times.duration_s: must be longer than"),
        ("sites = { kind = 'moon' }", r"sites.kind: must be one of fixed, anywhere, got 'moon'"),
        ("sites = { kind = 'fixed', places = [{ latitude_deg = 91.0 }] }", r"latitude_deg"),
        ("satellites = { choose = [6, 4] }", r"satellites.choose: must be above zero, and a range"),
        ("satellites = { choose = 0 }", r"satellites.choose: must be above zero"),
        ("satellites = { signals = {} }", r"satellites.signals: must name one constellation"),
        (
            "satellites = { signals = { X = ['1C'] } }",
            r"signals.X: the constellation must be one of",
        ),
        ("satellites = { signals = { G = ['9C'] } }", r"signals.G: '9C' is not a RINEX 3 signal"),
        (
            "satellites = { navigation = ['no.rnx'] }",
            r"key satellites.navigation: no such file, got '.*no.rnx'|"
            r"satellites.navigation: no such file, got '.*no.rnx'",
        ),
        (
            "satellites = { navigation = ['a'], orbits = ['b'] }",
            r"satellites.orbits: must not stand beside navigation",
        ),
        ("noise = { code_m = -1.0 }", r"noise.code_m: must be above zero, and a range"),
        (
            "noise = { phase_m = [0.1, 0.2, 0.3] }",
            r"noise.phase_m: must be above zero, and a range",
        ),
        ("array = { kind = 'given', antennas_b_m = [[0, 0, 0]] }", r"two antennas or more"),
        (
            "array = { kind = 'random', antennas = [8, 3] }",
            r"array.antennas: must be above zero, and a range",
        ),
        (
            "array = { kind = 'random', scale = [2.0, 1.0] }",
            r"array.scale: must be above zero, and a range",
        ),
        (
            "array = { kind = 'random' }\n"
            "[[reflectors]]\npoint_b_m = [0, 0, 1]\nnormal_b = [0, 0, 1]",
            r"reflectors: need one array for all runs",
        ),
        ("kind = 'gravity'\nshard_epochs = 30", r"shard_epochs: must hold whole flights of 20"),
        (
            "kind = 'gravity'\nmotion = { climb_deg = [9, 5] }",
            r"motion.climb_deg: must be zero or more, and a range",
        ),
        ("kind = 'gravity'\nmotion = { speed_mps = [0, 5] }", r"motion.speed_mps: must be above"),
        (
            "kind = 'gravity'\nphases = { climb = 0, cruise = 0, descent = 0, turn = 0, spin = 0, "
            "rocket = 0, guided = 0, glider = 0, vacuum = 0 }",
            r"phases.cruise: must be above zero where all others are zero",
        ),
    ],
)
def test_bad_world_is_refused_in_one_line(tmp_path, text, message):
    path = tmp_path / "world.toml"
    path.write_text(text)
    with pytest.raises(BadInputError, match=message) as caught:
        load_world(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
