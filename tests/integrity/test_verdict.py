"""Verdicts: none of right innovations, and the right one of wrong ones."""

import numpy as np
import pytest

from fgnav.graph.innovations import InnovationSeries
from fgnav.integrity.verdict import judge

N = 400
T_S = np.arange(N) / 10
SPAN_S = (0.0, 40.0)


def series(white, name="position", t_s=T_S):
    """Innovations of a sensor of three components, (n, 3)."""
    lagged = np.append(0.0, np.einsum("ni,ni->n", white[1:], white[:-1]))
    freedom = np.full(len(white), 3)
    return InnovationSeries(name, t_s, (white**2).sum(axis=1), freedom, lagged)


def drawn(seed):
    return np.random.default_rng(seed).standard_normal((N, 3))


def test_right_innovations_have_no_verdict():
    assert not any(judge([series(drawn(seed))], {}, SPAN_S) for seed in range(300))


def test_noise_above_the_nominal_is_a_verdict_of_the_record():
    (found,) = judge([series(2.0 * drawn(1)), series(drawn(2), "velocity")], {}, SPAN_S)
    assert (found.sensor, found.test) == ("position", "record")
    assert (found.from_s, found.until_s) == (0.0, 39.9)
    assert found.ratio == pytest.approx(4.0, rel=0.1)


def test_a_fault_of_two_seconds_is_a_verdict_of_its_blocks():
    white = drawn(3)
    white[200:220] += 6.0
    (found,) = judge([series(white)], {}, SPAN_S)
    assert found.test == "1 s"
    assert 19.0 <= found.from_s <= 20.0
    assert 21.9 <= found.until_s <= 23.0


def test_correlated_innovations_of_right_size_are_a_verdict():
    white = drawn(4)
    for k in range(1, N):
        white[k] = 0.8 * white[k - 1] + 0.6 * white[k]
    (found,) = judge([series(white)], {}, SPAN_S)
    assert found.test == "correlation"
    assert found.ratio == pytest.approx(0.8, abs=0.15)


def test_a_single_outlier_of_many_measurements_is_none():
    white = drawn(5)
    white[7] += 8.0
    assert judge([series(white)], {}, SPAN_S) == ()


def test_what_is_implausible_is_a_verdict_of_the_whole_flight():
    (found,) = judge([], {"gyroscope": 3.0}, SPAN_S)
    assert (found.test, found.ratio, found.until_s) == ("plausibility", 9.0, 40.0)
    assert "3 x the largest plausible" in str(found)


def test_few_measurements_say_little():
    few = series(1.5 * drawn(6)[:4], t_s=T_S[:4])
    assert judge([few], {}, SPAN_S) == ()
