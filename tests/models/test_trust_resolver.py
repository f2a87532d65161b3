"""``--integers network``: right where it is sure, and modest outside what it knows."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.integers.resolvers.constrained import Constrained
from fgnav_models.runtime import resolver
from fgnav_models.runtime.load import load
from fgnav_models.runtime.resolver import Network, outside_domain
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
    worse = [loss for loss in integers.losses if "worse than stated" in loss.reason]
    lost = d.resolvable[accepted] & ~integers.fixed[accepted]
    assert worse[0].count == lost.sum()


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"antennas_b_m": PAPER_ANTENNAS_B_M[[0, 3]]}, "antennas outside 3 to 8"),
        ({"antennas_b_m": 3.0 * PAPER_ANTENNAS_B_M}, "baseline m outside"),
        ({"satellites": (9,)}, "satellites outside 4 to 8"),
        ({"phase_m": 0.02}, "phase sigma m outside"),
        ({"code_m": 9.0}, "code sigma m outside"),
        ({"satellites": (2, 2, 2)}, "groups outside 1 to 2"),
    ],
)
def test_outside_the_domain_the_constrained_search_answers_and_a_loss_says_so(changes, reason):
    made = make(np.random.default_rng(3), epochs=3, **changes)
    integers = NETWORK(made.differences, made.flight)
    expected = NETWORK.fallback(made.differences, made.flight)
    assert (integers.fixed == expected.fixed).all()
    assert (integers.cycles == expected.cycles).all()
    assert integers.losses[0].count == 3
    assert reason in integers.losses[0].reason
    assert integers.losses[0].reason.endswith("left to constrained")


def test_epochs_in_and_outside_the_domain_come_back_in_their_order():
    made = make(np.random.default_rng(4), epochs=6)
    d = made.differences
    variance = d.phase_variance_m2.copy()
    variance[1::2] = 0.02**2
    integers = NETWORK(replace(d, phase_variance_m2=variance), made.flight)
    assert integers.losses[0].count == 3
    assert integers.fixed[::2].any(axis=(1, 2)).all()
    assert (integers.cycles[integers.fixed] == made.cycles[integers.fixed]).all()


def test_a_flight_much_noisier_than_stated_is_left_to_the_constrained_search():
    made = make(np.random.default_rng(5), epochs=40, code_m=0.9, phase_m=0.006)
    d = made.differences
    boasted = replace(
        d,
        code_variance_m2=d.code_variance_m2 / 9.0,
        phase_variance_m2=d.phase_variance_m2 / 9.0,
    )
    integers = NETWORK(boasted, made.flight)
    assert integers.losses[0].count == 40
    assert "median misfit" in integers.losses[0].reason


def test_an_epoch_without_code_has_no_answer():
    made = make(np.random.default_rng(6), epochs=3)
    code_m = made.differences.code_m.copy()
    code_m[1] = np.nan
    integers = NETWORK(replace(made.differences, code_m=code_m), made.flight)
    assert not integers.fixed[1].any()
    assert integers.wrong_probability[1] == 1.0
    assert integers.reasons[1] == "no link with code and phase"
    assert any(loss.reason == "phase without code" for loss in integers.losses)


def test_one_epoch_is_judged_as_in_company():
    made = make(np.random.default_rng(7), epochs=20, code_m=1.0, satellites=(5,), sine=True)
    network = load("trust")
    assert outside_domain(made.differences, network.manifest.domain) == ("",) * 20
    together = resolver.trusted(made.differences, network, nodes=10**6)

    alone = resolver.trusted(made.differences.resampled(np.array([13])), network, nodes=10**6)
    assert alone.wrong_probability[0] == pytest.approx(together.wrong_probability[13], abs=1e-4)


def test_without_onnxruntime_one_line_names_the_extra(monkeypatch):
    made = make(np.random.default_rng(8))
    resolver._loaded.cache_clear()
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(BadInputError, match=r"needs onnxruntime; pip install 'fgnav\[networks\]'"):
        NETWORK(made.differences, made.flight)


@pytest.mark.parametrize("name", ["wrong_max", "outlier_max"])
def test_thresholds_must_be_probabilities(name):
    with pytest.raises(BadInputError, match=f"{name}: must be between 0 and 1, got 1.5"):
        Network(**{name: 1.5})
