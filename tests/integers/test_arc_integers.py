"""Integers of whole arcs against a base: right where they are fixed, refused where in doubt."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.gnss.arc_adjustment import adjust_arcs
from fgnav.gnss.position_phase import position_phase
from fgnav.integers.arc_integers import resolve_arcs
from fgnav_sim.receiver_tables import LossOfLockTable, MultipathTable
from tests.gnss.based import antenna_n_m, flown

WRONG_MAX = 1e-3


def adjusted(flight):
    return adjust_arcs(position_phase(flight, base=True), ("base", "a1"))


def off_m(flight, adjustment):
    found = adjustment.positions()
    return np.linalg.norm(found.p_n_m - antenna_n_m(flight, found.t_s), axis=1)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    "disturbed", [{}, {"loss_of_lock": LossOfLockTable(rate_per_hour=200)}, {"rate_hz": 1.0}]
)
def test_fixed_integers_are_right(seed, disturbed):
    flight = flown(seed=seed, **disturbed)
    found = resolve_arcs(adjusted(flight), WRONG_MAX)
    assert found.fixed.sum() >= 7
    assert found.wrong_probability <= WRONG_MAX
    assert off_m(flight, found.adjustment).max() < 0.05


def test_doubtful_integers_are_not_fixed():
    echoes = MultipathTable(code_m=2.0, phase_m=0.004, time_constant_s=60.0)
    for seed in range(2):
        flight = flown(seed=seed, rate_hz=5.0, multipath=echoes)
        found = resolve_arcs(adjusted(flight), WRONG_MAX)
        if found.fixed.any():
            assert off_m(flight, found.adjustment).max() < 0.1
        else:
            assert found.reason in (
                "chance of wrong integers above 0.001",
                "the integers do not fit code and phase",
            )
            assert found.wrong_probability == 0


def test_integers_that_phase_contradicts_are_refused():
    """Half a cycle on one arc: some integer is nearest, but none fits."""
    flight = flown()
    adjustment = adjusted(flight)
    constant_m = adjustment.constant_m.copy()
    constant_m[2] += 0.5 * adjustment.equations.single.wavelength_m[0]
    sure = replace(adjustment, constant_m=constant_m, covariance_m2=1e-4 * adjustment.covariance_m2)
    found = resolve_arcs(sure, WRONG_MAX)
    assert not found.fixed.any()
    assert found.reason == "the integers do not fit code and phase"
