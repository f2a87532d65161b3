import numpy as np
import pytest
from scipy.linalg import expm

from fgnav.graph.types.states import DERIVATIVE_SCALE_S
from fgnav.process import matern_kernel
from fgnav.process.matern import integral, intervals, noise_factor, stationary, transition

mpmath = pytest.importorskip("mpmath")

SCALE = np.diag(DERIVATIVE_SCALE_S ** np.arange(3.0))
PAIRS = [
    (0.001, 0.05),
    (0.001, 60.0),
    (0.1, 0.05),
    (0.1, 1.0),
    (0.1, 60.0),
    (1.0, 3.0),
    (7.0, 0.3),
    (60.0, 0.05),
    (60.0, 60.0),
]


def generator(length_s):
    k = np.sqrt(5) / length_s
    A = np.array([[0, 1, 0], [0, 0, 1], [-(k**3), -3 * k**2, -3 * k]])
    return SCALE @ A @ np.linalg.inv(SCALE)


def by_quadrature(T_s, length_s):
    """The noise covariance by mpmath: 40 digits, so what cancels does not matter."""
    with mpmath.workdps(40):
        k = mpmath.sqrt(5) / mpmath.mpf(length_s)
        c = [1 / k, 1, k * DERIVATIVE_SCALE_S, (k * DERIVATIVE_SCALE_S) ** 2]

        def response(i, s):
            decay = mpmath.exp(-s)
            return (
                1 - decay * (1 + s + s * s / 2),
                decay * s * s / 2,
                decay * (s - s * s / 2),
                decay * (1 - 2 * s + s * s / 2),
            )[i]

        end = k * mpmath.mpf(T_s)
        cuts = [x for x in (0, 1, 3, 8, 20, 50, 100) if x < end] + [end]
        Q = mpmath.matrix(4, 4)
        for i in range(4):
            for j in range(i + 1):
                total = mpmath.quad(
                    lambda s, i=i, j=j: response(i, s) * response(j, s), cuts, maxdegree=7
                )
                Q[i, j] = Q[j, i] = mpmath.mpf(16) / 3 * total * c[i] * c[j]
        L = mpmath.cholesky(Q)
        return np.array([[float(L[i, j]) for j in range(4)] for i in range(4)])


def test_derivatives_are_scaled_as_those_of_the_states():
    assert matern_kernel.DERIVATIVE_SCALE_S == DERIVATIVE_SCALE_S


@pytest.mark.parametrize(("T_s", "length_s"), [(0.1, 1.0), (1.0, 3.0), (0.5, 0.3), (0.001, 60.0)])
def test_transition_is_the_exponential_of_the_generator(T_s, length_s):
    np.testing.assert_allclose(
        transition(T_s, length_s), expm(generator(length_s) * T_s), rtol=1e-10, atol=1e-14
    )


@pytest.mark.parametrize(("T_s", "length_s"), PAIRS)
def test_transitions_over_halves_make_the_whole(T_s, length_s):
    half = transition(T_s / 2, length_s)
    whole = transition(T_s, length_s)
    np.testing.assert_allclose(half @ half, whole, rtol=1e-9, atol=1e-12 * np.abs(whole).max())


@pytest.mark.parametrize(("T_s", "length_s"), PAIRS)
def test_integral_over_halves_makes_the_whole(T_s, length_s):
    half = integral(T_s / 2, length_s)
    np.testing.assert_allclose(
        half + half @ transition(T_s / 2, length_s), integral(T_s, length_s), rtol=1e-10
    )


def test_slope_of_the_integral_is_the_first_row_of_the_transition():
    h = 1e-5
    slope = (integral(0.4 + h, 0.7) - integral(0.4 - h, 0.7)) / (2 * h)
    np.testing.assert_allclose(slope, transition(0.4, 0.7)[0], rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("length_s", [0.05, 0.5, 5.0, 60.0])
def test_stationary_covariance_solves_the_lyapunov_equation(length_s):
    A, P, k = generator(length_s), stationary(length_s), np.sqrt(5) / length_s
    Q = np.zeros((3, 3))
    Q[2, 2] = 16 / 3 * k**5 * DERIVATIVE_SCALE_S**4
    np.testing.assert_allclose(A @ P + P @ A.T + Q, 0, atol=1e-12 * max(1, Q[2, 2]))


@pytest.mark.parametrize(("T_s", "length_s"), [(0.1, 0.05), (0.1, 0.3), (1.0, 3.0), (60.0, 60.0)])
def test_stationary_covariance_stays_what_it_is(T_s, length_s):
    F, L, P = transition(T_s, length_s), noise_factor(T_s, length_s)[1:], stationary(length_s)
    np.testing.assert_allclose(F @ P @ F.T + L @ L.T, P, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize(("T_s", "length_s"), PAIRS)
def test_noise_factor_equals_that_of_forty_digits(T_s, length_s):
    L = noise_factor(T_s, length_s)
    assert (np.diag(L) > 0).all()
    reference = by_quadrature(T_s, length_s)
    size = np.linalg.norm(reference, axis=1)
    assert np.abs((L - reference) / size[:, None]).max() < 1e-9
    np.testing.assert_allclose(np.diag(L), np.diag(reference), rtol=1e-9)


def test_noise_of_two_halves_makes_that_of_the_whole():
    T_s, length_s = 0.2, 0.5
    F, H, L = transition(T_s, length_s), integral(T_s, length_s), noise_factor(T_s, length_s)
    step = np.eye(4)
    step[0, 1:], step[1:, 1:] = H, F
    np.testing.assert_allclose(
        step @ L @ L.T @ step.T + L @ L.T,
        (whole := noise_factor(2 * T_s, length_s)) @ whole.T,
        rtol=1e-9,
    )


def test_long_interval_turns_as_a_random_walk_does():
    # the variance of the integral grows by twice the integral of the correlation, 16 / (3 k)
    k, T_s = np.sqrt(5) / 0.05, 60.0
    assert noise_factor(T_s, 0.05)[0, 0] ** 2 == pytest.approx(16 / 3 / k * T_s, rel=0.01)


def test_intervals_are_those_of_single_functions_and_whiten_their_noise():
    T_s = np.array([0.1, 0.25, 0.1 + 1e-12, 2.0])
    length_s = np.array([1.0, 1.0, 1.0, 30.0])
    of = intervals(T_s, length_s)
    for k in range(4):
        np.testing.assert_allclose(of.F[k], transition(T_s[k], length_s[k]), rtol=1e-9)
        np.testing.assert_allclose(of.H[k], integral(T_s[k], length_s[k]), rtol=1e-9)
        np.testing.assert_allclose(
            of.W[k] @ noise_factor(T_s[k], length_s[k]), np.eye(4), atol=1e-7
        )
    np.testing.assert_array_equal(of.W[0], of.W[2])
