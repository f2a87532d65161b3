"""Gaps with three satellites: the smoother knows more than that there are too few."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.integers.truth import Truth
from fgnav.methods.smoother import antenna_motion
from fgnav.methods.smoother.few import with_few
from fgnav.methods.smoother.keyframes import Timed
from fgnav.methods.smoother.smoother import Batch, Smoother
from tests.gnss.test_few_satellites import GAP_S, THREE_LEFT, TWO_LEFT, true_antenna, with_gap
from tests.methods.simulated import nees

RESOLVER = Truth()


def gap_errors(flight, estimate):
    """Errors of position and velocity within the gap, less the shared one of positions."""
    p_n_m, v_n_mps = true_antenna(flight, estimate.t_s)
    inside = (estimate.t_s > GAP_S[0]) & (estimate.t_s < GAP_S[1])
    before = estimate.t_s < GAP_S[0]
    off_m = estimate.p_n_m - p_n_m
    return off_m[inside] - off_m[before].mean(axis=0), (estimate.v_n_mps - v_n_mps)[inside], inside


@pytest.mark.parametrize("method", [Smoother(resolver=RESOLVER), Batch(resolver=RESOLVER)])
def test_three_satellites_bridge_a_gap(monkeypatch, method):
    flight = with_gap(THREE_LEFT, seed=2)
    estimate = method(flight)
    off_m, off_mps, inside = gap_errors(flight, estimate)
    assert any("too few satellites" in note.lower() for note in estimate.notes)
    assert nees(off_mps, estimate.velocity_covariance_m2ps2[inside]) < 8
    monkeypatch.setattr(antenna_motion, "few_of", lambda *_: None)
    blind_m, blind_mps, _ = gap_errors(flight, method(dataclasses.replace(flight)))
    assert np.linalg.norm(off_m, axis=1).max() < 0.5 * np.linalg.norm(blind_m, axis=1).max()
    assert (off_mps**2).mean() < (blind_mps**2).mean() / 2


def test_a_gap_without_attitude_is_left_alone_and_told(monkeypatch):
    flight = with_gap(TWO_LEFT)
    estimate = Batch(resolver=RESOLVER)(flight)
    assert any("have no attitude" in note for note in estimate.notes)
    monkeypatch.setattr(antenna_motion, "few_of", lambda *_: None)
    without = Batch(resolver=RESOLVER)(dataclasses.replace(flight))
    assert_allclose(estimate.p_n_m, without.p_n_m, rtol=0, atol=1e-9)


def test_a_partial_value_is_whitened_by_its_own_root():
    partial = np.zeros((3, 3, 3))
    partial[1, 0] = [0.0, 2.0, 0.0]
    value = np.zeros((3, 3))
    value[2] = np.nan
    timed = Timed(value=value, covariance=np.tile(4 * np.eye(3), (3, 1, 1)), arm_b_m=np.zeros(3))
    white = dataclasses.replace(timed, partial=partial).white(np.arange(3))
    assert_allclose(white[0], np.eye(3) / 2, rtol=1e-12)
    assert_allclose(white[1], partial[1], rtol=1e-12)
    assert not white[2].any()


def test_without_such_epochs_keyframes_stay_as_they_are():
    keyframes = object()
    assert with_few(keyframes, None, np.zeros(0)) == (keyframes, ())
