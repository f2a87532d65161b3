"""Phases that contradict their array: wrong integers mended, bad links left out."""

import dataclasses

import numpy as np
import pytest

from fgnav.attitude import RotationQuadratic
from fgnav.frontend.array.exclusion import exclude_faults
from fgnav.geometry import rotations
from tests.attitude.arrays import sky, synthetic
from tests.integers.arrays import L1_M, PAPER_ANTENNAS_B_M

NAMES = tuple(f"a{k + 1}" for k in range(8))
N = 40


def array(seed, antennas_b_m=PAPER_ANTENNAS_B_M, channels=8):
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 1.0, N)
    R_nb = rotations.from_euler(angle, 0.3 * angle, -angle)
    differences, true = synthetic(R_nb, sky(channels, rng), rng, antennas_b_m=antennas_b_m)
    return differences, true, rng


def cleaned(differences, integers, names=NAMES):
    return exclude_faults(differences, integers, names, 1e-4)


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


@pytest.mark.parametrize("share", [0.05, 0.1, 0.2])
def test_arcs_with_wrong_integers_end_as_if_they_were_right(share):
    for seed in range(4):
        differences, true, rng = array(seed)
        wrong = true.fixed[0] & (rng.random(true.fixed[0].shape) < share)
        off = np.where(wrong, rng.integers(1, 4, wrong.shape) * rng.choice([-1, 1], wrong.shape), 0)
        clean = cleaned(differences, dataclasses.replace(true, cycles=true.cycles + off))
        assert (clean.integers.cycles == true.cycles).all()
        assert not clean.refused.any()
        right = cleaned(differences, true)
        np.testing.assert_allclose(clean.form.vector, right.form.vector, rtol=1e-9)
        assert len(clean.rejections) == wrong.sum()
        spans = {(one.from_s, one.until_s) for one in clean.rejections}
        assert spans <= {(differences.t_s[0], differences.t_s[-1])}


def test_a_mended_integer_is_listed_with_its_link_its_span_and_by_how_much():
    differences, true, _ = array(1)
    cycles = true.cycles.copy()
    cycles[5:15, 2, 4] += 2
    (one,) = cleaned(differences, dataclasses.replace(true, cycles=cycles)).rejections
    assert (one.what, one.link) == ("phase", "a4 G05 1C")
    assert (one.from_s, one.until_s) == pytest.approx((0.5, 1.4))
    assert one.reason == "integer off by +2: mended by what the rest of the array says"


def test_epochs_with_all_integers_wrong_are_mended_by_their_arcs():
    differences, true, rng = array(2)
    cycles = true.cycles.copy()
    cycles[7] += np.where(true.fixed[7], rng.integers(-3, 4, true.fixed[7].shape), 0)
    clean = cleaned(differences, dataclasses.replace(true, cycles=cycles))
    assert (clean.integers.cycles == true.cycles).all()
    assert not clean.refused.any()


def test_a_slip_that_nobody_noticed_is_mended_by_the_epochs_themselves():
    """Resolved once for its arc, the integer is right only before the slip."""
    differences, true, _ = array(3)
    phase_m = differences.phase_m.copy()
    phase_m[15:, 1, 3] += 4 * L1_M  # most of the arc
    clean = cleaned(with_phase(differences, phase_m), true)
    assert (clean.integers.cycles[:15, 1, 3] == true.cycles[:15, 1, 3]).all()
    assert (clean.integers.cycles[15:, 1, 3] == true.cycles[15:, 1, 3] + 4).all()


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


def test_a_baseline_on_another_vector_is_mended_by_the_other_six():
    differences, true, rng = array(5)
    cycles = true.cycles + 0
    cycles[:, 3] += np.where(true.fixed[:, 3], rng.integers(-2, 3, 8), 0)
    clean = cleaned(differences, dataclasses.replace(true, cycles=cycles))
    assert (clean.integers.cycles == true.cycles).all()


def test_of_two_baselines_that_disagree_neither_is_believed():
    differences, true, _ = array(6, PAPER_ANTENNAS_B_M[[0, 3, 5]])
    cycles = true.cycles + 0
    cycles[:, 1] += np.where(true.fixed[:, 1], [0, 3, -2, 1, -3, 2, 1, -1], 0)
    clean = cleaned(differences, dataclasses.replace(true, cycles=cycles), NAMES[:3])
    assert clean.refused.mean() > 0.9
    assert clean.rejections == ()


def test_louder_noise_is_noise_and_no_link_is_left_out():
    differences, true, rng = array(7)
    noise_m = 0.006 * rng.standard_normal(differences.phase_m.shape)
    noise_m[:, :, 0] = 0.0
    clean = cleaned(with_phase(differences, differences.phase_m + noise_m), true)
    assert any("times the stated" in note for note in clean.notes)
    assert len(clean.rejections) < 0.01 * true.fixed.sum()
    assert clean.refused.mean() < 0.1
