"""The four phases and the frame around them, small, through the command, cut and resumed."""

import re
import tomllib
from pathlib import Path

import msgspec
import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.cli import main
from fgnav.neural.integers import integer_answers
from fgnav_models.commands import train
from fgnav_models.runtime.load import load
from fgnav_models.training.ambiguity.data import draw
from fgnav_models.training.ambiguity.experiment import Experiment, columns_of
from fgnav_models.training.ambiguity.phases import Grid
from fgnav_models.training.recipes import laid_over, said
from fgnav_sim.data_sets.gravity_world import GravityWorld, WindowsTable
from fgnav_sim.data_sets.world import NoiseTable, World

ROOT = Path(__file__).resolve().parents[4]
RECIPES = ROOT / "models" / "fgnav_models" / "recipes"
FIGURES = [f"figure_{k:02d}.png" for k in range(3, 15)]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the folder of a campaign that was run in one go."""
    out = tmp_path_factory.mktemp("phases") / "out"
    train(RECIPES / "phases.toml", out=out, scale="smoke")
    return out


def test_the_four_phases_leave_a_report_and_all_figures(whole):
    report = (whole / "report.md").read_text(encoding="utf-8")
    for words in ("## Phase 1", "## Phase 2", "## Phase 3", "## Phase 4", "rounding", "majority"):
        assert words in report
    assert re.search(r"\d+ × epoch not used: there is no whole window before it", report)
    assert [p.name for p in sorted(whole.glob("figure_*.png"))] == FIGURES
    assert not list(whole.rglob("checkpoint.safetensors"))
    assert not list(whole.rglob("*.part"))


def test_a_campaign_cut_again_and_again_ends_like_one_in_one_go(whole, tmp_path, capsys):
    # Each slice is one step long at least; the first experiments suffice to see it.
    out = tmp_path / "out"
    train(RECIPES / "phases.toml", out=out, scale="smoke", slice_s=1e-6)
    assert "the same command with --resume goes on" in capsys.readouterr().out
    first = out / "1" / "classification-mlp-k1"
    assert (first / "checkpoint.safetensors").exists()
    for _ in range(60):
        train(RECIPES / "phases.toml", out=out, scale="smoke", slice_s=1e-6, resume=True)
        if (first / "result.json").exists():
            break
    pattern = r'"seconds": [^\n]*'
    ours, theirs = (
        re.sub(pattern, "", (folder / "1/classification-mlp-k1/result.json").read_text("utf-8"))
        for folder in (out, whole)
    )
    assert ours == theirs


def test_a_finished_campaign_only_writes_its_report_again(whole, capsys):
    before = (whole / "report.md").read_text(encoding="utf-8")
    (whole / "report.md").unlink()
    train(RECIPES / "phases.toml", out=whole, scale="smoke", resume=True)
    assert (whole / "report.md").read_text(encoding="utf-8") == before
    assert "mean accuracy of the final networks" in capsys.readouterr().out


def test_training_is_logged_with_the_time_left(whole):
    log = (whole / "train.log").read_text(encoding="utf-8")
    assert re.search(r"1/classification-mlp-k1: step \d+/\d+ loss \S+ ETA \d:\d\d:\d\d", log)


SHORT = """
kind = "ambiguity-frame"
[base]
world = { kind = "array", noise = { code_m = 0.001, phase_m = 1e-6 } }
data = { epochs = 2500, inputs = ["range", "constellation"] }
elsewhere_epochs = 300
[base.elsewhere]
"half a metre" = { noise = { code_m = 0.5 } }
[base.experiment]
scaling = "whitened"
batch = 256
passes = 3.0
architecture = { dense = [16], head = "residual" }
[[study]]
name = "released"
question = "does it round?"
[study.release]
name = "short"
purpose = "A test."
notes = { "What it is" = "Small." }
domain = { satellites = 6 }
[scale.cpu]
"""


PHASES = """
kind = "ambiguity"
name = "none"
world = { kind = "array" }
data = { epochs = 9 }
[grid]
[final]
[scale.cpu]
"""


@pytest.fixture(scope="module")
def frame(tmp_path_factory):
    """Return the folder of a frame with one study, whose network is released."""
    folder = tmp_path_factory.mktemp("frame")
    (folder / "short.toml").write_text(SHORT, encoding="utf-8")
    train(folder / "short.toml", out=folder / "out")
    return folder / "out"


def test_a_study_stands_beside_its_baselines_and_is_tried_elsewhere(frame):
    lines = (frame / "report.md").read_text(encoding="utf-8").splitlines()
    rows = [
        [cell.strip() for cell in line.split("|")[1:-1]] for line in lines if "released |" in line
    ]
    own, elsewhere = rows
    network, rounding, majority = (float(cell) for cell in own[2:5])
    assert rounding == pytest.approx(99.2, rel=0, abs=0.3)  # of 1 mm of noise
    assert majority < 60.0
    assert network > 95.0
    assert float(elsewhere[2]) < 20.0  # half a metre is three cycles
    assert any("does it round?" in line for line in lines)


def test_a_released_study_answers_in_cycles(frame):
    network = load(frame / "short.json")
    world = World(noise=NoiseTable(code_m=1e-4, phase_m=1e-6))
    samples = draw(world, ("range", "constellation"), 200, rng=np.random.default_rng(9))
    answer = integer_answers(network, [samples.features[:, None]])
    assert (answer.value == samples.cycles).mean() > 0.95
    assert ((answer.sure > 0) & (answer.sure <= 1)).all()
    metrics = network.manifest.origin.metrics
    assert metrics["half a metre: rounding, % right"] < 20.0
    assert (frame / "short.md").exists()


def test_what_a_recipe_says_is_told_without_what_goes_unsaid():
    world = GravityWorld(windows=WindowsTable(samples=7))
    assert said({"world": world, "steps": (1, 2)}) == {
        "world": {"kind": "gravity", "windows": {"samples": 7}},
        "steps": [1, 2],
    }
    assert msgspec.convert(said(world), GravityWorld) == world


@pytest.mark.parametrize(
    ("recipe", "options", "text"),
    [
        ('kind = "alchemy"', {}, "key kind must be one of ambiguity, .* got 'alchemy'"),
        ("", {}, "key kind must be one of ambiguity, .* got None"),
        ('kind = "ambiguity"', {}, "key scale: has no table for --scale cpu"),
        ('kind = "ambiguity"\n[scale.cpu]', {}, "'name' is missing; add it"),
        (
            PHASES.replace("[grid]", "[grid]\nbatches = { mlp = 9 }"),
            {},
            "grid.batches: .* lacks rnn",
        ),
        (PHASES.replace("[final]", "[final]\npasses = {}"), {}, "final.passes: .* lacks classif"),
        (SHORT.replace("passes", "pasess"), {}, "pasess: unknown; the nearest known key"),
        (SHORT.replace("2500", "3"), {}, "no epoch is left for training|no epoch is left for"),
        ('kind = "ambiguity"', {"slice_s": 0.0}, "--slice-s: must be positive, got 0"),
        ('kind = "ambiguity"', {"device": "cuda"}, "--device cuda: torch sees no NVIDIA GPU"),
    ],
)
def test_what_cannot_be_trained_is_told_in_one_line(tmp_path, recipe, options, text, monkeypatch):
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    path = tmp_path / "recipe.toml"
    path.write_text(recipe, encoding="utf-8")
    with pytest.raises(BadInputError, match=text) as caught:
        train(path, out=tmp_path / "out", **options)
    assert "\n" not in str(caught.value)


def test_a_folder_that_holds_something_is_left_alone_without_resume(tmp_path):
    (tmp_path / "mine.txt").touch()
    with pytest.raises(BadInputError, match="--resume goes on with it"):
        train(RECIPES / "phases.toml", out=tmp_path)


def test_without_torch_the_text_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    with pytest.raises(BadInputError, match=r"pip install 'fgnav\[train\]'"):
        train(RECIPES / "phases.toml", out=tmp_path / "out")


def test_a_benchmark_must_be_one_of_the_differences():
    experiment = Experiment(targets="benchmark", benchmark=35)
    with pytest.raises(BadInputError, match="benchmark: must be a double difference, 0 to 34"):
        columns_of(experiment, 35)


def test_changes_are_laid_over_table_by_table():
    base = {"a": {"b": 1, "c": 2}, "d": [1, 2]}
    assert laid_over(base, {"a": {"b": 3}, "d": [9]}) == {"a": {"b": 3, "c": 2}, "d": [9]}
    assert base["a"]["b"] == 1


def test_the_paper_scale_is_the_papers_grid():
    with (RECIPES / "phases.toml").open("rb") as file:
        content = tomllib.load(file)
    assert content["scale"]["paper"] == {}
    assert content["data"]["epochs"] == 100 * 5760
    grid = Grid()
    first = len(grid.tasks) * len(grid.types) * len(grid.windows)
    second = len(grid.sizes) * len(grid.units) * len(grid.activations)
    assert first * content["start"]["repeats"] == 36
    assert (second, len(grid.learning_rates), grid.tuning_passes) == (30, 5, 2000)


def test_the_command_line_ends_with_2_and_one_line_on_a_bad_recipe(tmp_path, capsys):
    assert main(["train", str(tmp_path / "none.toml"), "--out", str(tmp_path / "out")]) == 2
    captured = capsys.readouterr()
    assert re.fullmatch(r"fgnav: \S+none\.toml: .*\n", captured.err)
    assert not (tmp_path / "out").exists()
