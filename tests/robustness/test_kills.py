"""Commands killed at random times; more kills are ``make bench ONLY=damage``."""

import numpy as np
import pytest

from tests.robustness.kills import commands, killed
from tests.robustness.small_flights import SCENARIOS


@pytest.fixture(scope="module")
def few_commands(whole_flights, tmp_path_factory):
    return commands(whole_flights[0].folder, *small_inputs(tmp_path_factory.mktemp("kills")))


def small_inputs(folder):
    """Return a scenario of a second and a world of three shards."""
    scenario, world = folder / "short.toml", folder / "small.toml"
    text = (SCENARIOS / "demo.toml").read_text(encoding="utf-8")
    scenario.write_text(text.replace("duration_s = 60.0", "duration_s = 1.0"), encoding="utf-8")
    world.write_text("epochs = 60\nshard_epochs = 20\n", encoding="utf-8")
    return scenario, world


@pytest.mark.parametrize("which", range(4), ids=["run", "compare", "simulate", "data-set"])
def test_a_killed_command_leaves_nothing_torn_and_ends_the_same(which, few_commands, tmp_path):
    command = few_commands[which]
    faults, hits = killed(command, 6, tmp_path / "kills", np.random.default_rng([5, which]))
    assert faults == []
    assert hits > 0  # it was still running
