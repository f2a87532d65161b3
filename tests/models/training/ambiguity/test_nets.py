"""Many networks in one module: each as if it were alone."""

import numpy as np
import pytest
import torch

from fgnav.checks import BadInputError
from fgnav_models.training.ambiguity.nets import (
    CLASSES,
    N_MAX,
    AmbiguityNet,
    Architecture,
    cycles_of,
    loss_of,
    min_max,
    whitened,
)

FEATURES = 5


def network(kind="mlp", *, task="classification", targets=3, window=1, **options):
    shared = options.pop("shared", False)
    architecture = Architecture(kind=kind, dense=(7, 6), recurrent=4, **options)
    return AmbiguityNet(
        architecture,
        task=task,
        window=window,
        offset=torch.zeros(FEATURES),
        mix=torch.eye(FEATURES),
        targets=torch.arange(targets),
        shared=shared,
        seed=2,
    )


def samples(n=11, window=1, seed=0):
    return torch.randn((n, window, FEATURES), generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("kind", ["mlp", "rnn", "lstm"])
def test_a_member_answers_as_if_it_were_alone(kind):
    together, alone = network(kind, window=3), network(kind, targets=1, window=3)
    member = {
        key: value[1:2] if value.ndim == 3 else value[1:2] if key == "ranges" else value
        for key, value in together.state_dict().items()
    }
    alone.load_state_dict(member)
    x = samples(window=3)
    for net in (together, alone):
        net.eval()
    torch.testing.assert_close(alone(x)[:, 0], together(x)[:, 1], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("kind", ["rnn", "lstm"])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_recurrent_layers_are_those_of_torch(kind, activation):
    net = network(kind, targets=1, window=4, activation=activation)
    layer = net.layers.recurrent
    reference = torch.nn.LSTM if kind == "lstm" else torch.nn.RNN
    options = {} if kind == "lstm" else {"nonlinearity": activation}
    theirs = reference(FEATURES, 4, batch_first=True, **options)
    with torch.no_grad():
        theirs.weight_ih_l0.copy_(layer.inward.weight[0].T)
        theirs.weight_hh_l0.copy_(layer.own[0].T)
        theirs.bias_ih_l0.copy_(layer.inward.bias[0, 0])
        theirs.bias_hh_l0.zero_()
    x = samples(window=4)
    torch.testing.assert_close(layer(x)[0], theirs(x)[0][:, -1], rtol=1e-5, atol=1e-6)


def test_members_trained_together_get_the_gradient_they_would_get_alone():
    net = network()
    x, cycles = samples(), torch.tensor([[1, -2, 0]]).expand(11, 3)
    is_present = torch.ones(11, 3, dtype=torch.bool)
    loss_of("classification", net(x), cycles, is_present).backward()
    together = net.layers.dense[0].weight.grad[1].clone()
    net.zero_grad()
    only = is_present.clone()
    only[:, [0, 2]] = False
    loss_of("classification", net(x), cycles, only).backward()
    torch.testing.assert_close(net.layers.dense[0].weight.grad[1], together, rtol=1e-6, atol=1e-9)
    assert not net.layers.dense[0].weight.grad[[0, 2]].any()


def test_shared_networks_have_one_backbone_and_a_head_per_target():
    shared, each = network(shared=True), network()
    assert shared.layers.dense[0].weight.shape[0] == 1
    assert each.layers.dense[0].weight.shape[0] == 3
    assert shared(samples()).shape == each(samples()).shape == (11, 3, CLASSES)


@pytest.mark.parametrize("task", ["classification", "regression"])
def test_a_residual_network_rounds_before_it_has_learnt(task):
    net = network(task=task, head="residual").eval()
    x = 4.0 * samples(200)
    rounded = torch.round(x[:, 0, :3]).long()
    assert rounded.abs().max() > 3
    assert torch.equal(cycles_of(task, net(x)), rounded)


def test_losses_are_those_of_the_textbook():
    cycles = torch.tensor([[2, 0]])
    is_present = torch.tensor([[True, False]])
    scores = torch.zeros(1, 2, CLASSES)
    loss = loss_of("classification", scores, cycles, is_present)
    assert float(loss) == pytest.approx(np.log(CLASSES), rel=1e-6, abs=0)
    value = (torch.tensor([[2.0, 9.0]]) + N_MAX + 1.6) / (2 * N_MAX)
    loss = loss_of("regression", value, cycles, is_present)
    assert float(loss) == pytest.approx((1.6 / 32) ** 2, rel=1e-5, abs=0)
    assert cycles_of("regression", value)[0, 0] == 4


def test_dropout_falsifies_training_only():
    net = network(dropout=0.5)
    x = samples()
    net.train()
    assert not torch.equal(net(x), net(x))
    net.eval()
    assert torch.equal(net(x), net(x))


def test_inputs_are_scaled_by_what_the_training_set_holds():
    features = torch.randn((400, 3)) @ torch.tensor([[5.0, 1, 0], [0, 2, 0], [0, 0, 1e-2]]) + 7.0
    offset, mix = min_max(features)
    scaled = (features - offset) @ mix
    torch.testing.assert_close(scaled.amin(dim=0), torch.zeros(3), rtol=0, atol=1e-6)
    torch.testing.assert_close(scaled.amax(dim=0), torch.ones(3), rtol=0, atol=1e-6)
    offset, mix = whitened(features)
    white = (features.double() - offset) @ mix
    covariance = white.T @ white / 400
    torch.testing.assert_close(covariance, torch.eye(3).double(), rtol=0, atol=1e-6)


def test_a_window_holds_a_sample_at_least():
    with pytest.raises(BadInputError, match="window: must be 1 or more, got 0"):
        network(window=0)
