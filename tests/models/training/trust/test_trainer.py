"""The trust network's training: seconds of it, and figures that can be checked by hand."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch

from fgnav.io.strict_toml import read_toml
from fgnav_models.runtime.load import load
from fgnav_models.runtime.resolver import FIGURES
from fgnav_models.training.order import Order, SliceOver
from fgnav_models.training.trust.data import Draw, TrustSamples, drawn_world, joined
from fgnav_models.training.trust.net import loss_of
from fgnav_models.training.trust.trainer import batch_of, entropy, run, temperature
from fgnav_models.training.trust.trials import Judged, figures
from fgnav_models.trust_features import FEATURES

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
    with pytest.raises(SliceOver):
        run(order(out, deadline_s=0.0))
    table = [line for line in run(order(out)) if line.startswith("| 8 satellites | ")]
    assert len(table) == 1
    assert table[0] in (out / "trust.md").read_text().splitlines()
    network = load(out / "trust.json")
    assert {one.name for one in network.manifest.domain} == set(FIGURES)
    assert 0 < network.manifest.origin.metrics["epochs"] <= 40  # those within the domain
    again = tmp_path / "again"
    run(order(again))
    assert (again / "trust.onnx").read_bytes() == (out / "trust.onnx").read_bytes()


def test_drawn_worlds_keep_to_their_ranges_and_differ():
    signals = ({"G": ("1C", "5Q"), "E": ("1C",)},)
    draw = Draw(arrays=1, epochs=1, signals=signals, satellites=(6, 24), antennas=(2, 8))
    worlds = [drawn_world(draw, np.random.default_rng(k)) for k in range(200)]
    assert {len(world.antennas_b_m) for world in worlds} == set(range(2, 9))
    chosen = {world.satellites.choose for world in worlds}
    assert chosen == set(range(3, 13))
    shares = [world.outliers.share for world in worlds if world.outliers]
    assert 0.5 * len(worlds) < len(shares) < len(worlds)
    assert 0.15 < max(shares) <= 0.2


def samples_with(right):
    """Return epochs, (n, rows), whose features are nought."""
    n, rows = np.shape(right)
    return TrustSamples(
        start=np.arange(n + 1) * rows,
        right=np.ravel(right),
        features=np.zeros((n * rows, FEATURES), dtype=np.float32),
    )


def test_joined_samples_keep_their_rows():
    both = joined([samples_with([[1, 0], [0, 0]]), samples_with([[0, 1, 1]])])
    assert both.start.tolist() == [0, 2, 4, 7]
    assert both.right.tolist() == [1, 0, 0, 0, 0, 1, 1]
    assert len(both.features) == 7


def test_entropy_and_loss_are_of_the_right_candidates_together_or_of_none():
    right = np.array([[True, False, True], [False, True, False], [False, False, False]])
    score = np.log([[2.0, 1.0, 0.5], [2.0, 1.0, 1.0], [1.0, 1.5, 2.0]]).ravel()
    samples, none = samples_with(right), np.zeros(9)
    expected = -np.log([2.5 / 4.5, 1 / 5, 1 / 5.5]).mean()
    assert entropy((score, none), samples) == pytest.approx(expected)

    def answer(features):
        assert len(features) == 9
        return torch.from_numpy(score), torch.from_numpy(none)

    assert float(loss_of(answer, batch_of(samples, np.arange(3)))) == pytest.approx(expected)


def test_temperature_undoes_a_factor():
    rng = np.random.default_rng(1)
    score = rng.normal(0, 2, 40_000)
    chance = 1 / (1 + np.exp(-score))
    right = rng.random((40_000, 1)) < chance[:, None]
    warm = temperature((1.8 * score, np.zeros(40_000)), samples_with(right))
    assert warm == pytest.approx(1.8, rel=0.05)


def test_figures_are_those_counted_by_hand():
    yes, no = True, False
    judged = Judged(
        trust=np.array([0.9999] * 8 + [0.9, 0.8, 0.7, 0.0]),
        right=np.array([yes] * 7 + [no, yes, no, yes, yes]),
        accepted=np.array([yes] * 8 + [no] * 4),
        constrained=np.array([yes] * 4 + [no] * 8),
        constrained_right=np.array([no, yes, yes, yes] + [no] * 8),
    )
    of = figures(judged)
    assert of["epochs"] == 12
    assert of["accepted_percent"] == pytest.approx(800 / 12)
    assert of["wrong"] == 1
    assert of["constrained_wrong"] == 1
    assert of["constrained_right_percent"] == pytest.approx(300 / 12)
    # seven right, one wrong, one right, and then the second wrong
    assert of["right_percent_at_as_many_wrong"] == pytest.approx(800 / 12)
    # binomial: 1 or fewer wrong of 8 with a chance of 5 % at that share
    p = of["wrong_bound_percent"] / 100
    assert (1 - p) ** 8 + 8 * p * (1 - p) ** 7 == pytest.approx(0.05)
