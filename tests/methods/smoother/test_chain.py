import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import B, V, X
from numpy.testing import assert_allclose

from fgnav.checks import NoSolutionError
from fgnav.methods.smoother import chain_kernel as kernel
from fgnav.methods.smoother.chain import STATE, Chain, OpenStateError
from fgnav.methods.smoother.chain_rows_kernel import eliminate_rows
from fgnav.methods.smoother.graph import State, enter, link, motion, priors

from .flights import turning


def random_chain(n, border, rng):
    """A chain of random links, and its dense normal equations: states in order, border last."""
    chain, joint = Chain.empty(n, border), 2 * STATE + border
    size = n * STATE + border
    H, g, f = np.zeros((size, size)), np.zeros(size), 0.0
    for k in range(n):
        J, b = rng.normal(size=(2, joint + 5, joint))[0], rng.normal(size=joint + 5)
        if k == 0:
            J[:, :STATE] = 0.0
        augmented = np.column_stack([J, b])
        chain.enter(k, augmented.T @ augmented, np.arange(joint + 1))
        at = np.r_[(k - 1) * STATE : (k + 1) * STATE, n * STATE : size]
        used = at >= 0
        H[np.ix_(at[used], at[used])] += (J.T @ J)[np.ix_(used, used)]
        g[at[used]] += (J.T @ b)[used]
        f += b @ b
    return chain, H, g, f


@pytest.mark.parametrize("border", [0, 3])
def test_chain_equals_the_dense_solution(border):
    chain, H, g, f = random_chain(6, border, np.random.default_rng(1))
    chain.begin(0)
    chain.eliminate(0, 5)
    steps, least = chain.step(0, 5)
    x, P = np.linalg.solve(H, g), np.linalg.inv(H)
    assert_allclose(steps[:, :STATE].ravel(), x[: 6 * STATE], rtol=1e-9, atol=1e-12)
    assert_allclose(steps[:, STATE:], np.tile(x[6 * STATE :], (6, 1)), rtol=1e-9, atol=1e-12)
    assert_allclose(least, f - g @ x, rtol=1e-9)
    found = chain.marginals(2, 5)
    for k in range(2, 6):
        here, after = slice(k * STATE, (k + 1) * STATE), slice((k + 1) * STATE, (k + 2) * STATE)
        assert_allclose(found.covariance[k - 2], P[here, here], rtol=1e-9, atol=1e-12)
        if k < 5:
            assert_allclose(found.cross[k - 2], P[here, after], rtol=1e-9, atol=1e-12)


def test_a_state_that_nothing_determines_is_named():
    chain, _, _, _ = random_chain(3, 0, np.random.default_rng(2))
    chain.link[1, :STATE], chain.link[1, :, :STATE] = 0.0, 0.0
    chain.link[0] = 0.0
    chain.begin(0)
    with pytest.raises(NoSolutionError, match=r"attitude: the data do not .* at keyframe 0"):
        chain.eliminate(0, 2)
    chain.message[2] = 0.0
    with pytest.raises(NoSolutionError, match="do not determine it at keyframe 2"):
        chain.step(2, 2)
    with pytest.raises(NoSolutionError, match="do not determine it at keyframe 2"):
        chain.marginals(2, 2)


@pytest.mark.parametrize(
    ("part", "name"),
    [(0, "attitude"), (3, "position"), (6, "velocity"), (9, "accelerometer bias"), (12, "angular")],
)
def test_the_part_of_a_state_that_is_known_least_has_its_name(part, name):
    information = np.diag(np.repeat([1e4, 1.0, 1e2, 1e4, 1e4], 3))
    information[part, part] = 1e-12
    error = OpenStateError(3, information)
    assert str(error).startswith(name)
    assert str(error.at(4.5)).endswith("do not determine it at 4.50 s")


@pytest.mark.parametrize("border", [0, 3])
def test_elimination_by_rows_equals_that_by_squares(border):
    chain = random_chain(6, border, np.random.default_rng(4))[0]
    chain.begin(0)
    chain.eliminate(0, 5)
    arrays = (chain.message, chain.root, chain.gain)
    squares = [array.copy() for array in arrays]
    assert eliminate_rows(chain.link, *arrays, 0, 5) == -1
    squares[1] = np.tril(squares[1])
    for mine, theirs in zip(arrays, squares, strict=True):
        assert_allclose(mine, theirs, rtol=1e-9, atol=1e-11)


def drifting(n, far):
    """A random walk of fifteen dimensions that begins nowhere, 1e-4 wide from step to step."""
    chain = Chain.empty(n, 0)
    for k in range(n):
        J = np.zeros((STATE, 2 * STATE + 1))
        J[:, STATE : 2 * STATE] = np.eye(STATE) * (1e4 if k else 1 / far)
        J[:, :STATE] = -1e4 * np.eye(STATE) * (k > 0)
        chain.enter(k, J.T @ J, np.arange(2 * STATE + 1))
    chain.begin(0)
    return chain


def test_what_squares_lose_rows_keep():
    """Sixteen digits do not hold 1e8 and 1e-10 beside each other; variances just add up."""
    chain = drifting(50, 1e5)
    arrays = (chain.message, chain.root, chain.gain)
    kernel.eliminate(chain.link, *arrays, 0, 49)
    assert abs(chain.message[49, 0, 0] * 1e10 - 1) > 0.5  # nothing of it is left
    assert eliminate_rows(chain.link, *arrays, 0, 49) == -1
    assert_allclose(chain.message[49, :STATE, :STATE] * 1e10, np.eye(STATE), atol=1e-3)


def test_a_chain_that_squares_cannot_solve_is_solved_by_rows():
    chain = drifting(50, 1e6)
    chain.eliminate(0, 49)
    steps, _ = chain.step(0, 49)
    assert_allclose(steps, 0, atol=1e-3)
    sigma = np.sqrt(np.einsum("nii->ni", chain.marginals(0, 49).covariance))
    assert_allclose(sigma, 1e6, rtol=0.01)


def test_chain_of_a_flight_equals_gtsam_marginals():
    keyframes = turning(np.random.default_rng(3), span_s=3.0).keyframes
    n, values, whole = len(keyframes.t_s), gtsam.Values(), gtsam.NonlinearFactorGraph()
    chain = Chain.empty(n, 0)
    for k in range(n):
        State.start(keyframes, k).insert(values, k)
    for k in range(n):
        before = (motion(keyframes, k, keyframes.slot[k - 1], k),) if k else priors(keyframes)
        graph = link(keyframes, k, before)
        enter(chain, k, graph, values, first=k == 0)
        whole.push_back(graph)
    chain.begin(0)
    chain.eliminate(0, n - 1)
    found, steps = chain.marginals(0, n - 1), chain.step(0, n - 1)[0]
    theirs, step = gtsam.Marginals(whole, values), whole.linearize(values).optimize()
    for k in (0, 7, n - 1):
        sigma = np.sqrt(np.diag(found.covariance[k]))
        for symbol, part in ((X, slice(0, 6)), (V, slice(6, 9)), (B, slice(9, 15))):
            expected = theirs.marginalCovariance(symbol(k))
            scale = np.outer(sigma[part], sigma[part])
            assert_allclose(found.covariance[k][part, part] / scale, expected / scale, atol=1e-7)
            moved = step.at(symbol(k))
            assert_allclose(steps[k][part] / sigma[part], moved / sigma[part], atol=1e-5)
