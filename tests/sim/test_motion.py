"""Truth against finite differences, and specific force against an integration in inertial space."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fgnav.geometry.earth import EARTH_RATE_RADPS, Origin
from fgnav.geometry.rotations import exp, log, skew, transpose
from fgnav_sim.motion import Arc, Hold, Motion, Ramp, Rate, Sine, Straight

MM = 1e-3
MADRID = Origin(latitude_rad=np.radians(40.33), longitude_rad=np.radians(-3.88), height_m=700.0)
LEVER_B_M = np.array([0.7, -0.2, 0.4])
MOTIONS = {
    "all angles swing on a climbing arc": Motion(
        path=Arc(climb_mps=5.0, course_deg=30.0),
        roll=Sine(amplitude_deg=45.0, phase_deg=20.0),
        pitch=Sine(amplitude_deg=60.0, rate_radps=1.7, offset_deg=5.0),
        yaw=Sine(amplitude_deg=20.0),
    ),
    "spin while pitch rises": Motion(
        path=Straight(course_deg=120.0, climb_mps=-9.0),
        roll=Rate(rate_degps=1800.0, start_deg=10.0),
        pitch=Ramp(amplitude_deg=30.0),
        yaw=Hold(angle_deg=-75.0),
    ),
    "left arc with turning yaw": Motion(
        path=Arc(left=True, radius_m=300.0), yaw=Rate(rate_degps=-19.0), pitch=Hold(angle_deg=20.0)
    ),
}
T_S = np.linspace(0.05, 14.9, 120)


def derivative(f, t_s, h=1e-4):
    """Central difference of fourth order."""
    return (8 * (f(t_s + h) - f(t_s - h)) - (f(t_s + 2 * h) - f(t_s - 2 * h))) / (12 * h)


@pytest.fixture(params=MOTIONS.values(), ids=MOTIONS.keys())
def motion(request):
    return request.param


@pytest.mark.parametrize(
    "command",
    [
        Hold(angle_deg=7.0),
        Ramp(amplitude_deg=20.0, rise_s=8.0),
        Sine(amplitude_deg=20.0, rate_radps=2.0, phase_deg=33.0, offset_deg=4.0),
        Rate(rate_degps=360.0, start_deg=5.0),
    ],
    ids=lambda c: type(c).__name__,
)
def test_commands_know_their_derivatives(command):
    _, rate, acceleration = command(T_S)
    assert np.allclose(derivative(lambda t: command(t)[0], T_S), rate, rtol=0, atol=1e-8)
    assert np.allclose(derivative(lambda t: command(t)[1], T_S), acceleration, rtol=0, atol=1e-8)


def test_a_ramp_starts_and_ends_at_rest_and_stays_at_its_amplitude():
    angle, rate, acceleration = Ramp(amplitude_deg=20.0)(np.array([0.0, 5.0, 10.0, 50.0]))
    assert np.allclose(np.degrees(angle), [0.0, 10.0, 20.0, 20.0], rtol=0, atol=1e-12)
    assert not rate[[0, 2, 3]].any()
    assert np.allclose(acceleration[[0, 2, 3]], 0.0, rtol=0, atol=1e-12)


def test_angular_acceleration_is_the_derivative_of_angular_rate(motion):
    state = motion(T_S)
    change = derivative(lambda t: motion(t).w_nb_b_radps, T_S)
    assert np.allclose(change, state.alpha_nb_b_radps2, rtol=0, atol=1e-6)


def test_a_point_off_the_origin_moves_as_its_own_position_says(motion):
    p_n_m, v_n_mps, a_n_mps2 = motion(T_S).at(LEVER_B_M)
    assert np.allclose(p_n_m - motion(T_S).p_n_m, motion(T_S).R_nb @ LEVER_B_M, rtol=0, atol=1e-9)
    by_position = derivative(lambda t: motion(t).at(LEVER_B_M)[0], T_S, h=1e-5)
    by_velocity = derivative(lambda t: motion(t).at(LEVER_B_M)[1], T_S, h=1e-5)
    assert np.allclose(by_position, v_n_mps, rtol=0, atol=1e-5)
    assert np.allclose(by_velocity, a_n_mps2, rtol=0, atol=1e-5)


@pytest.mark.parametrize("model", ["wgs84-normal", "j2"])
def test_specific_force_and_rate_integrated_in_inertial_space_return_to_the_truth(model):
    motion = Motion(
        path=Arc(climb_mps=20.0),
        roll=Sine(amplitude_deg=20.0),
        pitch=Sine(amplitude_deg=20.0),
        yaw=Sine(amplitude_deg=20.0),
    )
    end_s = 60.0
    R_in_0 = MADRID.R_ne.T  # inertial axes: those of the Earth at the start

    def to_inertial(t_s, p_e_m):
        return exp(np.array([[0.0, 0.0, EARTH_RATE_RADPS * t_s]]))[0] @ p_e_m

    def place(t_s):
        return to_inertial(t_s, MADRID.to_e(motion(np.array([t_s])).at(LEVER_B_M)[0])[0])

    def change(t_s, y):
        """Free point mass: attitude from the gyroscope, acceleration from force and gravitation."""
        R_ib, p_i_m, v_i_mps = y[:9].reshape(3, 3), y[9:12], y[12:]
        state = motion(np.array([t_s]))
        f_b_mps2 = state.specific_force_b_mps2(MADRID, LEVER_B_M, model)[0]
        back = exp(np.array([[0.0, 0.0, -EARTH_RATE_RADPS * t_s]]))[0]
        p_e_m = back @ p_i_m
        g_e_mps2 = MADRID.gravity_n_mps2(MADRID.to_n(p_e_m[None]), model)[0] @ MADRID.R_ne
        centrifugal_e = EARTH_RATE_RADPS**2 * np.array([p_e_m[0], p_e_m[1], 0.0])
        gravitation_i = back.T @ (g_e_mps2 - centrifugal_e)
        R_dot = R_ib @ skew(state.inertial_rate_b_radps(MADRID))[0]
        return np.concatenate([R_dot.ravel(), v_i_mps, R_ib @ f_b_mps2 + gravitation_i])

    start = motion(np.zeros(1))
    v_start = derivative(lambda t: np.stack([place(s) for s in t]), np.zeros(1), h=1e-2)[0]
    y0 = np.concatenate([(R_in_0 @ start.R_nb[0]).ravel(), place(0.0), v_start])
    y = solve_ivp(change, (0.0, end_s), y0, method="DOP853", rtol=1e-12, atol=1e-9).y[:, -1]

    assert np.linalg.norm(y[9:12] - place(end_s)) < 1.0 * MM
    v_end = derivative(lambda t: np.stack([place(s) for s in t]), np.array([end_s]), h=1e-2)[0]
    assert np.linalg.norm(y[12:] - v_end) < 0.1 * MM
    R_end = exp(np.array([[0.0, 0.0, EARTH_RATE_RADPS * end_s]]))[0] @ R_in_0
    R_ib_end = R_end @ motion(np.array([end_s])).R_nb[0]
    turn = log(transpose(R_ib_end[None]) @ y[:9].reshape(1, 3, 3))
    assert np.linalg.norm(turn) < 1e-8
