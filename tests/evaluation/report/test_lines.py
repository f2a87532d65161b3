import numpy as np

from fgnav.evaluation.report.lines import drawable


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
