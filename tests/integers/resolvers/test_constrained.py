import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fgnav.checks import BadInputError
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.integers.resolvers.registry import resolver_named
from tests.integers.arrays import PAPER_ANTENNAS_B_M, make

PAIR_B_M = np.array([[0.0, 0.0, 0.0], [1.6, 0.0, 0.0]])
STATED = Constrained(estimate_noise=False)
DOUBTFUL = "integers too doubtful for a share of 0.001 wrong"


def right(made, integers):
    """Epochs whose integers are all true, (n,)."""
    return ((integers.cycles == made.cycles) | ~made.differences.resolvable).all(axis=(1, 2))


@pytest.mark.parametrize("code_m", [0.1, 0.3, 1.0, 10.0])
def test_array_of_the_paper_is_right_whatever_the_code(code_m):
    made = make(np.random.default_rng(1), epochs=500, code_m=code_m)
    found = STATED(made.differences, made.flight)
    assert found.fixed.any(axis=(1, 2)).mean() >= 0.99
    assert right(made, found)[found.fixed.any(axis=(1, 2))].all()
    assert (found.wrong_probability <= 1e-3).all()


def test_accepted_epochs_of_a_weak_array_are_right_and_the_others_counted():
    made = make(np.random.default_rng(2), epochs=600, code_m=0.5, antennas_b_m=PAIR_B_M)
    found = Constrained(wrong_max=1e-3, estimate_noise=False)(made.differences, made.flight)
    accepted = found.fixed.any(axis=(1, 2))
    assert 0.05 < accepted.mean() < 0.5
    assert right(made, found)[accepted].all()
    links = made.differences.resolvable
    assert found.fixed.sum() + sum(loss.count for loss in found.unused) == links.sum()
    assert [loss.reason for loss in found.unused] == [DOUBTFUL]
    assert set(found.reasons) == {"", DOUBTFUL}
    assert [reason == "" for reason in found.reasons] == accepted.tolist()
    assert set(found.outcome) == {"fixed", "refused"}
    assert (found.cycles[~accepted] == 0).all()


def test_stated_probability_of_being_wrong_is_the_share_that_is_wrong():
    made = make(np.random.default_rng(3), epochs=1500, code_m=0.5, antennas_b_m=PAIR_B_M)
    every = Constrained(wrong_max=None, tail=None, estimate_noise=False)
    found = every(made.differences, made.flight)
    stated, wrong = found.wrong_probability, ~right(made, found)
    for low, high in [(0.0, 0.01), (0.01, 0.1), (0.1, 0.3), (0.3, 1.0)]:
        of_bin = (stated >= low) & (stated < high)
        spread = np.sqrt((stated[of_bin] * (1 - stated[of_bin])).sum())
        assert of_bin.sum() > 50
        assert abs(wrong[of_bin].sum() - stated[of_bin].sum()) < 4 * spread + 1


def test_residuals_that_are_no_noise_are_refused():
    made = make(np.random.default_rng(4), epochs=100)
    phase_m = made.differences.phase_m.copy()
    phase_m[:50, 2, 3] += 0.045  # a quarter of a cycle on one link
    spoilt = dataclasses.replace(made.differences, phase_m=phase_m)
    found = Constrained(estimate_noise=False, links_out=0)(spoilt, made.flight)
    accepted = found.fixed.any(axis=(1, 2))
    assert not accepted[:50].any()
    assert accepted[50:].all()
    reasons = {loss.reason: loss.count for loss in found.unused}
    assert reasons == {"residuals of the array above chi-square at 0.0001": 50 * 35}


def test_search_that_runs_out_of_nodes_is_counted_and_not_fixed():
    made = make(np.random.default_rng(5), epochs=5, antennas_b_m=PAIR_B_M)
    found = Constrained(nodes=3)(made.differences, made.flight)
    assert not found.fixed.any()
    assert [(loss.count, loss.reason) for loss in found.unused] == [
        (25, "integer search given up before anything fitted")
    ]
    assert set(found.outcome) == {"float"}
    found = Constrained(nodes=900)(made.differences, made.flight)
    assert "integer search given up before its best was proven" in {
        loss.reason for loss in found.unused
    }


def test_phase_without_code_is_counted_and_not_fixed():
    made = make(np.random.default_rng(6), satellites=(8,))
    code_m = made.differences.code_m.copy()
    code_m[0, 2, 4:6] = np.nan
    found = STATED(dataclasses.replace(made.differences, code_m=code_m), made.flight)
    assert not found.fixed[0, 2, 4:6].any()
    assert found.fixed.sum() == 47
    assert [(loss.reason, loss.count) for loss in found.unused] == [("phase without code", 2)]


def test_epochs_without_links_stay_as_they_are():
    made = make(np.random.default_rng(9), epochs=3, missing=np.ones((3, 8, 6), bool))
    found = Constrained()(made.differences, made.flight)
    assert not found.fixed.any()
    assert np.isnan(found.ratio).all()
    assert_array_equal(found.wrong_probability, 1.0)
    assert found.unused == ()
    assert set(found.reasons) == {"no link with code and phase"}


def test_constrained_goes_by_its_name():
    assert resolver_named("constrained") == Constrained()
    assert Constrained().name == "constrained"


@pytest.mark.parametrize("bad", [0.0, 1.0, -1.0, np.nan])
@pytest.mark.parametrize("name", ["wrong_max", "tail"])
def test_threshold_that_is_no_probability_is_refused(name, bad):
    with pytest.raises(BadInputError, match=f"{name}: must be between 0 and 1, or None"):
        Constrained(**{name: bad})


@pytest.mark.parametrize(("name", "least"), [("nodes", 1), ("links_out", 0)])
def test_count_below_its_least_is_refused(name, least):
    with pytest.raises(BadInputError, match=f"{name}: must be {least} or more, got {least - 1}"):
        Constrained(**{name: least - 1})


def test_share_accepts_more_than_each_epoch_on_its_own_and_no_more_wrong_than_asked():
    made = make(np.random.default_rng(11), epochs=1500, code_m=0.5, antennas_b_m=PAIR_B_M)
    found = Constrained(wrong_max=0.02, estimate_noise=False)(made.differences, made.flight)
    at = found.fixed.any(axis=(1, 2))
    # 2 % of some 500 accepted ones: ten, with Poisson's three sigma
    assert (~right(made, found))[at].sum() < 0.02 * at.sum() + 3 * np.sqrt(0.02 * at.sum())
    assert len({reason.split(" of")[0] for reason in found.reasons} - {""}) == 1
    assert found.wrong_probability[at].mean() < 0.03
    assert at.mean() > (found.wrong_probability <= 0.02).mean() + 0.05


def test_integers_need_a_reason_for_every_epoch():
    made = make(np.random.default_rng(12), epochs=3)
    found = STATED(made.differences, made.flight)
    with pytest.raises(BadInputError, match="reasons: expected one for each of 3 epochs, got 2"):
        dataclasses.replace(found, reasons=("", ""))


def test_antennas_in_a_line_keep_their_length():
    line_b_m = PAPER_ANTENNAS_B_M[[0, 3, 4]]
    made = make(np.random.default_rng(10), epochs=200, antennas_b_m=line_b_m, satellites=(8,))
    found = STATED(made.differences, made.flight)
    accepted = found.fixed.any(axis=(1, 2))
    assert accepted.mean() > 0.95
    assert right(made, found)[accepted].all()
