"""``--integers network``: right where it is sure, and modest outside what it knows."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.integers.resolvers.causal import causal_form
from fgnav.integers.resolvers.constrained import Constrained
from fgnav_models.runtime import resolver
from fgnav_models.runtime.load import load
from fgnav_models.runtime.resolver import Network, handed_over, posteriors
from tests.integers.arrays import PAPER_ANTENNAS_B_M, make

NETWORK = Network(fallback=Constrained(estimate_noise=False))


def test_good_epochs_are_fixed_and_right():
    made = make(np.random.default_rng(1), epochs=60, sine=True)
    integers = NETWORK(made.differences, made.flight)
    accepted = integers.fixed.any(axis=(1, 2))
    assert accepted.mean() > 0.9
    assert (integers.cycles[integers.fixed] == made.cycles[integers.fixed]).all()
    assert (integers.wrong_probability[accepted] <= 1e-3).all()
    assert integers.resolver == "network"


def test_a_bad_link_is_found_left_out_and_counted():
    made = make(np.random.default_rng(2), epochs=25, sine=True)
    d = made.differences
    phase_m, code_m = d.phase_m.copy(), d.code_m.copy()
    low = int(np.argmax(d.elevation_rad[0] > 0.5))
    low = low if low else 1
    phase_m[:, 2, low] += 0.04
    code_m[:, 2, low] += 4.0
    spoilt = replace(d, phase_m=phase_m, code_m=code_m)
    integers = NETWORK(spoilt, made.flight)
    accepted = integers.fixed.any(axis=(1, 2))
    assert accepted.mean() > 0.5
    assert not integers.fixed[accepted, 2, low].all()
    assert (integers.cycles[integers.fixed] == made.cycles[integers.fixed]).all()
    worse = [loss for loss in integers.unused if "worse than stated" in loss.reason]
    lost = d.resolvable[accepted] & ~integers.fixed[accepted]
    assert worse[0].count == lost.sum()


def test_a_link_half_a_cycle_off_does_not_make_the_others_doubtful():
    made = make(np.random.default_rng(9), epochs=25, satellites=(7,))
    d = made.differences
    phase_m = d.phase_m.copy()
    phase_m[:, 2, 3] += 0.5 * d.wavelength_m[3]
    integers = NETWORK(replace(d, phase_m=phase_m), made.flight)
    assert integers.fixed.any(axis=(1, 2)).mean() > 0.8
    assert not integers.fixed[:, 2, 3].any()
    assert (integers.cycles[integers.fixed] == made.cycles[integers.fixed]).all()


@pytest.mark.parametrize("antennas", [[0, 3], [0, 1, 3], range(8)])
@pytest.mark.parametrize("satellites", [(4, 4), (6, 6, 6), (6, 6, 6, 6)])
def test_any_array_and_receiver_is_within_the_domain(antennas, satellites):
    array = PAPER_ANTENNAS_B_M[list(antennas)]
    made = make(np.random.default_rng(10), epochs=20, antennas_b_m=array, satellites=satellites)
    integers = NETWORK(made.differences, made.flight)
    assert handed_over(integers) == {}
    if len(array) * sum(satellites) > 20:
        assert integers.fixed.any(axis=(1, 2)).mean() > 0.6
    assert (integers.cycles[integers.fixed] == made.cycles[integers.fixed]).all()


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"antennas_b_m": np.vstack([PAPER_ANTENNAS_B_M, [0.4, 0, 0]])}, "antennas outside 2 to 8"),
        ({"antennas_b_m": 3.0 * PAPER_ANTENNAS_B_M}, "baseline m outside"),
        ({"satellites": (25,)}, "satellites outside 4 to 24"),
        ({"phase_m": 0.02}, "phase sigma m outside"),
        ({"code_m": 9.0}, "code sigma m outside"),
        ({"satellites": (2, 2, 2, 2, 2)}, "groups outside 1 to 4"),
    ],
)
def test_outside_the_domain_the_constrained_search_answers_and_a_loss_says_so(changes, reason):
    made = make(np.random.default_rng(3), epochs=3, **changes)
    integers = NETWORK(made.differences, made.flight)
    expected = NETWORK.fallback(made.differences, made.flight)
    assert (integers.fixed == expected.fixed).all()
    assert (integers.cycles == expected.cycles).all()
    [(text, count)] = handed_over(integers).items()
    assert count == 3
    assert reason in text
    assert text.endswith("left to constrained")


def test_epochs_in_and_outside_the_domain_come_back_in_their_order():
    made = make(np.random.default_rng(4), epochs=6)
    d = made.differences
    variance = d.phase_variance_m2.copy()
    variance[1::2] = 0.02**2
    integers = NETWORK(replace(d, phase_variance_m2=variance), made.flight)
    assert sum(handed_over(integers).values()) == 3
    assert integers.fixed[::2].any(axis=(1, 2)).all()
    assert (integers.cycles[integers.fixed] == made.cycles[integers.fixed]).all()


def test_a_flight_much_noisier_than_stated_is_judged_by_its_own_noise():
    made = make(np.random.default_rng(5), epochs=40, code_m=0.9, phase_m=0.004)
    d = made.differences
    boasted = replace(
        d,
        code_variance_m2=d.code_variance_m2 / 9.0,
        phase_variance_m2=d.phase_variance_m2 / 9.0,
    )
    integers = Network()(boasted, made.flight)
    assert handed_over(integers) == {}
    assert integers.fixed.any(axis=(1, 2)).mean() > 0.9
    assert (integers.cycles[integers.fixed] == made.cycles[integers.fixed]).all()
    without_estimate = NETWORK(boasted, made.flight)
    assert without_estimate.fixed.sum() < integers.fixed.sum()


def test_the_causal_form_knows_nothing_of_later_epochs():
    made = make(np.random.default_rng(11), epochs=60, satellites=(4,), sine=True)
    causal = causal_form(Network())
    assert isinstance(causal, Network)
    first = np.arange(40)
    flown = causal(made.differences, made.flight)
    cut = causal(made.differences[first], made.flight)
    np.testing.assert_allclose(flown.wrong_probability[first], cut.wrong_probability, atol=1e-9)


def test_an_epoch_without_code_has_no_answer():
    made = make(np.random.default_rng(6), epochs=3)
    code_m = made.differences.code_m.copy()
    code_m[1] = np.nan
    integers = NETWORK(replace(made.differences, code_m=code_m), made.flight)
    assert not integers.fixed[1].any()
    assert integers.wrong_probability[1] == 1.0
    assert integers.reasons[1] == "no link with code and phase"
    assert any(loss.reason == "phase without code" for loss in integers.unused)


def test_posteriors_are_shares_of_exponentials():
    score, none = np.log([3.0, 1.0, 4.0]), np.log([4.0, 99.0, 1.0])
    probability, of_none, best = posteriors(score, none, np.array([0, 0, 2]), 3)
    np.testing.assert_allclose(probability, [3 / 8, 1 / 8, 4 / 5])
    np.testing.assert_allclose(of_none, [4 / 8, 1.0, 1 / 5])
    assert best.tolist() == [0, -1, 2]


def test_the_released_risk_is_not_above_that_of_constrained():
    metrics = load("trust").manifest.origin.metrics
    assert metrics["wrong_percent"] <= metrics["constrained_wrong_percent"]


def test_without_onnxruntime_one_line_names_the_extra(monkeypatch):
    made = make(np.random.default_rng(8))
    resolver._loaded.cache_clear()
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(BadInputError, match="needs onnxruntime; pip install onnxruntime"):
        NETWORK(made.differences, made.flight)


def test_the_threshold_must_be_a_probability():
    with pytest.raises(BadInputError, match=r"wrong_max: must be between 0 and 1, got 1\.5"):
        Network(wrong_max=1.5)
