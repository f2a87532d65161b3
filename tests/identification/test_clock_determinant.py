"""What determinants tell of a clock: against the likelihood itself, and by flights."""

import numpy as np

from fgnav.frontend.calibration_request import calibration_requests
from fgnav.frontend.problem import build_problem
from fgnav.frontend.settings import ProblemSettings
from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import from_euler, log, transpose
from fgnav.graph.delayed import CLOCK_OFFSET
from fgnav.graph.types.constants import Constants, flight_constant
from fgnav.identification.likelihood.bent_clock import determinant_of
from fgnav.identification.likelihood.linear_chain import LinearChain
from fgnav.integers.resolvers.truth import Truth
from fgnav.methods.smoother import Batch
from fgnav.solve.chain import solve_batch
from fgnav.types.flight import Antenna, Fixes, Flight, Imu

# Of a quadrotor that vibrates, under RTK.
LOUD_MPS2_PER_SQRT_HZ, POSITION_M, GYROSCOPE_RADPS_PER_SQRT_HZ = 0.3, 0.01, 2e-4
_STEP_S, _EVERY = 0.01, 10


def loud(seed, span_s=30.0, late_s=0.0):
    """Swerves of 4 m/s2, positions to a centimetre ten times a second, a unit whose tags are late.

    Its accelerometer is loud.
    """
    rng = np.random.default_rng(seed)
    origin = Origin(latitude_rad=0.7, longitude_rad=0.3, height_m=100.0)
    t_s = np.arange(0.0, span_s + _STEP_S / 2, _STEP_S)
    n = len(t_s)
    rates = np.array([0.7, 1.1, 1.6])[:, None]  # rad/s

    def swings(size):
        phase = rng.uniform(0, 2 * np.pi, (3, 1))
        return size * np.sin(rates * t_s + phase).sum(axis=0)

    p_n_m = np.stack([swings(2.0), swings(2.0), swings(0.3)], axis=1)
    R_nb = from_euler(swings(0.1), swings(0.1), rng.uniform(-3, 3) + swings(0.2))
    v_n_mps = np.gradient(p_n_m, t_s, axis=0)
    earth = origin.earth_rate_n_radps
    f_n = np.gradient(v_n_mps, t_s, axis=0) - origin.gravity_n_mps2(p_n_m)
    f_b = np.einsum("nji,nj->ni", R_nb, f_n + 2 * np.cross(earth, v_n_mps))
    turns = log(transpose(R_nb[:-2]) @ R_nb[2:]) / (2 * _STEP_S)
    w_b = np.vstack([turns[:1], turns, turns[-1:]]) + np.einsum("nji,j->ni", R_nb, earth)
    f_b += rng.normal(0, LOUD_MPS2_PER_SQRT_HZ / np.sqrt(_STEP_S), (n, 3))
    w_b += rng.normal(0, GYROSCOPE_RADPS_PER_SQRT_HZ / np.sqrt(_STEP_S), (n, 3))
    at = np.arange(0, n, _EVERY)[1:-1]
    return Flight(
        name="loud",
        start_gps_s=1.3e9,
        origin=origin,
        antennas=(Antenna(name="a1", position_b_m=np.zeros(3)),),
        imu=Imu(
            t_s=t_s + late_s,
            f_b_mps2=f_b,
            w_b_radps=w_b,
            accelerometer_noise_mps2_per_sqrt_hz=LOUD_MPS2_PER_SQRT_HZ,
            accelerometer_bias_mps2=0.05,
            accelerometer_bias_walk_mps2_per_sqrt_s=1e-5,
            gyroscope_noise_radps_per_sqrt_hz=GYROSCOPE_RADPS_PER_SQRT_HZ,
            gyroscope_bias_radps=0.005,
            gyroscope_bias_walk_radps_per_sqrt_s=1e-6,
        ),
        fixes=Fixes(
            t_s=t_s[at],
            antenna="a1",
            p_n_m=p_n_m[at] + rng.normal(0, POSITION_M, (len(at), 3)),
            v_n_mps=None,
            position_sigma_m=np.full((len(at), 3), POSITION_M),
            velocity_sigma_mps=None,
        ),
    )


def test_it_is_the_curvature_of_the_log_determinant():
    """Of the states' information, the clock held: second differences over 2 ms."""
    words = calibration_requests(["clock=1e-6"])
    settings = ProblemSettings(resolver=Truth(), calibration=words, noise="stated")
    prepared = build_problem(loud(1), settings)
    problem = prepared.problem
    states = solve_batch(problem).states
    column, parts = problem.constants.column(CLOCK_OFFSET), problem.motion.noise_parts()

    def log_determinant(offset_s):
        constants = states.constants.copy()
        constants[column] = offset_s
        at = states._replace(constants=constants)
        score = LinearChain.of(problem, at, parts, ()).score(np.zeros(len(parts.names)))
        return -2 * score.log_likelihood - (score.cost - score.promised)

    step_s = 2e-3
    ends = [log_determinant(offset_s) for offset_s in (-step_s, 0.0, step_s)]
    curvature = (ends[0] - 2 * ends[1] + ends[2]) / step_s**2 / 2
    assert abs(determinant_of(prepared).added[0] / curvature - 1) < 0.05


def test_a_clock_beside_a_loud_accelerometer_is_within_its_sigma():
    """The joint minimum alone is 60 to 130 ms off, on either side, at a stated sigma of 6."""
    squares = []
    for seed, late_s in ((20_101, 0.0), (20_102, 0.06), (20_103, -0.06), (20_104, 0.03)):
        estimate = Batch(estimate=("clock",), solver="chain")(loud(seed, late_s=late_s))
        clock = next(one for one in estimate.constants if one.name == CLOCK_OFFSET)
        squares.append((clock.value[0] + late_s) ** 2 / clock.covariance[0, 0])
    assert sum(squares) < 18.5  # chi-square of four, 1 in 1,000


def test_what_is_no_information_of_a_flight_is_taken_off_its_covariance():
    """Of a constant known to 1 beside another: 4 added about zero and an excess of 3."""
    added, excess, stated = 4.0, 3.0, 1e-2
    parts = (flight_constant("x", ("x",), "m", 1.0), flight_constant("o", ("o",), "s", 10.0))
    constants = Constants((parts[0], parts[1].informed(added, excess)))
    of_flight = 5.0  # of o once x is integrated out, in the solution
    joint = np.array([[2.0, 0.5], [0.5, of_flight + 0.5**2 / 2.0]])
    solved = np.linalg.inv(joint + np.diag([0.0, added + stated]))[None]
    columns, G = constants.surplus(solved)
    X = solved[:, :, columns]
    known = stated + (of_flight - excess) ** 2 / of_flight
    expected = np.linalg.inv(np.array([[2.0, 0.5], [0.5, known + 0.5**2 / 2.0]]))
    np.testing.assert_allclose((solved + X @ G @ X.swapaxes(1, 2))[0], expected, rtol=1e-9)
