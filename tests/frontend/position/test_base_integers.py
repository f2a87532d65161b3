"""Integers of arcs against a base: reported, taken back where wrong; slips that nobody flagged."""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from scipy.special import chdtri

from fgnav.frontend.causal.truncation import truncated
from fgnav.frontend.position import base_integers
from fgnav.frontend.position.base_faults import odds
from fgnav.frontend.position.numbered_arcs import Observed
from fgnav.frontend.position.phases import antenna_phase
from fgnav.gnss.undifferenced import undifferenced
from fgnav.graph.types.constants import Constants
from fgnav.methods.observation_stream import ObservationStream
from fgnav.methods.smoother import Forward
from fgnav.methods.smoothing.concatenation import concatenate_estimates
from tests.frontend.position.test_live_arcs import least_squares
from tests.gnss.based import antenna_n_m, flown

FORWARD = Forward(noise="stated")


@cache
def sky(span_s, rate_hz=2.0, **of):
    """Return a flight near a base, of one frequency."""
    signals = {"G": ("1C",), "E": ("1C",)}
    return flown.__wrapped__(span_s=span_s, signals=signals, rate_hz=rate_hz, **of)


@pytest.fixture
def one_wrong(monkeypatch):
    """Integers that the first block fixes are off by a cycle in one arc."""
    searched = base_integers._searched

    def off(j, names, state):
        one, enough = searched(j, names, state)
        if j or one is None:
            return one, enough
        return one._replace(right=one.right + one.combination[:, -1]), enough

    monkeypatch.setattr(base_integers, "_searched", off)


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
    return antenna_phase(observed, of.t_s, R_nb, Constants(), causal=causal), of


def is_white(phase, flight, of):
    squares, freedom = least_squares(phase, antenna_n_m(flight, of.t_s))
    return squares < chdtri(freedom, 1e-3)


def test_each_arc_has_an_integer_its_chance_to_be_wrong_and_who_says_so():
    phases, of = resolved(sky(8.0), causal=False)
    assert {one.by for one in phases.arcs} == {"base"}
    assert max(one.wrong_probability for one in phases.arcs) < 1e-3
    assert len({one.link for one in phases.arcs}) == (of.arc[-1] >= 0).sum() - 2  # constellations
    assert phases.rejections == ()


@pytest.mark.usefixtures("one_wrong")
@pytest.mark.parametrize("causal", [False, True])
def test_a_wrong_integer_is_taken_back(causal):
    flight = sky(8.0)
    phases, of = resolved(flight, causal=causal)
    (rejected,) = phases.rejections
    assert "taken back" in rejected.reason
    wrong, right = (one for one in phases.arcs if one.link == rejected.link)
    assert abs(wrong.cycles - right.cycles) == 1
    assert wrong.wrong_probability > 0.5
    assert right.from_s > wrong.until_s == rejected.until_s
    assert is_white(phases.phase, flight, of)
    assert len(phases.phase.earlier) == causal


@pytest.mark.usefixtures("one_wrong")
def test_a_filter_has_a_wrong_integer_until_it_is_taken_back():
    flight = sky(8.0)
    phases, of = resolved(flight, causal=True)
    (row,) = phases.phase.revised
    assert of.t_s[row] > phases.rejections[0].until_s
    before, after = phases.phase.as_of(row - 1), phases.phase.as_of(row)
    assert not is_white(before, flight, of)
    assert is_white(after, flight, of)


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


def test_odds_are_those_of_all_integers():
    rng = np.random.default_rng(1)
    L = rng.normal(size=(3, 3)) * 0.4
    P, a = L @ L.T + 0.05 * np.eye(3), rng.normal(size=3)
    some = np.array(list(product(range(-6, 7), repeat=3)))
    cost = np.einsum("ki,ij,kj->k", a - some, np.linalg.inv(P), a - some)
    weight = np.exp(-cost / 2) / np.exp(-cost / 2).sum()
    held = some[np.argsort(cost)[1]]
    result = odds(a, P, held)
    np.testing.assert_array_equal(result.likeliest, some[cost.argmin()])
    np.testing.assert_allclose(result.held, weight[(some == held).all(axis=1)][0], rtol=1e-2)
    wrong = (weight[:, None] * (some != held)).sum(axis=0)
    np.testing.assert_allclose(result.wrong, wrong, rtol=0, atol=1e-2)


@pytest.mark.usefixtures("one_wrong")
def test_forward_does_not_look_ahead_of_integers_taken_back():
    flight = sky(4.0, rate_hz=5.0, gyroscope=True)
    whole = FORWARD(flight)
    assert {one.by for one in whole.arcs} == {"base"}
    back_s = next(one.until_s for one in whole.rejections if "taken back" in one.reason)
    for until_s in (back_s - 0.1, back_s + 0.1, back_s + 1.1):
        part = FORWARD(truncated(flight, until_s))
        n = int((part.t_s <= until_s).sum())
        np.testing.assert_allclose(part.p_n_m[:n], whole.p_n_m[:n], rtol=0, atol=1e-9)


@pytest.mark.usefixtures("one_wrong")
def test_a_stream_takes_integers_back_as_forward_does():
    flight = sky(6.0, gyroscope=True)
    parts = [one for one in ObservationStream.replay(flight, FORWARD) if len(one.t_s)]
    count = sum(len(one.t_s) for one in parts)
    streamed, whole = concatenate_estimates(parts, count, count), FORWARD(flight)
    np.testing.assert_allclose(streamed.p_n_m, whole.p_n_m, rtol=0, atol=1e-9)
