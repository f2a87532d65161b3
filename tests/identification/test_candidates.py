"""Clocks to begin from: what the track tells, and never one that leaves too little to judge by."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from fgnav.identification import time_tags
from fgnav.identification.time_tags import AtTags, TagSearch
from fgnav.identification.track.candidates import clock_candidates, over_common_span
from tests.frontend.standing import standing

GYROSCOPE = ("noise_radps_per_sqrt_hz", "bias_radps", "bias_walk_radps_per_sqrt_s")


def late(flight, by_s):
    return replace(flight, imu=replace(flight.imu, t_s=flight.imu.t_s + by_s))


def test_a_track_that_tells_the_clock_leaves_no_other():
    (found_s,) = clock_candidates(late(standing(20_009, span_s=90.0), -0.8))
    assert abs(found_s - 0.8) < 0.05


def test_a_short_track_has_candidates_that_keep_half_of_its_fixes():
    flight = late(standing(20_009, span_s=40.0), 0.5)
    candidates_s = clock_candidates(flight)
    assert candidates_s[0] == 0.0
    kept = over_common_span(flight, candidates_s).fixes.t_s
    assert 2 * len(kept) >= len(flight.fixes.t_s)
    for one in candidates_s:
        within = (flight.imu.t_s[0] + one < kept) & (kept < flight.imu.t_s[-1] + one)
        assert within.all()


def test_without_a_gyroscope_or_with_few_fixes_the_stated_clock_stands_alone():
    flight = standing(20_009, span_s=40.0)
    silent = ("w_b_radps", *(f"gyroscope_{name}" for name in GYROSCOPE))
    blind = replace(flight, imu=replace(flight.imu, **dict.fromkeys(silent)))
    few = replace(flight, fixes=flight.fixes[np.arange(len(flight.fixes.t_s)) < 40])
    assert clock_candidates(blind) == clock_candidates(few) == (0.0,)


def test_tags_are_where_the_likeliest_search_ended_though_it_began_at_the_stated_clock(monkeypatch):
    """Of a quadrotor's 27 s: from its stated clock .48 s on, likelier than from the track's."""
    ends = {0.0: ((-0.478, 222.0), -316.4), -0.466: ((-0.466, 0.0), -320.7)}

    def identified(_search, moved, **_begin):
        at, likelihood = ends.get(float(moved[0]), (moved, 0.0))
        return AtTags(SimpleNamespace(likelihood=likelihood), np.array(at))

    monkeypatch.setattr(time_tags, "clock_candidates", lambda _flight: tuple(ends))
    monkeypatch.setattr(TagSearch, "identified", identified)
    search = TagSearch(standing(20_009, span_s=40.0), None, None)
    np.testing.assert_array_equal(search.likeliest(None).moved, [-0.478, 222.0])
