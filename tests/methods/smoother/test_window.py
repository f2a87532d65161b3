import dataclasses

import numpy as np
import pytest

from fgnav.methods.smoother.batch import solve_batch
from fgnav.methods.smoother.keyframes import ArrayForm, Timed
from fgnav.methods.smoother.window import Window, solution_of, solve_forward, solve_window

from .flights import attitude_errors_rad, euler_rmse_deg, turning


@pytest.fixture(scope="module")
def case():
    return turning(np.random.default_rng(0), span_s=20.0)


@pytest.fixture(scope="module")
def window(case):
    return solve_window(case.keyframes, 2.0)


def one(keyframes, row):
    """A keyframe with the one before it, as a stream would have them."""
    rows = np.array([max(row - 1, 0), row]) if row else np.array([0])
    pre, p, v, a = keyframes.preintegrate, keyframes.position, keyframes.velocity, keyframes.array
    steps = pre.increments
    part = slice(steps.first[rows[0]], steps.first[rows[-1]])
    return dataclasses.replace(
        keyframes,
        **{name: getattr(keyframes, name)[rows] for name in ("t_s", "R_nb", "p_n_m", "v_n_mps")},
        slot=keyframes.slot[rows],
        gravity_n_mps2=keyframes.gravity_n_mps2[rows],
        array=ArrayForm(there=a.there[rows], root=a.root[rows], minimum=a.minimum[rows]),
        position=Timed(value=p.value[rows], covariance=p.covariance[rows], arm_b_m=p.arm_b_m),
        velocity=Timed(value=v.value[rows], covariance=v.covariance[rows], arm_b_m=v.arm_b_m),
        preintegrate=dataclasses.replace(
            pre,
            gravity_n_mps2=pre.gravity_n_mps2[rows],
            increments=dataclasses.replace(
                steps,
                step_s=steps.step_s[rows[:-1]],
                first=steps.first[rows] - steps.first[rows[0]],
                f_b_mps2=steps.f_b_mps2[part],
                w_b_radps=steps.w_b_radps[part],
            ),
        ),
    )


def test_keyframes_given_one_by_one_end_where_the_whole_flight_ends_bit_for_bit(case, window):
    streamed, taken = Window(2.0), []
    for row in range(len(case.keyframes.t_s)):
        keyframes = one(case.keyframes, row)
        left = streamed.update(keyframes, len(keyframes.t_s) - 1)
        taken += [left] if left is not None else []
    found = solution_of([*taken, streamed.rest()])
    for name in ("R_nb", "p_n_m", "v_n_mps", "slot", "covariance", "cross"):
        assert getattr(found, name).tobytes() == getattr(window, name).tobytes(), name


def test_the_window_forgets(case):
    window, held, rows = Window(1.0), [], []
    for row in range(len(case.keyframes.t_s)):
        window.update(case.keyframes, row)
        held.append(len(window))
        rows.append(len(window._rows.t_s))
    assert max(held) <= 21
    assert max(rows) <= 2 * 21 + 2


def test_forward_is_less_than_the_window_and_ends_where_it_ends(case, window):
    forward = solve_forward(case.keyframes, 2.0)
    sigma, smoothed = (np.sqrt(np.einsum("nii->ni", s.covariance)) for s in (forward, window))
    assert (smoothed[:, :9] < 1.01 * sigma[:, :9]).all()
    assert sigma[50:150, 0].mean() > 1.5 * smoothed[50:150, 0].mean()
    np.testing.assert_allclose(forward.covariance[-1], window.covariance[-1], rtol=1e-9)
    np.testing.assert_allclose(forward.p_n_m[-1], window.p_n_m[-1], rtol=0, atol=1e-9)
    assert forward.cross is None
    batch = solve_batch(case.keyframes)
    assert euler_rmse_deg(forward.R_nb, case.truth)[0] > euler_rmse_deg(batch.R_nb, case.truth)[0]


def test_a_window_started_without_rates_finds_them(case):
    keyframes = dataclasses.replace(case.keyframes, slot=np.zeros_like(case.keyframes.slot))
    found = solve_window(keyframes, 2.0)
    assert found.converged
    ratio = euler_rmse_deg(found.R_nb, case.truth) / euler_rmse_deg(
        solve_batch(case.keyframes).R_nb, case.truth
    )
    assert (ratio < 1.1).all()


def test_a_window_that_stays_linearised_at_the_batch_ends_as_the_batch_does(case):
    found = solve_batch(case.keyframes)
    states = {name: getattr(found, name) for name in ("R_nb", "p_n_m", "v_n_mps", "slot")}
    keyframes = dataclasses.replace(case.keyframes, **states)
    whole, batch = solve_window(keyframes, 100.0, anew=False), solve_batch(keyframes)
    assert whole.converged
    sigma = np.sqrt(np.einsum("nii->ni", batch.covariance))
    assert (np.abs(attitude_errors_rad(whole.R_nb, batch)) < 0.01 * sigma[:, :3]).all()
    assert (np.abs(whole.slot - batch.slot) < 0.01 * sigma[:, 9:]).all()
    scale = sigma[:, :, None] * sigma[:, None, :]
    np.testing.assert_allclose(whole.covariance / scale, batch.covariance / scale, atol=1e-3)
