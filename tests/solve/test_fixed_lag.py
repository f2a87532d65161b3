"""GTSAM's fixed-lag smoother: each keyframe by what the window had seen, and no further."""

import gtsam
import numpy as np
import pytest

from fgnav.checks import BadInputError, NoSolutionError
from fgnav.graph import keys
from fgnav.graph.build import Layout
from fgnav.graph.custom import residual_factor
from fgnav.graph.types.parameters import Parameters, flight_constant
from fgnav.solve.batch import solve_batch
from fgnav.solve.elimination import Elimination
from fgnav.solve.failures import in_words
from fgnav.solve.fixed_lag import FixedLag, solve_fixed_lag, solve_forward
from tests.solve.flights import flight, part, sigma_ratio, sigmas_apart

# What a window linearises where it predicts, a batch linearises where all is known.
SIGMAS = 0.1
RATIO = 0.02


@pytest.mark.parametrize("gyroscope", [False, True])
def test_window_longer_than_the_flight_gives_the_batch(gyroscope: bool) -> None:
    problem, _ = flight(2.0, gyroscope=gyroscope)
    window, batch = solve_fixed_lag(problem, 10.0), solve_batch(problem)
    assert window.converged
    assert sigmas_apart(batch, window) < SIGMAS
    assert sigma_ratio(batch, window) < RATIO
    assert window.cross is not None
    assert batch.cross is not None
    sigma = np.sqrt(np.einsum("nii->ni", batch.covariance))
    unlike = (window.cross - batch.cross)[:-1] / (sigma[:-1, :, None] * sigma[1:, None, :])
    assert np.abs(unlike).max() < RATIO


@pytest.mark.parametrize("gyroscope", [False, True])
def test_a_block_is_known_from_the_data_up_to_a_lag_after_it(gyroscope: bool) -> None:
    problem, _ = flight(4.0, gyroscope=gyroscope)
    window, left = FixedLag(1.0), []
    for row in range(len(problem.t_s)):
        known = window.update(problem, row)
        if known is not None:
            left.append((row, known))
    assert [(row, len(known.covariance)) for row, known in left] == [(20, 11), (30, 10), (40, 10)]
    for row, known in left:
        seen = solve_batch(part(problem, 0, row))
        rows = np.arange(row - 9 - len(known.covariance), row - 9)
        assert sigmas_apart(seen[rows], known) < SIGMAS
        assert sigma_ratio(seen[rows], known) < RATIO
    assert len(window) == 10


@pytest.mark.parametrize("gyroscope", [False, True])
def test_forward_is_the_batch_of_all_before(gyroscope: bool) -> None:
    problem, _ = flight(2.0, gyroscope=gyroscope)
    forward = solve_forward(problem, 1.0)
    assert forward.cross is None
    for row in (6, 12, 20):
        seen = solve_batch(part(problem, 0, row))
        newest = np.array([row])
        assert sigmas_apart(seen[newest], forward[newest]) < SIGMAS
        assert sigma_ratio(seen[newest], forward[newest]) < RATIO


def test_constants_of_two_sizes_change_nothing() -> None:
    problem, _ = flight(4.0)
    offset = flight_constant("offset", ("z",), "m", 1.0)  # no measurement knows of it
    other, _ = flight(4.0, extra=(offset,))
    one, two = solve_fixed_lag(problem, 1.0), solve_fixed_lag(other, 1.0)
    assert two.converged
    assert sigmas_apart(one, two) < 0.02
    np.testing.assert_allclose(two.constant_covariance[:, 3, 3], 1.0, rtol=1e-9)
    np.testing.assert_allclose(two.constant_cross[:, :, 3], 0.0, atol=1e-9)


def test_keyframes_a_second_apart_are_relinearised_at_once() -> None:
    problem, _ = flight(8.0, every=10)
    window, batch = solve_fixed_lag(problem, 20.0), solve_batch(problem)
    assert window.converged
    assert sigmas_apart(batch, window) < SIGMAS


@pytest.fixture
def eliminated(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many variables each update of ISAM2 eliminates."""
    update, variables = gtsam.ISAM2.update, list[int]()

    def counted(isam: gtsam.ISAM2, *given: object) -> gtsam.ISAM2Result:
        result = update(isam, *given)
        variables.append(result.getVariablesReeliminated())
        return result

    monkeypatch.setattr(gtsam.ISAM2, "update", counted)
    return variables


def test_an_update_eliminates_what_enters_and_not_the_whole_window(eliminated: list[int]) -> None:
    """A second of keyframes enters, that before it is linearised anew; of eight, two."""
    problem, _ = flight(8.0)
    window = FixedLag(20.0)
    for row in range(len(problem.t_s)):
        window.update(problem, row)
    assert len(eliminated) == 8
    assert max(eliminated) <= 3 * 23 + 2


def test_kept_linearisation_stays_at_the_start() -> None:
    problem, _ = flight(3.0, gyroscope=True)
    window = FixedLag(10.0, keep_linearisation=True)
    for row in range(len(problem.t_s)):
        window.update(problem, row)
    known = window.flush()
    assert known.converged
    assert known.updates == 3  # one at each second, none to relinearise


def test_a_factor_of_ones_own_enters_with_its_last_keyframe() -> None:
    problem, truth = flight(3.0)
    noise = gtsam.noiseModel.Isotropic.Sigma(3, 0.01)
    own = [gtsam.GPSFactor(keys.pose(k), truth.p_n_m[k], noise) for k in range(len(problem.t_s))]
    near = gtsam.Rot3(truth.R_nb[3].T @ truth.R_nb[9])
    step = truth.R_nb[3].T @ (truth.p_n_m[9] - truth.p_n_m[3])
    tight = gtsam.noiseModel.Isotropic.Sigma(6, 1e-3)
    own.append(gtsam.BetweenFactorPose3(keys.pose(3), keys.pose(9), gtsam.Pose3(near, step), tight))
    window, batch = solve_fixed_lag(problem, 1.0, custom=own), solve_batch(problem, custom=own)
    assert np.abs(truth.steps_to(window.states)[:, 3:6]).max() < 0.03
    assert sigmas_apart(batch[np.arange(11, 31)], window[np.arange(11, 31)]) < 3.0
    assert batch.converged


@pytest.mark.parametrize("gyroscope", [False, True])
def test_a_constant_that_all_keyframes_meet_has_no_more_eliminated_anew(
    eliminated: list[int], gyroscope: bool
) -> None:
    """Keyframes that are new touch the root of ISAM2's tree, what leaves its leaves."""
    problem, truth = flight(6.0, gyroscope=gyroscope)
    offset = flight_constant("offset", ("x", "y", "z"), "m", 1.0)
    problem = problem.with_constants((offset,))
    shared, noise = Layout.of(problem).constant_keys[-1], gtsam.noiseModel.Isotropic.Sigma(3, 0.1)
    own = [
        residual_factor(
            "place",
            [keys.pose(k), shared],
            lambda x, c, k=k: x.translation() + c - truth.p_n_m[k],
            noise,
            jacobian=lambda x, _: (np.hstack([np.zeros((3, 3)), x.rotation().matrix()]), np.eye(3)),
        )
        for k in range(len(problem.t_s))
    ]
    counts = []
    for factors in ((), own):
        eliminated.clear()
        window = FixedLag(2.0, 0.0, keep_linearisation=True)
        for row in range(len(problem.t_s)):
            window.update(problem, row, [one.factor for one in factors[row : row + 1]])
        counts.append(max(eliminated[len(eliminated) // 2 :]))  # of 20 to 30 keyframes
    # A new keyframe, and what is eliminated anew, counted twice: two keyframes and the constants.
    old = 2 * 3 + len(problem.constants.parts)
    assert counts == [3 + 2 * (old - 1), 3 + 2 * old]


def test_a_factor_that_reaches_behind_the_window_is_refused_by_name() -> None:
    problem, _ = flight(5.0)
    far = gtsam.BetweenFactorPose3(
        keys.pose(2), keys.pose(45), gtsam.Pose3(), gtsam.noiseModel.Isotropic.Sigma(6, 1.0)
    )
    with pytest.raises(BadInputError, match=r"'BetweenFactorPose3': joins keyframes 4.30 s apart"):
        solve_fixed_lag(problem, 1.0, custom=[far])
    assert solve_batch(problem, custom=[far]).states.R_nb.shape == (51, 3, 3)


@pytest.mark.parametrize(
    "key", [keys.pose(99), keys.imu_bias(3), keys.constant(1), gtsam.symbol("q", 3)]
)
def test_a_factor_of_an_unknown_variable_is_refused(key: int) -> None:
    problem, _ = flight(1.0)
    factor = gtsam.PriorFactorVector(key, np.zeros(3), gtsam.noiseModel.Unit.Create(3))
    with pytest.raises(BadInputError, match=r"'PriorFactorVector': \w+ is no variable"):
        solve_fixed_lag(problem, 1.0, custom=[factor])


def test_an_open_state_is_named_with_its_time() -> None:
    layout = Layout(gyroscope=True, constants=Parameters())
    x, v, b = layout.keyframe(0)
    tight = gtsam.noiseModel.Unit.Create
    half = gtsam.noiseModel.Diagonal.Precisions(np.array([1.0, 1.0, 0.0]))
    factors = [
        gtsam.PriorFactorPose3(x, gtsam.Pose3(), tight(6)),
        gtsam.PriorFactorVector(v, np.zeros(3), half),
        gtsam.PriorFactorConstantBias(b, gtsam.imuBias.ConstantBias(), tight(6)),
    ]
    values = gtsam.Values()
    values.insert(x, gtsam.Pose3())
    values.insert(v, np.zeros(3))
    values.insert(b, gtsam.imuBias.ConstantBias())
    eliminated = Elimination(layout, {0: 12.3}.__getitem__)
    eliminated.append([factor.linearize(values) for factor in factors])
    eliminated.solve()
    with pytest.raises(NoSolutionError, match=r"velocity: the data do not determine it at 12.30 s"):
        eliminated.marginals()


def test_a_failure_of_gtsam_is_put_in_words() -> None:
    layout = Layout(
        gyroscope=False, constants=Parameters((flight_constant("landmark", ("n",), "m", 1.0),))
    )
    text = "Indeterminate linear system detected while working near variable 1 (Symbol: {}).\n"
    for symbol, words in {
        "v7": "velocity: the data do not determine it at 0.70 s",
        "x2": "attitude: the data do not determine it at 0.20 s",
        "c0": "landmark: the data do not determine it",
        "a4": "ambiguities of phase: the data do not determine them",
    }.items():
        error = in_words(
            RuntimeError(text.format(symbol)), layout.width, layout.constants, lambda k: k / 10
        )
        assert str(error) == words


def test_a_window_without_a_keyframe_has_nothing_to_say() -> None:
    with pytest.raises(NoSolutionError, match="window: it has no keyframe"):
        FixedLag(1.0).latest()


def test_without_a_lag_every_block_leaves_at_once() -> None:
    problem, _ = flight(2.0)
    window = FixedLag(0.0)
    for row in range(len(problem.t_s)):
        window.update(problem, row)
    with pytest.raises(NoSolutionError, match="window: no keyframe is left"):
        window.flush()
    assert len(solve_fixed_lag(problem, 0.0).covariance) == len(problem.t_s)


def test_an_exception_in_a_factor_of_ones_own_arrives_as_it_is() -> None:
    problem, _ = flight(1.0)

    def fails(*_: object) -> np.ndarray:
        raise BadInputError("rangefinder: no range")

    factor = gtsam.CustomFactor(gtsam.noiseModel.Unit.Create(1), [keys.pose(3)], fails)
    with pytest.raises(BadInputError, match="rangefinder: no range"):
        solve_fixed_lag(problem, 1.0, custom=[factor])
