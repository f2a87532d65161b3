"""Keyframes with two or three satellites: what they know in some directions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.frontend.position.rank_deficient import RankDeficient, completed, gaps_with_attitude
from fgnav.frontend.position.series import VectorSeries
from fgnav.frontend.problem import build_problem
from fgnav.frontend.settings import ProblemSettings
from fgnav.gnss.few_satellites import Partial
from fgnav.integers.truth import Truth
from fgnav.process.evidence import RatePrior
from tests.gnss.test_few_satellites import GAP_S, THREE_LEFT, TWO_LEFT, true_antenna, with_gap

PRIOR = RatePrior(length_s=1.0, variance_rad2ps2=np.full(3, 0.1), evidence=0.0)


def series(*, missing=(), segment=None, n=6):
    value = np.zeros((n, 3))
    value[list(missing)] = np.nan
    return VectorSeries(
        value=value,
        covariance=np.tile(4 * np.eye(3), (n, 1, 1)),
        arm_b_m=np.zeros(3),
        segment=None if segment is None else np.array(segment),
    )


def partial(rows):
    """One direction, to half a metre, at some keyframes."""
    k = len(rows)
    root = np.zeros((k, 3, 3))
    root[:, 0, 1] = 2.0
    t_s, value = np.array(rows, dtype=float), np.tile([0.0, 7.0, 0.0], (k, 1))
    return Partial(t_s=t_s, value=value, root=root)


def deficient(position_rows, velocity_rows=()):
    return RankDeficient(
        position=partial(position_rows),
        velocity=partial(velocity_rows),
        position_row=np.array(position_rows, dtype=np.int64),
        velocity_row=np.array(velocity_rows, dtype=np.int64),
    )


def test_a_value_known_in_part_is_whitened_by_its_own_root():
    root = np.zeros((3, 3, 3))
    root[1, 0] = [0.0, 2.0, 0.0]
    value = np.zeros((3, 3))
    value[2] = np.nan
    known = VectorSeries(
        value=value,
        covariance=np.tile(4 * np.eye(3), (3, 1, 1)),
        arm_b_m=np.zeros(3),
        partial=root,
    )
    white = known.white(np.arange(3))
    assert_allclose(white[0], np.eye(3) / 2, rtol=1e-12)
    assert_allclose(white[1], root[1], rtol=1e-12)
    assert not white[2].any()


def test_without_such_epochs_series_stay_as_they_are():
    position = series()
    assert completed(position, None, None, np.ones(6, dtype=bool)) == (position, None, ())


def test_only_keyframes_without_a_value_take_one_that_is_known_in_part():
    position, part = series(missing=[2, 3]), deficient([1, 2, 3])
    filled, velocity, (note,) = completed(position, None, part, np.ones(6, dtype=bool))
    assert velocity is None
    assert_allclose(filled.value[[1, 2, 3], 1], [0.0, 7.0, 7.0])
    assert filled.partial.any(axis=(1, 2)).tolist() == [False, False, True, True, False, False]
    assert filled.valid.all()
    assert note.startswith("Too few satellites for a position: 2 keyframes with a position, and 0")


def test_what_is_known_in_part_belongs_to_the_longest_segment():
    position = series(missing=[2, 3], segment=[1, 1, -1, -1, 0, 0])
    filled, _, _ = completed(position, None, deficient([2, 3]), np.ones(6, dtype=bool))
    assert filled.segment.tolist() == [1, 1, 0, 0, 0, 0]


def test_gaps_without_attitude_take_nothing_and_are_noted():
    usable = np.array([True, True, False, True, True, True])
    filled, _, (note,) = completed(series(missing=[2, 3]), None, deficient([2, 3]), usable)
    assert np.isnan(filled.value[2]).all()
    assert filled.valid[3]
    assert note.endswith("Not used at 1, in gaps that have no attitude, either.")


def test_a_gap_counts_as_without_attitude_from_end_to_end():
    away_s = np.array([0.0, 0.0, 1.0, 2.1, 1.0, 0.0])
    position = series(missing=[2, 3, 4])
    usable = gaps_with_attitude(position, away_s)
    assert usable.tolist() == [True, False, False, False, False, True]
    assert gaps_with_attitude(position, np.minimum(away_s, 2.0)).all()
    assert gaps_with_attitude(None, away_s).all()


def problem_of(azimuth_deg, seed=1):
    flight = with_gap(azimuth_deg, seed=seed)
    settings = ProblemSettings(resolver=Truth(), rate_prior=PRIOR)
    return flight, build_problem(flight, settings)


@pytest.fixture(scope="module")
def three_left():
    return problem_of(THREE_LEFT, seed=2)


def test_three_satellites_measure_directions_of_position_and_velocity(three_left):
    flight, prepared = three_left
    problem = prepared.problem
    assert any("too few satellites" in note.lower() for note in prepared.notes)
    for name, column in (("position", 0), ("velocity", 1)):
        part = next(m for m in problem.measurements if m.name == name)
        t_s = problem.t_s[part.row]
        inside = (t_s > GAP_S[0] - 0.05) & (t_s < GAP_S[1] - 0.05)
        assert inside.sum() > 40
        assert (part.freedom[inside] < 3).all()
        assert (part.freedom[~inside] == 3).all()
        value = part.value_n_m if column == 0 else part.value_n_mps
        true = true_antenna(flight, t_s)[column]
        white = np.einsum("kij,kj->ki", part.white, value - true)
        before = np.einsum("kij,kj->ki", part.white, (value - true)[~inside].mean(axis=0)[None])
        # Less the error that all positions share; arcs that go on tell the rest to their noise.
        rest = (white - before)[inside]
        assert (rest**2).sum() / part.freedom[inside].sum() < 3.0, name


def test_two_satellites_without_attitude_are_left_out_and_noted():
    _, prepared = problem_of(TWO_LEFT)
    problem = prepared.problem
    assert any("have no attitude" in note for note in prepared.notes)
    position = next(m for m in problem.measurements if m.name == "position")
    assert (position.freedom == 3).all()
