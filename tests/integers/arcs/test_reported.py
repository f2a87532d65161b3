"""The integers of arcs, each with the chance that it is wrong, and who says so."""

import dataclasses

import numpy as np
import pytest

from fgnav.alignment.array.adaptation import adapted
from fgnav.geometry import rotations
from fgnav.integers.arcs.reported import APART_S, reported_arcs
from tests.attitude.arrays import sky, synthetic
from tests.integers.arrays import PAPER_ANTENNAS_B_M

NAMES = ("a1", "a2", "a3", "a4")
N = 30


def array(seed, antennas=4, channels=7):
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 1.0, N)
    R_nb = rotations.from_euler(angle, 0.3 * angle, -angle)
    arms = PAPER_ANTENNAS_B_M[:antennas]
    return (*synthetic(R_nb, sky(channels, rng), rng, antennas_b_m=arms), rng)


def of(differences, integers):
    return {one.link: one for one in reported_arcs(differences, integers, NAMES)}


def adapted_by_evidence(differences, integers):
    clean = adapted(differences, integers, NAMES, 1e-4)
    return dataclasses.replace(clean.integers, evidence=clean.evidence, source=clean.source)


def test_each_arc_has_its_integer_its_span_and_who_says_so():
    differences, true, _ = array(0)
    arcs = of(differences, adapted_by_evidence(differences, true))
    assert len(arcs) == true.fixed[0].sum()
    one = arcs["a3 G05 1C"]
    assert one.cycles == true.cycles[0, 1, differences.satellites.index("G05")]
    assert (one.from_s, one.until_s) == (differences.t_s[0], differences.t_s[-1])
    assert one.by == "resolver"
    assert max(one.wrong_probability for one in arcs.values()) < 1e-6


def test_a_mended_arc_is_said_by_who_mended_it():
    differences, true, _ = array(1)
    cycles, j = true.cycles.copy(), differences.satellites.index("G05")
    cycles[5:15, 1, j] += 2
    arcs = of(
        differences, adapted_by_evidence(differences, dataclasses.replace(true, cycles=cycles))
    )
    assert arcs["a3 G05 1C"].by == "resolver"  # of most of its epochs
    cycles[:, 1, j] = true.cycles[:, 1, j] + 2
    one = of(
        differences, adapted_by_evidence(differences, dataclasses.replace(true, cycles=cycles))
    )["a3 G05 1C"]
    assert one.by in ("arc", "array")
    assert one.cycles == true.cycles[0, 1, j]


def test_a_resolver_alone_states_the_chance():
    differences, true, _ = array(2)
    assert {one.wrong_probability for one in of(differences, true).values()} == {None}
    stated = dataclasses.replace(true, wrong_probability=np.full(N, 0.01))
    found = [one.wrong_probability for one in of(differences, stated).values()]
    assert found == pytest.approx([0.01] * len(found))


def test_epochs_that_err_alike_count_once():
    differences, true, _ = array(2)
    later = dataclasses.replace(
        differences, t_s=differences.t_s + np.repeat([0.0, APART_S], N // 2)
    )
    stated = dataclasses.replace(true, wrong_probability=np.full(N, 0.01))
    found = [one.wrong_probability for one in of(later, stated).values()]
    assert found == pytest.approx([1 / (1 + 99**2)] * len(found))


def test_stated_chances_are_no_less_than_shares_wrong():
    """Ten flights of a pair, and of three antennas, a third of their arcs wrong all along."""
    stated, wrong = [], []
    for antennas, seed in [(a, 20_100 + s) for a in (2, 3) for s in range(10)]:
        differences, true, rng = array(seed, antennas)
        bad = true.fixed[0] & (rng.random(true.fixed[0].shape) < 1 / 3)
        off = np.where(bad, rng.integers(1, 4, bad.shape) * rng.choice([-1, 1], bad.shape), 0)
        cycles = np.where(true.fixed, true.cycles + off, 0)
        integers = adapted_by_evidence(differences, dataclasses.replace(true, cycles=cycles))
        for one in reported_arcs(differences, integers, NAMES):
            name, satellite, _ = one.link.split()
            j, k = differences.satellites.index(satellite), int(name[1]) - 2
            stated.append(one.wrong_probability)
            row = int(np.searchsorted(differences.t_s, one.from_s))
            wrong.append(one.cycles != true.cycles[row, k, j])
    stated, wrong = np.array(stated), np.array(wrong)
    sure = stated < 0.01
    assert sure.mean() > 0.4
    assert wrong[sure].sum() <= 1  # of a hundred, and stated are fewer
    assert wrong.mean() == pytest.approx(stated.mean(), abs=0.1)  # arcs of a flight err together
