from dataclasses import dataclass

import numpy as np
import pytest

from fgnav.checks import (
    BadInputError,
    FloatArray,
    freeze,
    freeze_times,
    frozen,
    increasing,
    positive,
)


def test_a_frozen_array_is_a_read_only_copy():
    mine = np.zeros(3)
    copy = frozen("x", mine, (3,))
    mine[0] = 1
    assert copy[0] == 0
    with pytest.raises(ValueError, match="read-only"):
        copy[0] = 1


@pytest.mark.parametrize(
    ("value", "gaps", "text"),
    [
        (np.zeros((2, 2)), False, r"x: expected shape \(None, 3\), got \(2, 2\)"),
        (np.array([[0, 0, 0], [0, np.nan, 0]]), False, "x: not finite, first at row 1"),
        (np.array([[np.inf, 0, 0]]), True, "x: not finite, first at row 0"),
    ],
)
def test_what_is_wrong_is_named(value, gaps, text):
    with pytest.raises(BadInputError, match=text):
        frozen("x", value, (None, 3), gaps=gaps)


def test_gaps_are_allowed_where_asked():
    assert np.isnan(frozen("x", [np.nan], (1,), gaps=True)).all()


def test_time_that_stands_still_is_named_with_its_row():
    with pytest.raises(BadInputError, match=r"t_s: time must increase, row 2 has 1.0.* after 1.0"):
        increasing("t_s", np.array([0.0, 1.0, 1.0]))


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_what_is_not_positive_is_named(value):
    with pytest.raises(BadInputError, match="sigma: must be positive"):
        positive("sigma", value)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Track:
    t_s: FloatArray
    p_n_m: FloatArray

    def __post_init__(self) -> None:
        k = freeze_times("track", self)
        freeze("track", self, {"p_n_m": (k, 3)}, gaps=True)


def test_a_data_type_keeps_read_only_copies():
    given = np.array([0.0, 1.0])
    track = Track(t_s=given, p_n_m=np.full((2, 3), np.nan))
    given[0] = 0.5
    assert track.t_s.tolist() == [0.0, 1.0]
    for array in (track.t_s, track.p_n_m):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_a_field_that_breaks_its_rule_is_named_with_its_owner():
    with pytest.raises(BadInputError, match=r"^track t_s: time must increase, row 1"):
        Track(t_s=np.zeros(2), p_n_m=np.zeros((2, 3)))
    with pytest.raises(BadInputError, match=r"^track t_s: not finite, first at row 1"):
        Track(t_s=np.array([0.0, np.nan]), p_n_m=np.zeros((2, 3)))
    with pytest.raises(BadInputError, match=r"^track p_n_m: expected shape \(2, 3\), got \(1, 3\)"):
        Track(t_s=np.arange(2.0), p_n_m=np.zeros((1, 3)))
