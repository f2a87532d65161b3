"""The training loop: it learns, and a run that was cut or killed ends in the very same weights."""

import math
import shutil
import subprocess
import sys
from time import monotonic, perf_counter, sleep

import msgspec
import pytest
import torch
from safetensors.torch import save_file

from fgnav.checks import BadInputError, NoSolutionError
from fgnav.cli import main
from fgnav.io.atomic_write import made_folder
from fgnav.neural.manifest import read_manifest
from fgnav_models.training.plan import cost_lines, planned
from fgnav_models.training.train import Settings, train
from tests.models.training_run import SETTINGS, batch, error, learn, network, squares


def same(one, other):
    return all(torch.equal(a, b) for a, b in zip(one.parameters(), other.parameters(), strict=True))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a network that was trained in one go, what came of it, and its checkpoint."""
    net, checkpoint = network(), tmp_path_factory.mktemp("whole") / "whole.safetensors"
    return net, learn(net, checkpoint), checkpoint


def test_training_lowers_the_error_and_says_so(whole):
    net, trained, _ = whole
    assert trained.finished
    assert trained.step == SETTINGS.steps
    assert [row["step"] for row in trained.history] == [7, 14, 21, 28, 35, 42, 49, 56, 60]
    assert error(net)["error"] < 0.5 * error(network())["error"]
    assert all(math.isfinite(row["loss"]) for row in trained.history)


def test_the_best_weights_are_kept_and_on_request_the_last(tmp_path, whole):
    net, trained, _ = whole
    best = min(row["error"] for row in trained.history)
    assert error(net)["error"] == pytest.approx(best, rel=1e-6, abs=0)
    assert trained.best == best
    last = network()
    settings = msgspec.structs.replace(SETTINGS, keep="last")
    history = learn(last, tmp_path / "last.safetensors", settings).history
    assert error(last)["error"] == pytest.approx(history[-1]["error"], rel=1e-6, abs=0)


def test_a_run_killed_in_the_middle_goes_on_to_the_same_weights(tmp_path, whole):
    checkpoint = tmp_path / "killed.safetensors"
    command = [sys.executable, "-m", "tests.models.training_run", str(checkpoint), "0.05"]
    process = subprocess.Popen(command)
    limit = monotonic() + 60
    while not checkpoint.exists() and process.poll() is None and monotonic() < limit:
        sleep(0.01)
    sleep(0.1)
    process.kill()
    assert process.wait() == -9
    net = network()
    before = learn(network(), checkpoint, deadline_s=perf_counter()).step
    assert 0 < before < SETTINGS.steps
    trained = learn(net, checkpoint)
    assert same(net, whole[0])
    assert trained.history == whole[1].history


def test_a_finished_run_is_not_run_again(whole):
    def never(_step):
        raise RuntimeError("a step was made")

    again = network()
    trained = train(again, never, squares, SETTINGS, whole[2], validate=error)
    assert trained.finished
    assert same(again, whole[0])


def test_one_step_of_adam_is_what_the_paper_of_adam_says(tmp_path):
    # After one step the moments cancel: each weight moves by the learning rate against its slope.
    settings = Settings(steps=1, learning_rate=0.01, schedule="constant")
    net = torch.nn.Linear(2, 1, bias=False)
    with torch.no_grad():
        net.weight.copy_(torch.tensor([[1.0, -2.0]]))
    train(
        net,
        lambda _step: (torch.tensor([[3.0, 5.0]]),),
        lambda module, batch: module(batch[0]).sum(),
        settings,
        tmp_path / "one.safetensors",
    )
    torch.testing.assert_close(
        net.weight.detach(), torch.tensor([[0.99, -2.01]]), rtol=0, atol=1e-6
    )


def test_progress_tells_the_time_that_is_left(tmp_path):
    told = []
    learn(network(), tmp_path / "told.safetensors", watch=told.append)
    assert told[-1].step == told[-1].steps == SETTINGS.steps
    assert told[-1].eta_s == 0.0
    assert all(progress.eta_s >= 0 for progress in told)
    assert told[-1].figures["error"] > 0


def test_a_checkpoint_of_other_settings_network_or_format_is_refused(tmp_path, whole):
    checkpoint = shutil.copy(whole[2], tmp_path / "copy.safetensors")
    other = msgspec.structs.replace(SETTINGS, learning_rate=0.5)
    with pytest.raises(BadInputError, match="is a checkpoint of other settings"):
        learn(network(), checkpoint, other)
    with pytest.raises(BadInputError, match="is a checkpoint of another network"):
        learn(torch.nn.Linear(3, 1), checkpoint)
    content = checkpoint.read_bytes()
    checkpoint.write_bytes(content[: len(content) // 2])
    with pytest.raises(BadInputError, match="is no checkpoint of ours"):
        learn(network(), checkpoint)
    for strange in ({"strange:a": torch.zeros(1)}, None), ({"loss:sum": torch.zeros(1)}, "[]"):
        tensors, run = strange
        save_file(tensors, checkpoint, metadata=None if run is None else {"run": run})
        with pytest.raises(BadInputError, match="is no checkpoint of ours"):
            learn(network(), checkpoint)


def test_how_often_checkpoints_are_written_may_change_between_slices(tmp_path, whole):
    checkpoint = tmp_path / "pace.safetensors"
    learn(network(), checkpoint, deadline_s=perf_counter())
    net = network()
    learn(net, checkpoint, msgspec.structs.replace(SETTINGS, checkpoint_s=99.0))
    assert same(net, whole[0])


def test_a_loss_that_is_no_number_ends_the_run(tmp_path):
    def broken(module, batch):
        return squares(module, batch) * math.nan

    with pytest.raises(NoSolutionError, match="the loss is nan at step 7; lower learning_rate"):
        train(network(), batch, broken, SETTINGS, tmp_path / "nan.safetensors")


def test_a_plan_takes_two_steps_and_names_the_cost_of_all(tmp_path):
    net = network()
    with planned() as costs:
        trained = learn(net, made_folder(tmp_path / "net") / "checkpoint.safetensors")
    assert trained.finished
    assert trained.step == 2
    (cost,) = costs
    assert (cost.name, cost.parameters, cost.steps) == ("net", 81, SETTINGS.steps)
    assert 0 < cost.training_s == cost.steps * cost.step_s
    assert learn(network(), tmp_path / "whole.safetensors").step == SETTINGS.steps
    *_, total = cost_lines([cost, cost], "cuda", 3.0)
    assert f"in all {2 * cost.training_s / 3600:.3g} h of cuda for 2 networks, and 3 s" in total


def test_the_command_plans_a_recipe_and_its_networks_say_that_they_are_no_good(tmp_path, capsys):
    command = ["train", "ambiguity", "--scale", "smoke", "--plan", "--out", str(tmp_path / "plan")]
    assert main(command) == 0
    *networks, total = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in networks] == ["classification", "regression"]
    assert total.startswith("in all ")
    (manifest, _) = sorted((tmp_path / "plan").glob("*.json"))
    assert read_manifest(manifest).origin.command.endswith(" --plan")
