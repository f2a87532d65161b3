"""Sets that do not determine everything: what they leave open is neither claimed nor in the way."""

import dataclasses

import numpy as np
import pytest

from fgnav.integers.array.kernel import PROVEN
from fgnav.integers.array.search import search_constrained
from fgnav.integers.resolvers.constrained import Constrained
from tests.integers.arrays import make

PAIR_B_M = np.array([[0.0, 0.0, 0.0], [1.6, 0.0, 0.0]])
STATED = Constrained(estimate_noise=False)
NODES = 10**6


def in_a_plane(made, rng):
    """The same array and noise under satellites whose directions lie in one plane."""
    d = made.differences
    n, m = d.elevation_rad.shape
    angle = rng.uniform(0.3, np.pi - 0.3, (n, m))
    e_n = np.stack([np.cos(angle), np.zeros_like(angle), -np.sin(angle)], axis=-1)
    tilted = dataclasses.replace(d, e_n=e_n)
    change_m = tilted.array_m(made.R_nb) - d.array_m(made.R_nb)
    return dataclasses.replace(tilted, code_m=d.code_m + change_m, phase_m=d.phase_m + change_m)


def checked(found, d, cycles):
    """Share accepted; whatever is must be right."""
    right = ((found.cycles == cycles) | ~d.resolvable).all(axis=(1, 2))
    accepted = found.fixed.any(axis=(1, 2))
    assert right[accepted].all()
    return accepted.mean()


def test_integers_of_satellites_in_a_plane_are_found_though_the_attitude_has_a_mirror_image():
    rng = np.random.default_rng(1)
    made = make(rng, epochs=200, satellites=(6,))
    d = in_a_plane(made, rng)
    found = search_constrained(d, NODES)
    assert (found.status == PROVEN).all()
    assert (found.cycles == made.cycles).all(axis=(1, 2)).mean() > 0.98
    assert checked(STATED(d, made.flight), d, made.cycles) > 0.9


@pytest.mark.parametrize(("satellites", "least"), [(3, 0.3), (2, 0.0)])
def test_fewer_than_four_satellites_are_fixed_where_the_array_makes_up_for_them(satellites, least):
    made = make(np.random.default_rng(2), epochs=150, satellites=(satellites,), code_m=0.3)
    found = STATED(made.differences, made.flight)
    assert checked(found, made.differences, made.cycles) >= least
    assert np.isfinite(found.wrong_probability).all()


def test_two_antennas_under_few_satellites_state_that_they_do_not_know():
    made = make(np.random.default_rng(3), epochs=300, satellites=(3,), antennas_b_m=PAIR_B_M)
    found = search_constrained(made.differences, NODES)
    assert (found.status == PROVEN).all()
    wrong = ~(found.cycles == made.cycles).all(axis=(1, 2))
    assert wrong.mean() > 0.5
    stated = found.wrong_probability
    spread = np.sqrt((stated * (1 - stated)).sum())
    assert abs(wrong.sum() - stated.sum()) < 4 * spread + 0.05 * len(wrong)
    assert checked(STATED(made.differences, made.flight), made.differences, made.cycles) < 0.05


def test_one_difference_of_one_baseline_is_refused():
    made = make(np.random.default_rng(4), epochs=20, satellites=(2,), antennas_b_m=PAIR_B_M)
    found = STATED(made.differences, made.flight)
    assert not found.fixed.any()
    assert set(found.outcome) == {"refused"}


def test_antennas_that_come_and_go_change_what_is_observable_epoch_by_epoch():
    missing = np.zeros((90, 8, 8), bool)
    missing[30:60, 2:] = True  # a pair is left, 0.1 m apart
    missing[60:, 1:] = True  # nothing is
    made = make(np.random.default_rng(5), epochs=90, satellites=(8,), missing=missing)
    found = STATED(made.differences, made.flight)
    assert checked(found, made.differences, made.cycles) > 0.33
    assert found.fixed[:30].all(axis=(1, 2)).mean() < 1.0  # references are never fixed
    assert found.fixed[:30, :, 1:].all()
    assert not found.fixed[60:].any()
    assert set(found.reasons[60:]) == {"no link with code and phase"}


def test_antennas_nearly_in_a_line_are_solved_as_what_they_are():
    nearly_b_m = np.array([[0.0, 0, 0], [1, 0, 0], [-1, 0.002, 0]]) * 1.0
    made = make(np.random.default_rng(6), epochs=200, satellites=(8,), antennas_b_m=nearly_b_m)
    found = STATED(made.differences, made.flight)
    assert checked(found, made.differences, made.cycles) > 0.9
