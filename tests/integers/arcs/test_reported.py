"""The integers of arcs, each with the chance that it is wrong, and who says so."""

import dataclasses

import numpy as np
import pytest

from fgnav.geometry import rotations
from fgnav.integers.arcs.reported import APART_S, reported_arcs
from fgnav.integers.validation import validated
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


def test_each_arc_has_its_integer_its_span_and_who_says_so():
    differences, true, _ = array(0)
    true = dataclasses.replace(true, wrong_probability=np.full(N, 1e-6))
    refused = dataclasses.replace(true, fixed=true.fixed & (np.arange(N) < 12)[:, None, None])
    for integers, by in ((true, "resolver"), (refused, "arc")):
        arcs = of(differences, validated(differences, integers, NAMES, 1e-4).integers)
        assert len(arcs) == true.fixed[0].sum()
        one = arcs["a3 G05 1C"]
        assert one.cycles == true.cycles[0, 1, differences.satellites.index("G05")]
        assert (one.from_s, one.until_s) == (differences.t_s[0], differences.t_s[-1])
        assert one.by == by
        assert max(one.wrong_probability for one in arcs.values()) < 1e-5


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
