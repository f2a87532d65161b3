"""From torch to ONNX: the same numbers, or no release."""

import numpy as np
import pytest
import torch

from fgnav.checks import BadInputError, NoSolutionError
from fgnav_models.runtime.load import load
from fgnav_models.runtime.manifest import Port
from fgnav_models.training.ambiguity.nets import AmbiguityNet, Architecture, whitened
from fgnav_models.training.ambiguity.released import Answer
from fgnav_models.training.release import AGREEMENT, Story, release


def story(name="toy", inputs=4, outputs=2):
    return Story(
        name=name,
        purpose="A test.",
        inputs=(Port(name="x", shape=("n", inputs), unit="m", meaning="lengths"),),
        outputs=(Port(name="y", shape=("n", outputs), unit="m", meaning="answers"),),
        domain={"satellites": [4, 8], "array": "any"},
        recipe={"steps": 3},
        seed=5,
        metrics={"accuracy_test_percent": 99.25},
    )


def network(width=64):
    torch.manual_seed(0)
    layers = [torch.nn.Linear(4, width), torch.nn.ReLU(), torch.nn.Linear(width, 2)]
    return torch.nn.Sequential(*layers)


EXAMPLE = np.random.default_rng(3).normal(size=(9, 4)).astype(np.float32)


def test_a_release_loads_and_answers_like_torch(tmp_path):
    net = network()
    manifest = release(net, [EXAMPLE], story(), tmp_path, notes={"What it is not": "A clock."})
    x = np.random.default_rng(4).normal(size=(33, 4)).astype(np.float32)
    answer = load(tmp_path / "toy.onnx")(x=x)["y"]
    with torch.no_grad():
        expected = net(torch.from_numpy(x)).numpy()
    np.testing.assert_allclose(answer, expected, rtol=AGREEMENT, atol=AGREEMENT)
    assert manifest.size_bytes == (tmp_path / "toy.onnx").stat().st_size
    card = (tmp_path / "toy.md").read_text(encoding="utf-8")
    for words in ("# toy", "A clock.", "satellites: 4 to 8", "99.25", manifest.sha256, "toy.json"):
        assert words in card
    assert load(tmp_path / "toy.onnx").manifest.recipe == {"steps": 3}


def test_half_precision_halves_the_file_and_still_agrees_with_its_own_torch_module(tmp_path):
    net = network(2000)
    full = release(net, [EXAMPLE], story("full"), tmp_path, notes={})
    with torch.no_grad():
        before = net(torch.from_numpy(EXAMPLE)).numpy()
    half = release(net, [EXAMPLE], story("half"), tmp_path, notes={}, half=True)
    assert half.size_bytes < 0.6 * full.size_bytes
    answer = load(tmp_path / "half.onnx")(x=EXAMPLE)["y"]
    assert 0 < np.abs(answer - before).max() < 2e-3  # eleven bits of weights, 2000 of them


def test_a_card_may_stand_elsewhere(tmp_path):
    release(network(), [EXAMPLE], story(), tmp_path / "w", notes={}, cards=tmp_path / "c")
    assert sorted(p.name for p in (tmp_path / "w").iterdir()) == ["toy.json", "toy.onnx"]
    assert [p.name for p in (tmp_path / "c").iterdir()] == ["toy.md"]


def test_weights_that_are_no_numbers_are_not_released(tmp_path):
    net = network()
    with torch.no_grad():
        net[0].bias[1] = torch.inf
    with pytest.raises(NoSolutionError, match=r"toy: weights 0\.bias are not all finite"):
        release(net, [EXAMPLE], story(), tmp_path, notes={})
    assert not list(tmp_path.iterdir())


class Jumpy(torch.nn.Module):
    """A branch that the tracer takes once and for all."""

    def forward(self, x):
        return x[:, :2] + (1.0 if x.shape[0] == 1 else 0.0)


@pytest.mark.filterwarnings("ignore::torch.jit.TracerWarning")
def test_a_network_that_onnx_answers_otherwise_is_not_released(tmp_path):
    with pytest.raises(NoSolutionError, match="output y of onnxruntime differs from torch by"):
        release(Jumpy(), [EXAMPLE], story(), tmp_path, notes={})
    assert not list(tmp_path.iterdir())


def test_examples_must_be_one_per_input(tmp_path):
    with pytest.raises(BadInputError, match="examples: must be one per input, 1, got 2"):
        release(network(), [EXAMPLE, EXAMPLE], story(), tmp_path, notes={})


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
    ports = (
        Port(name="cycles", shape=("n", 4), unit="cycle", meaning="", dtype="int64"),
        Port(name="more", shape=("n", 4), unit="1", meaning=""),
    )
    words = story("net")
    words = Story(
        name="net",
        purpose=words.purpose,
        inputs=(Port(name="x", shape=("n", 3, 5), unit="cycle", meaning=""),),
        outputs=ports,
        domain={},
        recipe={},
        seed=1,
        metrics={},
    )
    windows = features[:60].reshape(20, 3, 5)
    release(Answer(net), [windows], words, tmp_path, notes={}, half=True)
    answer = load(tmp_path / "net.onnx")(x=windows)
    assert answer["cycles"].dtype == np.int64
    assert np.abs(answer["cycles"]).max() <= 16 or head == "residual"
