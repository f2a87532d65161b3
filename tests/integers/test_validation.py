"""Phases that contradict array or arcs: detected, identified, left out or held by their arcs."""

import dataclasses

import numpy as np
import pytest

from fgnav.attitude import RotationQuadratic
from fgnav.geometry import rotations
from fgnav.integers.validation import validated
from tests.attitude.arrays import sky, synthetic
from tests.integers.arrays import L1_M, PAPER_ANTENNAS_B_M

NAMES = tuple(f"a{k + 1}" for k in range(8))
N = 40


def array(seed, antennas_b_m=PAPER_ANTENNAS_B_M, channels=8):
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 1.0, N)
    R_nb = rotations.from_euler(angle, 0.3 * angle, -angle)
    differences, true = synthetic(R_nb, sky(channels, rng), rng, antennas_b_m=antennas_b_m)
    return differences, dataclasses.replace(true, wrong_probability=np.full(N, 1e-6)), rng


def cleaned(differences, integers, names=NAMES, *, causal=False):
    return validated(differences, integers, names, 1e-4, causal=causal)


def used_and_wrong(clean, true):
    """Return the share of links that take part, and how many of them have wrong integers."""
    fixed = clean.integers.fixed & ~clean.refused[:, None, None]
    return fixed.sum() / true.fixed.sum(), (fixed & (clean.integers.cycles != true.cycles)).sum()


def changed(integers, cycles):
    return dataclasses.replace(integers, cycles=np.where(integers.fixed, cycles, 0))


def without(integers, epochs):
    fixed = integers.fixed.copy()
    fixed[epochs] = False
    return changed(dataclasses.replace(integers, fixed=fixed), integers.cycles)


def with_phase(differences, phase_m):
    return dataclasses.replace(differences, phase_m=phase_m)


def test_an_array_that_agrees_is_left_alone():
    differences, true, _ = array(0)
    clean = cleaned(differences, true)
    assert clean.integers is true
    assert clean.rejections == ()
    assert not clean.refused.any()
    stated = RotationQuadratic.of_double_differences(differences, true)
    assert (clean.form.information == stated.information).all()


@pytest.mark.parametrize("causal", [False, True])
@pytest.mark.parametrize("share", [0.05, 0.1])
def test_arcs_with_wrong_integers_are_left_out(share, causal):
    for seed in range(4):
        differences, true, rng = array(seed)
        bad = true.fixed[0] & (rng.random(true.fixed[0].shape) < share)
        off = np.where(bad, rng.integers(1, 4, bad.shape) * rng.choice([-1, 1], bad.shape), 0)
        clean = cleaned(differences, changed(true, true.cycles + off), causal=causal)
        assert (clean.integers.fixed == true.fixed & ~bad).all()
        assert not clean.refused.any()
        assert len(clean.rejections) == bad.sum()
        spans = {(one.from_s, one.until_s) for one in clean.rejections}
        assert spans <= {(differences.t_s[0], differences.t_s[-1])}


def test_an_integer_of_its_arc_is_listed_with_its_link_its_span_and_by_how_much():
    differences, true, _ = array(1)
    cycles = true.cycles.copy()
    cycles[5:15, 2, 4] += 2
    (one,) = cleaned(differences, dataclasses.replace(true, cycles=cycles)).rejections
    assert (one.what, one.link) == ("phase", "a4 G05 1C")
    assert (one.from_s, one.until_s) == pytest.approx((0.5, 1.4))
    assert one.reason == "integer off by +2: mended by its arc"


@pytest.mark.parametrize("causal", [False, True])
def test_epochs_with_all_integers_wrong_have_those_of_their_arcs(causal):
    differences, true, rng = array(2)
    cycles = true.cycles.copy()
    cycles[7] += np.where(true.fixed[7], rng.integers(-3, 4, true.fixed[7].shape), 0)
    clean = cleaned(differences, changed(true, cycles), causal=causal)
    assert (clean.integers.cycles == true.cycles).all()
    assert not clean.refused.any()


@pytest.mark.parametrize("causal", [False, True])
@pytest.mark.parametrize("resolved_from", [15, 23, N])
def test_a_link_is_left_out_from_a_slip_on_that_nobody_noticed(causal, resolved_from):
    """The arc goes on, its integer does not; who resolves notices at once, later, or never."""
    differences, true, _ = array(3)
    phase_m, slipped = differences.phase_m.copy(), true.cycles.copy()
    phase_m[15:, 1, 3] += 4 * L1_M  # most of the arc
    slipped[15:, 1, 3] += 4
    cycles = np.where(np.arange(N)[:, None, None] < resolved_from, true.cycles, slipped)
    clean = cleaned(with_phase(differences, phase_m), changed(true, cycles), causal=causal)
    fixed, others = clean.integers.fixed, np.ones(true.fixed.shape[1:], dtype=bool)
    others[1, 3] = False
    assert not clean.refused.any()
    assert (clean.integers.cycles == slipped)[fixed].all()
    assert (fixed == true.fixed)[:, others].all()
    assert fixed[5:15, 1, 3].all()


def test_integers_that_fit_but_are_not_those_of_their_arcs_are_detected_by_these():
    """Two antennas, integers of the array turned over: their residuals contradict nothing."""
    differences, true, _ = array(8, PAPER_ANTENNAS_B_M[[0, 3]])
    turned = rotations.from_euler(*np.tile([[0.4], [-0.5], [2.0]], N))
    cycles = true.cycles.copy()
    other_m = differences.phase_m - differences.array_m(turned)
    cycles[20] = np.rint(other_m / L1_M)[20]
    found = RotationQuadratic.of_ranges(differences, differences.phase_m - L1_M * cycles)
    for causal in (False, True):
        clean = cleaned(differences, changed(true, cycles), NAMES[:2], causal=causal)
        assert (clean.integers.cycles == true.cycles).all()
        assert {one.from_s for one in clean.rejections} == {differences.t_s[20]}
    assert found.count[20] == found.count[19]


def off_links(differences, link, error_m, epochs):
    """Add an error to the phase of one undifferenced link, antenna and channel."""
    antenna, channel = link
    phase_m = differences.phase_m.copy()
    reference = int(differences.reference[0, 0])
    rows = slice(None) if antenna == 0 else slice(antenna - 1, antenna)
    change = np.zeros(phase_m.shape[1:])
    sign = -1.0 if antenna == 0 else 1.0
    if channel == reference:
        change[rows] -= sign * error_m
        change[rows, reference] = 0.0
    else:
        change[rows, channel] += sign * error_m
    phase_m[epochs] += change
    return with_phase(differences, phase_m)


@pytest.mark.parametrize(
    ("link", "name"),
    [((3, 4), "a4 G05 1C"), ((3, 0), "a4 G01 1C"), ((0, 4), "a1 G05 1C")],
    ids=["a link", "of the reference channel", "of the reference antenna"],
)
def test_a_link_off_by_a_quarter_of_a_cycle_is_left_out_by_name(link, name):
    differences, true, _ = array(4)
    epochs = slice(10, 20)
    clean = cleaned(off_links(differences, link, 0.25 * L1_M, epochs), true)
    assert not clean.refused.any()
    assert {one.link for one in clean.rejections} == {name}
    assert all("left out" in one.reason for one in clean.rejections)
    covered = sum(round(10 * (one.until_s - one.from_s)) + 1 for one in clean.rejections)
    assert covered == 10
    if link[0]:
        assert clean.form.count[0] - clean.form.count[15] == 1
        assert (clean.integers.cycles[~clean.integers.fixed] == 0).all()


def test_an_antenna_on_another_vector_is_left_out_wholly():
    differences, true, rng = array(5)
    cycles = true.cycles + 0
    cycles[:, 3] += np.where(true.fixed[:, 3], rng.integers(-2, 3, 8), 0)
    clean = cleaned(differences, dataclasses.replace(true, cycles=cycles))
    assert not clean.refused.any()
    assert not clean.integers.fixed[:, 3].any()
    assert used_and_wrong(clean, true) == (pytest.approx(6 / 7), 0)


def test_of_two_baselines_that_disagree_neither_is_believed():
    differences, true, _ = array(6, PAPER_ANTENNAS_B_M[[0, 3, 5]])
    cycles = true.cycles + 0
    cycles[:, 1] += np.where(true.fixed[:, 1], [0, 3, -2, 1, -3, 2, 1, -1], 0)
    clean = cleaned(differences, dataclasses.replace(true, cycles=cycles), NAMES[:3])
    assert clean.refused.mean() > 0.9
    assert clean.rejections == ()


@pytest.mark.parametrize("causal", [False, True])
def test_two_antennas_whose_arcs_are_wrong_to_a_third_are_refused(causal):
    """Seven links beyond a direction, and one left out, would fit by chance."""
    for seed in range(100, 110):
        differences, true, rng = array(seed, PAPER_ANTENNAS_B_M[[0, 3]])
        bad = rng.random(true.fixed[0].shape) < 1 / 3
        off = np.where(bad, rng.integers(1, 4, (1, 8)), 0)
        clean = cleaned(differences, changed(true, true.cycles + off), NAMES[:2], causal=causal)
        assert used_and_wrong(clean, true)[1] == 0
        assert not (bad & true.fixed[0]).any() or clean.refused.mean() > 0.95


def test_louder_noise_is_noise_and_no_link_is_left_out():
    differences, true, rng = array(7)
    noise_m = 0.006 * rng.standard_normal(differences.phase_m.shape)
    noise_m[:, :, 0] = 0.0
    clean = cleaned(with_phase(differences, differences.phase_m + noise_m), true)
    assert any("times the stated" in note for note in clean.notes)
    assert len(clean.rejections) < 0.01 * true.fixed.sum()
    assert clean.refused.mean() < 0.1


def test_wrong_integers_of_most_epochs_are_no_louder_noise_and_arcs_are_right():
    """Four antennas, integers of three epochs in four proposed at random, as of weak code."""
    for seed in range(4):
        differences, true, rng = array(20 + seed, PAPER_ANTENNAS_B_M[[0, 1, 3, 5]])
        wrong = rng.random((N, 1, 1)) < 0.75
        off = np.where(wrong, rng.integers(-2, 3, true.cycles.shape), 0)
        vague = dataclasses.replace(true, wrong_probability=np.full(N, 0.75))
        clean = cleaned(differences, changed(vague, true.cycles + off), NAMES[:4])
        assert used_and_wrong(clean, true) == (1.0, 0)
        assert not any("times the stated" in note for note in clean.notes)


def test_refused_epochs_take_the_integers_of_their_arcs():
    differences, true, _ = array(9)
    clean = cleaned(differences, without(true, np.arange(3, 30)))
    assert (clean.integers.cycles == true.cycles).all()
    assert (clean.integers.fixed == true.fixed).all()
    assert "27 epochs" in clean.notes[0]
    assert clean.rejections == ()


def test_integers_of_arcs_are_as_likely_as_where_they_come_from():
    differences, true, _ = array(9)
    chance = np.linspace(1e-6, 1e-4, N)
    chance[10:13] = 0.3  # why they are refused
    stated = dataclasses.replace(true, wrong_probability=chance)
    for causal in (False, True):
        found = cleaned(differences, without(stated, [10, 11, 12]), causal=causal).integers
        assert (found.wrong_probability[10:13] == chance[9]).all()
        assert (found.wrong_probability[13:] == chance[13:]).all()


def test_causal_an_arc_holds_from_when_two_epochs_have_said_so():
    differences, true, _ = array(9)
    clean = cleaned(differences, without(true, [0, 2, 4, 10, 11]), causal=True)
    assert not clean.integers.fixed[[0, 2]].any()
    assert (clean.integers.fixed[3:] == true.fixed[3:]).all()
    assert (clean.integers.cycles[3:] == true.cycles[3:]).all()


def test_causal_nothing_before_a_cut_comes_from_after_it():
    """Epochs of one link, wrong arcs, slips and refused epochs, whole and cut anywhere."""
    differences, true, rng = array(10, PAPER_ANTENNAS_B_M[[0, 1, 3, 5]])
    cycles = true.cycles + np.where(rng.random(true.cycles.shape[1:]) < 0.1, 2, 0)
    cycles[12:] += np.where(rng.random(true.cycles.shape[1:]) < 0.1, 1, 0)
    integers = without(changed(true, cycles), rng.permutation(N)[:8])
    few = np.zeros(integers.fixed.shape, dtype=bool)
    few[:, 1, 3] = True
    fixed = np.where(np.arange(N)[:, None, None] < 4, integers.fixed & few, integers.fixed)
    integers = changed(dataclasses.replace(integers, fixed=fixed), integers.cycles)
    whole = cleaned(differences, integers, NAMES[:4], causal=True)
    assert whole.rejections
    for n in (3, 6, 15, 29):
        rows = np.arange(n)
        first = dataclasses.replace(
            integers,
            cycles=integers.cycles[:n],
            fixed=integers.fixed[:n],
            ratio=integers.ratio[:n],
            wrong_probability=integers.wrong_probability[:n],
        )
        part = cleaned(differences.resampled(rows), first, NAMES[:4], causal=True)
        np.testing.assert_array_equal(part.integers.cycles, whole.integers.cycles[:n])
        np.testing.assert_array_equal(part.excluded, whole.excluded[:n])
        np.testing.assert_allclose(part.attitude.R_nb, whole.attitude.R_nb[:n], atol=1e-9)


def test_a_slip_among_refused_epochs_is_found_by_their_residuals():
    differences, true, _ = array(3)
    phase_m, slipped = differences.phase_m.copy(), true.cycles.copy()
    phase_m[20:, 1, 3] += 4 * L1_M
    slipped[20:, 1, 3] += 4
    for causal in (False, True):
        integers = without(changed(true, slipped), np.arange(15, 25))
        found = cleaned(with_phase(differences, phase_m), integers, causal=causal).integers
        assert (found.cycles == slipped)[found.fixed].all()
        assert found.fixed[15:25].mean() > 0.8 * true.fixed[15:25].mean()


def test_links_left_out_of_a_fixed_baseline_stay_out():
    differences, true, _ = array(9)
    fixed = true.fixed.copy()
    fixed[10:20, 0, 2] = False
    integers = changed(dataclasses.replace(true, fixed=fixed), true.cycles)
    assert (cleaned(differences, integers).integers.fixed == fixed).all()
