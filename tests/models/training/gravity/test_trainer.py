"""The recipe of gravity, small, through the command, whole and in slices."""

from pathlib import Path

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.neural.network import load_network
from fgnav_models.commands import train
from fgnav_models.training.gravity.data import draw
from fgnav_sim.data_sets.gravity_world import GravityWorld

RECIPE = (
    Path(__file__).resolve().parents[4] / "models" / "fgnav_models" / "recipes" / "gravity.toml"
)
ALONE = RECIPE.with_name("gravity_accelerometer.toml")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the folder of a recipe that was run in one go."""
    out = tmp_path_factory.mktemp("gravity") / "out"
    train(RECIPE, out=out, scale="smoke")
    (out / "report.md").rename(out.parent / "report.md")
    train(ALONE, out=out, scale="smoke", resume=True)
    return out


def test_the_recipe_leaves_a_report_with_its_baselines(whole):
    report = (whole.parent / "report.md").read_text(encoding="utf-8")
    for words in ("1/regression-lstm-k3", "unseen flights", "physical pair", "NEES"):
        assert words in report


def test_released_networks_load_and_answer_unit_vectors_with_a_covariance(whole):
    epochs = draw(GravityWorld(), 40, seed=[9])
    for name, seen in (("gravity", 2), ("gravity-accelerometer", 1)):
        network = load_network(whole / f"{name}.json")
        answers = network([epochs.f_b_mps2, epochs.v_n_mps][:seen])
        np.testing.assert_allclose(np.linalg.norm(answers.value, axis=1), 1.0, atol=1e-12)
        assert (np.linalg.eigvalsh(answers.covariance)[:, 0] > 0).all()
        assert len(network.manifest.domain) == len(answers.figures) == (9 if seen == 2 else 5)


def test_a_training_cut_and_resumed_ends_in_the_same_bytes(whole, tmp_path, capsys):
    out = tmp_path / "out"
    train(RECIPE, out=out, scale="smoke", slice_s=1e-6)
    assert "the same command with --resume goes on" in capsys.readouterr().out
    while not (out / "gravity" / "checkpoint.safetensors").exists():
        train(RECIPE, out=out, scale="smoke", slice_s=0.05, resume=True)
    assert not (out / "report.md").exists()
    train(RECIPE, out=out, scale="smoke", resume=True)
    assert (out / "gravity.onnx").read_bytes() == (whole / "gravity.onnx").read_bytes()
    assert (out / "report.md").read_bytes() == (whole.parent / "report.md").read_bytes()


def test_a_recipe_with_an_unknown_key_is_refused_by_name(tmp_path):
    recipe = tmp_path / "gravity.toml"
    recipe.write_text(RECIPE.read_text(encoding="utf-8").replace("[paper]", "[papers]"))
    with pytest.raises(BadInputError, match="papers"):
        train(recipe, out=tmp_path / "out", scale="smoke")
