"""From torch to ONNX: the same numbers, or no release."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
import torch

from fgnav.checks import BadInputError, NoSolutionError
from fgnav.neural.integers import integer_answers
from fgnav.neural.manifest import Covariance
from fgnav.neural.measures import Sensor
from fgnav_models.runtime.load import load
from fgnav_models.training import release as made
from fgnav_models.training.ambiguity.nets import AmbiguityNet, Architecture, whitened
from fgnav_models.training.ambiguity.released import Answer
from fgnav_models.training.contract import (
    Release,
    epoch_input,
    integers_output,
    manifest_of,
    words_and_figures,
)
from fgnav_models.training.order import Order
from fgnav_models.training.release import AGREEMENT, made_with, release

ORDER = Order(
    recipe=Path("mine.toml"),
    content={},
    out=Path(),
    scale="smoke",
    device="cpu",
    deadline_s=0.0,
    watch=print,
)


def manifest(name="toy", *, channels=4, window=1, form=None):
    """Return the manifest of a toy, but for its hash."""
    words = Release(name=name, purpose="A test.", notes={}, domain={})
    one = epoch_input("x", "lengths", Sensor("m", "none", channels), window)
    _, figures = words_and_figures({"satellites": [4, 8]})
    origin = made_with(5, {"steps": 3}, {}, ORDER)
    output = integers_output("y", form or Covariance(form="none"))
    return manifest_of(words, (one,), output, figures, origin)


def words(**notes):
    return Release(name="toy", purpose="A test.", notes=notes, domain={"array": "any"})


IDENTITY = ["-c", "user.name=tester", "-c", "user.email=tester@localhost"]
METRICS = {"accuracy_test_percent": 99.25}


def said(path, x):
    return load(path).run([x[:, None] if x.ndim == 2 else x])


def network(width=64):
    torch.manual_seed(0)
    layers = [torch.nn.Linear(4, width), torch.nn.ReLU(), torch.nn.Linear(width, 2)]
    return torch.nn.Sequential(*layers)


EXAMPLE = np.random.default_rng(3).normal(size=(9, 4)).astype(np.float32)


def test_a_release_loads_and_answers_like_torch(tmp_path):
    net = network()
    made = release(net, [EXAMPLE], manifest(), words(Beware="No clock."), METRICS, tmp_path)
    x = np.random.default_rng(4).normal(size=(33, 4)).astype(np.float32)
    (answer,) = said(tmp_path / "toy.json", x)
    with torch.no_grad():
        expected = net(torch.from_numpy(x)).numpy()
    np.testing.assert_allclose(answer, expected, rtol=AGREEMENT, atol=AGREEMENT)
    card = (tmp_path / "toy.md").read_text(encoding="utf-8")
    for part in ("# toy", "No clock.", "satellites: 4 to 8", "99.25", made.sha256, "toy.json"):
        assert part in card
    origin = load(tmp_path / "toy.json").manifest.origin
    assert origin.recipe == {"steps": 3}
    assert origin.command == "fgnav train mine.toml --scale smoke"
    assert origin.command in card
    assert origin.made_with["torch"] == torch.__version__


def test_half_precision_halves_the_file_and_still_agrees_with_its_own_torch_module(tmp_path):
    net = network(2000)
    release(net, [EXAMPLE], manifest("full"), words(), {}, tmp_path)
    with torch.no_grad():
        before = net(torch.from_numpy(EXAMPLE)).numpy()
    release(net, [EXAMPLE], manifest("half"), words(), {}, tmp_path, half=True)
    full, half = ((tmp_path / f"{name}.onnx").stat().st_size for name in ("full", "half"))
    assert half < 0.6 * full
    (answer,) = said(tmp_path / "half.json", EXAMPLE)
    assert 0 < np.abs(answer - before).max() < 2e-3  # eleven bits of weights, 2000 of them


def test_weights_that_are_no_numbers_are_not_released(tmp_path):
    net = network()
    with torch.no_grad():
        net[0].bias[1] = torch.inf
    with pytest.raises(NoSolutionError, match=r"toy: weights 0\.bias are not all finite"):
        release(net, [EXAMPLE], manifest(), words(), {}, tmp_path)
    assert not list(tmp_path.iterdir())


class Jumpy(torch.nn.Module):
    """A branch that the tracer takes once and for all."""

    def forward(self, x):
        return x[:, :2] + (1.0 if x.shape[0] == 1 else 0.0)


@pytest.mark.filterwarnings("ignore::torch.jit.TracerWarning")
def test_a_network_that_onnx_answers_otherwise_is_not_released(tmp_path):
    with pytest.raises(NoSolutionError, match="output y of onnxruntime differs from torch by"):
        release(Jumpy(), [EXAMPLE], manifest(), words(), {}, tmp_path)
    assert not list(tmp_path.iterdir())


def test_examples_must_be_one_per_input(tmp_path):
    with pytest.raises(BadInputError, match="examples: must be one per input, 1, got 2"):
        release(network(), [EXAMPLE, EXAMPLE], manifest(), words(), {}, tmp_path)


@pytest.mark.parametrize("task", ["classification", "regression"])
@pytest.mark.parametrize("kind", ["mlp", "rnn", "lstm"])
@pytest.mark.parametrize("head", ["dense", "residual"])
def test_every_kind_of_ambiguity_network_can_be_released(tmp_path, task, kind, head):
    rng = np.random.default_rng(6)
    features = rng.normal(0, 3, (500, 5)).astype(np.float32)
    offset, mix = whitened(torch.from_numpy(features))
    net = AmbiguityNet(
        Architecture(kind=kind, dense=(8,), recurrent=6, head=head),
        task=task,
        window=3,
        offset=offset,
        mix=mix,
        targets=torch.arange(4),
        shared=True,
        seed=1,
    )
    form = Covariance(form="probability", name="more") if task == "classification" else None
    made = manifest("net", channels=5, window=3, form=form)
    windows = features[:60].reshape(20, 3, 5)
    release(Answer(net), [windows], made, words(), {}, tmp_path, half=True)
    cycles = integer_answers(load(tmp_path / "net.json"), [windows]).value
    assert np.abs(cycles).max() <= 16 or head == "residual"


def test_the_commit_is_that_of_this_source_or_unknown(tmp_path, monkeypatch):
    monkeypatch.setattr(made, "__file__", str(tmp_path / "release.py"))
    assert made_with(5, {}, {}).commit == "unknown"
    for command in (["init", "-q"], ["commit", "-q", "--allow-empty", "-m", "other"]):
        subprocess.run(["git", "-C", str(tmp_path), *IDENTITY, *command], check=True)
    assert made_with(5, {}, {}).commit == "unknown"  # of a repository that is not this one
    (tmp_path / "release.py").touch()
    for command in (["add", "."], ["commit", "-q", "-m", "source"]):
        subprocess.run(["git", "-C", str(tmp_path), *IDENTITY, *command], check=True)
    assert re.fullmatch(r"[0-9a-f]{7,}", made_with(5, {}, {}).commit)
    (tmp_path / "release.py").write_text("changed")
    assert made_with(5, {}, {}).commit.endswith("-dirty")
