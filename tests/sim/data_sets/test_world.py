"""World files: those that are shipped, and what is wrong with others, in one line."""

from pathlib import Path

import pytest

from fgnav.checks import BadInputError
from fgnav_sim.data_sets.gravity_world import GravityWorld, PhasesTable
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
    assert world.sites.place.latitude_deg == 40.33
    assert (world.satellites.choose, len(world.antennas_b_m)) == (6, 8)


def test_a_world_of_no_phase_is_refused(tmp_path):
    path = tmp_path / "world.toml"
    none = "\n".join(f"{name} = 0" for name in PhasesTable.__struct_fields__)
    path.write_text(f"kind = 'gravity'\n[phases]\n{none}\n")
    with pytest.raises(BadInputError, match=r"phases.cruise: must be above zero where all others"):
        load_world(path)
