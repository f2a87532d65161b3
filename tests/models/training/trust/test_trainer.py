"""The trust network's training: seconds of it, and figures that can be checked by hand."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from fgnav.io.strict_toml import read_toml
from fgnav_models.runtime.load import load
from fgnav_models.runtime.resolver import FIGURES
from fgnav_models.training.order import Order
from fgnav_models.training.trust.data import NONE, TrustSamples
from fgnav_models.training.trust.net import TrustNet, log_probabilities
from fgnav_models.training.trust.score import (
    Posteriors,
    calibration_error,
    posteriors,
    share_covered,
    summary,
    temperature,
)
from fgnav_models.training.trust.trainer import run
from fgnav_models.trust_features import LINK_FEATURES, SATELLITES, WHOLE_FEATURES

RECIPE = Path(__file__).parents[4] / "models" / "fgnav_models" / "recipes" / "trust.toml"


def order(out, deadline_s=math.inf):
    content = read_toml(RECIPE)
    content.pop("kind")
    out.mkdir(exist_ok=True)
    return Order(
        recipe=RECIPE,
        content=content,
        out=out,
        scale="smoke",
        device="cpu",
        deadline_s=deadline_s,
        watch=lambda what, progress: None,  # noqa: ARG005
    )


def test_smoke_scale_ends_in_a_network_that_runs_and_goes_on_where_it_was_cut(tmp_path):
    out = tmp_path / "out"
    assert run(order(out, deadline_s=0.0)) is None
    lines = run(order(out))
    assert any(line.startswith("calibration_error") for line in lines)
    table = [line for line in lines if line.startswith("| 8 satellites | 20 |")]
    assert len(table) == 1
    assert table[0] in (out / "trust.md").read_text().splitlines()
    network = load(out / "trust.json")
    assert {one.name for one in network.manifest.domain} == set(FIGURES)
    again = tmp_path / "again"
    run(order(again))
    assert (again / "trust.onnx").read_bytes() == (out / "trust.onnx").read_bytes()


def samples_with(truth, rows):
    n = len(truth)
    return TrustSamples(
        start=np.arange(n + 1) * rows,
        truth=np.array(truth),
        links=np.zeros((n * rows, 1, LINK_FEATURES)),
        is_present=np.ones((n * rows, 1)),
        whole=np.zeros((n * rows, WHOLE_FEATURES)),
        outlier=np.zeros((n * rows, 1)),
        cost=np.ones(n),
        degrees=np.ones(n),
    )


def test_some_epochs_keep_their_own_rows():
    samples = samples_with([0, NONE, 1, 0], 2)
    whole = samples.whole.copy()
    whole[:, SATELLITES] = np.repeat([4, 7, 5, 7], 2) / 8.0
    samples = replace(samples, whole=whole, outlier=np.arange(8.0)[:, None])
    assert samples.satellites.tolist() == [4, 7, 5, 7]
    some = samples.chosen(samples.satellites != 7)
    assert some.satellites.tolist() == [4, 5]
    assert some.truth.tolist() == [0, 1]
    assert some.start.tolist() == [0, 2, 4]
    assert some.outlier.ravel().tolist() == [0, 1, 4, 5]


def test_posteriors_follow_the_best_candidate():
    samples = samples_with([0, 1, NONE], 2)
    score = np.log([2.0, 1.0, 2.0, 1.0, 1.0, 1.5])
    none = np.zeros(6)
    of = posteriors(score, none, samples)
    np.testing.assert_allclose(of.trust, [0.5, 0.5, 1.5 / 3.5])
    assert of.right.tolist() == [True, False, False]
    assert of.entropy == pytest.approx(-np.log([0.5, 0.25, 1 / 3.5]).mean())


def test_temperature_undoes_a_factor():
    rng = np.random.default_rng(1)
    score = rng.normal(0, 2, 40_000)
    chance = 1 / (1 + np.exp(-score))
    truth = np.where(rng.random(40_000) < chance, 0, NONE)
    found = temperature(1.8 * score, np.zeros(40_000), samples_with(truth, 1))
    assert found == pytest.approx(1.8, rel=0.05)


def test_figures_are_those_counted_by_hand():
    trust = np.array([0.9999] * 8 + [0.5, 0.5])
    right = np.array([True] * 7 + [False, True, False])
    figures = summary(Posteriors(trust=trust, right=right, entropy=0.0))
    assert figures["coverage_percent"] == pytest.approx(80.0)
    assert figures["wrong_of_sure"] == 1
    # binomial: 1 or fewer wrong of 8 with a chance of 5 % at that share
    p = figures["wrong_of_sure_bound_percent"] / 100
    assert (1 - p) ** 8 + 8 * p * (1 - p) ** 7 == pytest.approx(0.05)
    assert calibration_error(trust, right) == pytest.approx((8 * 0.9999 - 7 + 0.0) / 10)


def test_as_many_are_covered_as_keep_the_mean_chance_to_be_wrong_below_one_in_a_thousand():
    trust = np.array([1.0, 1.0, 1.0, 0.9972, 0.9971, 0.5])
    assert share_covered(trust) == pytest.approx(4 / 6)  # mean of 0.0028 and three zeros: 0.0007


def test_links_may_come_in_any_order_and_absent_ones_do_not_count():
    rng = np.random.default_rng(2)
    net = TrustNet(8, seed=1)
    torch.nn.init.normal_(net.answer.weight)
    links = torch.from_numpy(rng.normal(size=(3, 6, LINK_FEATURES)).astype(np.float32))
    is_present = torch.tensor([[1.0] * 4 + [0.0] * 2]).repeat(3, 1)
    whole = torch.from_numpy(rng.normal(size=(3, WHOLE_FEATURES)).astype(np.float32))
    order = torch.tensor([2, 0, 5, 3, 1, 4])
    changed = links.clone()
    changed[:, 4:] = 7.0
    with torch.no_grad():
        expected = net(links, is_present, whole)
        shuffled = net(links[:, order], is_present[:, order], whole)
        other = net(changed, is_present, whole)
    for k in range(2):
        torch.testing.assert_close(shuffled[k], expected[k], rtol=1e-5, atol=1e-5)
        torch.testing.assert_close(other[k], expected[k], rtol=0, atol=0)


def test_log_probabilities_of_an_epoch_add_up_to_one():
    score, none = torch.tensor([0.3, 50.0, -2.0]), torch.tensor([1.0, 9.0, 0.5])
    epoch, first = torch.tensor([0, 0, 1]), torch.tensor([0, 2])
    rows, nones = log_probabilities(score, none, epoch, first)
    total = torch.exp(nones).index_add(0, epoch, torch.exp(rows))
    torch.testing.assert_close(total, torch.ones(2))
