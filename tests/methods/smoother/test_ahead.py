import dataclasses

import numpy as np

from fgnav.methods.smoother.ahead import foretelling
from fgnav.methods.smoother.window import solve_forward

from .flights import attitude_errors_rad, nees, turning


def test_a_filter_on_a_sine_states_what_it_errs():
    case = turning(np.random.default_rng(0), span_s=30.0)
    smoothing, filtering = (
        solve_forward(k, 1.0) for k in (case.keyframes, foretelling(case.keyframes))
    )
    told = [
        nees(attitude_errors_rad(s.R_nb, case.truth), s.covariance[:, :3, :3])[20:].mean()
        for s in (smoothing, filtering)
    ]
    assert told[0] > 5  # with the smoother's intensity it lags behind
    assert 2 < told[1] < 4


def test_a_gyroscope_or_no_array_leaves_keyframes_as_they_are():
    gyro = turning(np.random.default_rng(0), span_s=2.0, gyro=True).keyframes
    assert foretelling(gyro) is gyro
    case = turning(np.random.default_rng(0), span_s=2.0).keyframes
    array = dataclasses.replace(case.array, there=np.zeros(len(case.t_s), dtype=bool))
    bare = dataclasses.replace(case, array=array)
    assert foretelling(bare) is bare
