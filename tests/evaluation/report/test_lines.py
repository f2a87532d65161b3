import numpy as np

from fgnav.evaluation.report.lines import drawable, unjumped_deg


def test_long_lines_keep_their_spikes():
    t_s = np.arange(36_000) * 0.1
    y = np.zeros(36_000)
    y[12_345], y[20_001] = 5.0, -7.0
    _, drawn = drawable(t_s, y, 1200)
    assert len(drawn) < 3000
    assert np.nanmax(drawn) == 5.0
    assert np.nanmin(drawn) == -7.0


def test_lines_break_at_gaps():
    t_s = np.concatenate([np.arange(0, 5, 0.1), np.arange(9, 12, 0.1)])
    _, drawn = drawable(t_s, np.ones(len(t_s)), 1200)
    assert np.isnan(drawn).sum() == 1
    assert np.isnan(drawn[50])


def test_no_line_is_drawn_where_an_angle_wraps_or_flips():
    angle_deg = np.array([170.0, 179.0, -179.0, -170.0, -60.0, 40.0, 60.0])
    np.testing.assert_array_equal(
        np.isnan(unjumped_deg(angle_deg)), [False, False, True, False, True, True, False]
    )
