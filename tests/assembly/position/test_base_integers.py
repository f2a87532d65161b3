"""Integers of arcs against a base, and slips that nobody flagged."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.special import chdtri

from fgnav.assembly.position.numbered_arcs import Observed
from fgnav.assembly.position.phases import antenna_phase
from fgnav.gnss.undifferenced import undifferenced
from fgnav.graph.types.parameters import Parameters
from tests.assembly.position.test_live_arcs import least_squares
from tests.gnss.based import antenna_n_m, flown


@cache
def sky(span_s, rate_hz=2.0, **of):
    """Return a flight near a base, of one frequency."""
    signals = {"G": ("1C",), "E": ("1C",)}
    return flown.__wrapped__(span_s=span_s, signals=signals, rate_hz=rate_hz, **of)


def resolved(flight, *, causal, jumped=()):
    """Return phases at true attitudes; ``jumped``: channel, epoch, cycles."""
    of, truth = undifferenced(flight, base=True), flight.truth
    for j, i, cycles in jumped:
        phase_m = of.phase_m.copy()
        phase_m[i:, j] += cycles * of.wavelength_m[j]
        of = replace(of, phase_m=phase_m)
    rows = np.arange(len(of.t_s))
    R_nb = truth.R_nb[np.searchsorted(truth.t_s, of.t_s - 1e-6)]
    observed = (Observed(of, rows, rows, np.zeros(3), "a1"),)
    return antenna_phase(observed, of.t_s, R_nb, Parameters(), causal=causal), of


def is_white(phase, flight, of):
    squares, freedom = least_squares(phase, antenna_n_m(flight, of.t_s))
    return squares < chdtri(freedom, 1e-3)


def test_each_arc_has_an_integer_its_chance_to_be_wrong_and_who_says_so():
    phases, of = resolved(sky(8.0), causal=False)
    assert {one.by for one in phases.arcs} == {"base"}
    assert max(one.wrong_probability for one in phases.arcs) < 1e-3
    assert len({one.link for one in phases.arcs}) == (of.arc[-1] >= 0).sum() - 2  # constellations
    assert phases.rejections == ()


@pytest.mark.parametrize("cycles", [1.0, -0.5])
def test_a_slip_that_nobody_flagged_begins_an_arc_there(cycles):
    flight = sky(8.0)
    _, of = resolved(flight, causal=True)
    j = int(np.flatnonzero((of.arc >= 0).all(axis=0))[2])
    phases, _ = resolved(flight, causal=True, jumped=[(j, 9, cycles)])
    (rejected,) = phases.rejections
    assert rejected.link == f"a1 {of.satellites[j]} {of.signals[j]}"
    assert rejected.from_s == rejected.until_s == of.t_s[9]
    assert f"slipped by {cycles:+.1f} cycles" in rejected.reason
    assert is_white(phases.phase, flight, of)
