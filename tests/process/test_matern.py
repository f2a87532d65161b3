from itertools import product

import numpy as np
import pytest
from scipy.linalg import expm

from fgnav.graph.types.states import DERIVATIVE_SCALE_S
from fgnav.process import matern_kernel
from fgnav.process.matern import (
    integral,
    intervals,
    noise_factor,
    poles,
    shape,
    stationary,
    transition,
)

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


MATERN = [(T_s, tuple(poles(length_s))) for T_s, length_s in PAIRS]
SWINGS = [  # real pole; decay and frequency of the pair
    (0.1, (2.6, 0.07, 1.1)),
    (1.0, (7.0, 0.07, 1.0)),
    (0.1, (0.8, 0.4, 5.0)),
    (15.0, (0.3, 0.05, 2.0)),
    (2.0, (1.0, 1.2, 0.4)),
    (0.05, (0.1, 40.0, 3.0)),
    (0.3, (1.0, 1.0, 1e-9)),
]
ALL = [*MATERN, *SWINGS]


def generator(own):
    k, z, w = own
    c0, c1, c2 = k * (z * z + w * w), z * z + w * w + 2 * z * k, 2 * z + k
    A = np.array([[0, 1, 0], [0, 0, 1], [-c0, -c1, -c2]])
    return SCALE @ A @ np.linalg.inv(SCALE)


def in_two_hundred_digits(T_s, own):
    """The noise factor by mpmath, its integrals term by term: what cancels does not matter."""
    with mpmath.workdps(200):
        k, z, w = (mpmath.mpf(float(x)) for x in own)
        z, w = (z + mpmath.mpf(10) ** -18, w + mpmath.mpf(10) ** -18) if w == 0 else (z, w)
        roots = [-k, mpmath.mpc(-z, w), mpmath.mpc(-z, -w)]
        shares = [1 / mpmath.fprod(p - other for other in roots if other is not p) for p in roots]
        pair = z * z + w * w
        c0, c1, c2 = k * pair, pair + 2 * z * k, 2 * z + k
        q = 2 * c0 * (c1 * c2 - c0) / c2
        # Impulse responses are sums of exponentials: of the integral, and of its derivatives.
        rates, terms = [mpmath.mpf(0), *roots], list(zip(shares, roots, strict=True))
        responses = [[-mpmath.fsum(a / p for a, p in terms), *(a / p for a, p in terms)]]
        for i in range(3):
            scale = mpmath.mpf(DERIVATIVE_SCALE_S) ** i
            responses.append([mpmath.mpf(0), *(scale * a * p**i for a, p in terms)])
        end = mpmath.mpf(T_s)
        sums = [x + y for x, y in product(rates, rates)]
        over = [(mpmath.exp(x * end) - 1) / x if x else end for x in sums]
        Q = mpmath.matrix(4, 4)
        for i in range(4):
            for j in range(4):
                weights = [a * b for a, b in product(responses[i], responses[j])]
                Q[i, j] = q * mpmath.re(mpmath.fdot(weights, over))
        L = mpmath.cholesky(Q)
        return np.array([[float(L[i, j]) for j in range(4)] for i in range(4)])


def test_derivatives_are_scaled_as_those_of_the_states():
    assert matern_kernel.DERIVATIVE_SCALE_S == DERIVATIVE_SCALE_S


@pytest.mark.parametrize(("T_s", "own"), [*SWINGS, *MATERN[1:7]])
def test_transition_is_the_exponential_of_the_generator(T_s, own):
    np.testing.assert_allclose(
        transition(T_s, own), expm(generator(own) * T_s), rtol=1e-10, atol=1e-14
    )


def test_slope_of_the_integral_is_the_first_row_of_the_transition():
    h, own = 1e-5, poles(0.7)
    slope = (integral(0.4 + h, own) - integral(0.4 - h, own)) / (2 * h)
    np.testing.assert_allclose(slope, transition(0.4, own)[0], rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("length_s", [0.05, 0.5, 5.0, 60.0])
def test_stationary_covariance_solves_the_lyapunov_equation(length_s):
    own, k = poles(length_s), np.sqrt(5) / length_s
    A, P = generator(own), stationary(own)
    Q = np.zeros((3, 3))
    Q[2, 2] = 16 / 3 * k**5 * DERIVATIVE_SCALE_S**4
    np.testing.assert_allclose(A @ P + P @ A.T + Q, 0, atol=1e-12 * max(1, Q[2, 2]))


@pytest.mark.parametrize(("T_s", "own"), ALL)
def test_noise_factor_equals_that_of_two_hundred_digits(T_s, own):
    L = noise_factor(T_s, own)
    assert (np.diag(L) > 0).all()
    reference = in_two_hundred_digits(T_s, own)
    size = np.linalg.norm(reference, axis=1)
    assert np.abs((L - reference) / size[:, None]).max() < 1e-9
    np.testing.assert_allclose(np.diag(L), np.diag(reference), rtol=1e-9)


def test_long_interval_turns_as_a_random_walk_does():
    # the variance of the integral grows by twice the integral of the correlation, 16 / (3 k)
    k, T_s = np.sqrt(5) / 0.05, 60.0
    assert noise_factor(T_s, poles(0.05))[0, 0] ** 2 == pytest.approx(16 / 3 / k * T_s, rel=0.01)


def test_intervals_are_those_of_single_functions_and_whiten_their_noise():
    T_s = np.array([0.1, 0.25, 0.1 + 1e-12, 2.0])
    own = poles(np.array([1.0, 1.0, 1.0, 30.0]))
    own[3, 1:] = 0.2, 3.0
    of = intervals(T_s, own)
    for k in range(4):
        np.testing.assert_allclose(of.F[k], transition(T_s[k], own[k]), rtol=1e-9)
        np.testing.assert_allclose(of.H[k], integral(T_s[k], own[k]), rtol=1e-9)
        np.testing.assert_allclose(of.W[k] @ noise_factor(T_s[k], own[k]), np.eye(4), atol=1e-7)
    np.testing.assert_array_equal(of.W[0], of.W[2])


def test_a_shape_is_that_of_its_poles():
    given = np.array([0.3, 2.0]), np.array([0.5, 4.0]), np.array([1.0, 0.2])
    np.testing.assert_allclose(np.stack(shape(poles(*given))), np.stack(given), rtol=1e-12)
