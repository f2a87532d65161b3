"""The kernels of links against GTSAM's factors, and against finite differences."""

import dataclasses

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import L, X
from numpy.testing import assert_allclose

from fgnav.checks import NoSolutionError
from fgnav.methods.smoother import links
from fgnav.methods.smoother.batch import solve_batch
from fgnav.methods.smoother.chain import STATE, Chain
from fgnav.methods.smoother.directions import Directions
from fgnav.methods.smoother.graph import State, enter, link, motion, priors
from fgnav.methods.smoother.link_kernel import linearise, move, predict
from fgnav.methods.smoother.motion_factor import preintegrated
from fgnav.rotations import exp, log, transpose

from .flights import turning

LANDMARK_N_M = np.array([2000.0, 300.0, 10.0])


def still_earth(keyframes):
    """GTSAM carries a turning Earth to second order; this far from the truth that would show."""
    preintegrate = dataclasses.replace(keyframes.preintegrate, earth_rate_n_radps=np.zeros(3))
    return dataclasses.replace(keyframes, preintegrate=preintegrate)


@pytest.fixture(scope="module", params=[False, True], ids=["no-gyroscope", "gyroscope"])
def keyframes(request):
    """Everything that can be measured, noisy, with a lever arm; no measurement at all in row 3."""
    rng = np.random.default_rng(0)
    keyframes = still_earth(
        turning(rng, span_s=1.0, amplitude_deg=45, gyro=request.param).keyframes
    )
    n, R_bn = len(keyframes.t_s), transpose(keyframes.R_nb)

    def seen(v_n, sigma_rad):
        """Known five times better about one axis than about another, a new one each time."""
        e_b = np.einsum("nij,nj->ni", R_bn, v_n) + 0.01 * rng.standard_normal((n, 3))
        e_b /= np.linalg.norm(e_b, axis=1, keepdims=True)
        e_b[3] = np.nan
        R = exp(rng.standard_normal((n, 3)))
        covariance = sigma_rad**2 * R @ np.diag([1.0, 25.0, 5.0]) @ transpose(R)
        return Directions.of("some", e_b, covariance)

    def gone(timed, arm_b_m):
        value = timed.value.copy()
        value[3] = np.nan
        partial = np.zeros((n, 3, 3))
        partial[4, 0] = [2.0, -1.0, 0.5]  # one direction only
        return dataclasses.replace(timed, value=value, arm_b_m=arm_b_m, partial=partial)

    there = np.arange(n) != 3
    white = np.zeros(3) if request.param else np.array([0.3, 1e-3, 0.02])
    return dataclasses.replace(
        keyframes,
        preintegrate=dataclasses.replace(keyframes.preintegrate, rate_density=white),
        array=dataclasses.replace(keyframes.array, there=there),
        position=gone(keyframes.position, np.array([0.5, -0.3, 0.1])),
        velocity=gone(keyframes.velocity, np.zeros(3)),
        gravity=seen(keyframes.gravity_n_mps2, 0.05),
        sight=seen(LANDMARK_N_M - keyframes.p_n_m, 1e-3),
        landmark_n_m=LANDMARK_N_M,
        slot=keyframes.slot + 0.02 * rng.standard_normal((n, 6)),
    )


@dataclasses.dataclass
class Ours:
    """Links with all they read."""

    keyframes: object

    def __post_init__(self):
        n, slot = len(self.keyframes.t_s), self.keyframes.slot
        rows, self.motions = np.arange(1, n), links.empty_motions(n)
        links.integrate(self.motions, rows, links.samples_of(self.keyframes), rows, slot[:-1])
        self.states = links.states_of(self.keyframes)
        self.senses, self.prior = links.senses_of(self.keyframes), links.prior_of(self.keyframes)

    def linked(self, row, states=None):
        link = np.zeros((len(self.keyframes.t_s), 34, 34))
        states = self.states if states is None else states
        parts = (states, self.motions, self.senses, self.prior)
        cost = linearise(link, *parts, np.array([row]), 0)
        assert cost == link[row, -1, -1]
        return link[row]

    def moved(self, row, step):
        """States with those before and at a row, and the landmark, a step, (33,), away."""
        states = self.states.copied()
        for k, part in ((row - 1, step[:STATE]), (row, step[STATE : 2 * STATE])):
            if k >= 0:
                move(states, part[None], k, states, k, wholly=True)
        states.constants[:] += step[2 * STATE :]
        return states


def test_samples_are_summed_up_as_gtsam_does(keyframes):
    ours, about = links.empty_motions(2), keyframes.slot[4:5] + 0.1
    for rows in (np.array([1]), np.array([5])):
        links.integrate(ours, np.array([1]), links.samples_of(keyframes), rows, about)
        bias = gtsam.imuBias.ConstantBias(about[0, :3], about[0, 3:])
        theirs = preintegrated(keyframes.preintegrate, int(rows[0]) - 1, bias)
        z, white = ours.gained[1], ours.white[1]
        assert_allclose(exp(z[None, :3])[0], theirs.deltaRij().matrix(), atol=1e-13)
        assert_allclose(z[3:6], theirs.deltaPij(), rtol=0, atol=1e-13)
        assert_allclose(z[6:], theirs.deltaVij(), rtol=0, atol=1e-12)
        covariance = theirs.residualCovariance()
        assert_allclose(white @ covariance @ white.T, np.eye(15), rtol=0, atol=1e-8)


def test_the_correction_is_the_derivative_of_the_sum_by_the_slot(keyframes):
    row, about = np.array([5]), keyframes.slot[4:5]
    found = links.empty_motions(1)
    samples = links.samples_of(keyframes)

    def summed(change):
        links.integrate(found, np.array([0]), samples, row, about + change)
        return found.gained[0].copy()

    h = 1e-4
    steps = h * np.eye(6)
    numeric = np.stack([(summed(s) - summed(-s)) / (2 * h) for s in steps], axis=1)
    summed(0.0)
    # GTSAM leaves out how the turn within a sub-step changes with the slot: 1e-4 of a velocity.
    assert_allclose(found.correction[0][:3], numeric[:3], rtol=0, atol=1e-8)
    assert_allclose(found.correction[0][3:], numeric[3:], rtol=0, atol=3e-3)


@pytest.mark.parametrize("row", [0, 3, 5])
def test_links_hold_the_information_of_gtsams_factors(keyframes, row):
    """Where the motion leads: elsewhere GTSAM's residual bends otherwise."""
    ours = Ours(keyframes)
    if row:
        predict(ours.states, ours.motions, row)
    linked = ours.linked(row)
    there = dataclasses.replace(
        keyframes, **dict(zip(("R_nb", "p_n_m", "v_n_mps", "slot"), ours.states, strict=False))
    )
    values, chain = gtsam.Values(), Chain.empty(len(keyframes.t_s), 3)
    for k in (max(row - 1, 0), row):
        State.start(there, k).insert(values, k)
    values.insert(L(0), LANDMARK_N_M)
    before = (motion(keyframes, row, keyframes.slot[row - 1], row),) if row else priors(keyframes)
    enter(chain, row, link(keyframes, row, before), values, first=row == 0)
    scale = np.sqrt(np.diag(chain.link[row])).clip(1e-9)
    scale[-1] = max(scale[-1], 1.0)  # of the residual: in sigmas
    scale = np.outer(scale, scale)
    apart = (linked - chain.link[row]) / scale
    # GTSAM's line of sight errs by the angle, ours by its sine; here, some hundredths of a radian.
    assert np.abs(apart).max() < (1e-8 if row == 3 else 1e-3)


@pytest.mark.parametrize("row", [0, 3, 5])
def test_links_are_the_derivatives_of_their_cost(keyframes, row):
    rng = np.random.default_rng(row)
    scale = np.repeat([1e-2, 0.5, 0.1, 1e-3, 1e-2, 1e-2, 0.5, 0.1, 1e-3, 1e-2, 1.0], 3)
    ours = Ours(keyframes)
    if row:
        predict(ours.states, ours.motions, row)
    ours.states = ours.moved(row, scale * rng.standard_normal(33))
    linked = ours.linked(row)
    size = np.sqrt(np.diag(linked)[:-1]).clip(1e-9)
    for k in np.flatnonzero(size > 1e-8):
        h = 1e-3 / size[k] if size[k] > 1 else 1e-3
        step = np.zeros(33)
        step[k] = h
        ahead, behind = (ours.linked(row, ours.moved(row, s))[-1, -1] for s in (step, -step))
        slope = (ahead - behind) / (2 * h)
        expected = -2 * linked[k, -1]
        assert abs(slope - expected) < 1e-5 * size[k] * np.sqrt(linked[-1, -1]), k


def test_what_was_not_measured_weighs_nothing(keyframes):
    ours = Ours(keyframes)
    predict(ours.states, ours.motions, 3)
    assert ours.linked(3)[-1, -1] < 1e-9
    assert ours.linked(4)[-1, -1] > 1


def test_the_batch_ends_where_gtsam_ends():
    case = turning(np.random.default_rng(1), span_s=10.0)
    keyframes = case.keyframes
    found = solve_batch(keyframes)
    graph, values, n = gtsam.NonlinearFactorGraph(), gtsam.Values(), len(keyframes.t_s)
    for k in range(n):
        before = (motion(keyframes, k, found.slot[k - 1], k),) if k else priors(keyframes)
        graph.push_back(link(keyframes, k, before))
        State.start(keyframes, k).insert(values, k)
    theirs = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    marginals = gtsam.Marginals(graph, theirs)
    R_nb = np.array([theirs.atPose3(X(k)).rotation().matrix() for k in range(n)])
    sigma = np.sqrt(np.einsum("nii->ni", found.covariance))
    assert np.abs(log(transpose(R_nb) @ found.R_nb) / sigma[:, :3]).max() < 0.03
    for k in (0, n // 2, n - 1):
        expected = np.sqrt(np.diag(marginals.marginalCovariance(X(k))))
        assert_allclose(sigma[k, :6], expected, rtol=1e-3)


def test_an_interval_without_a_covariance_is_no_solution(keyframes):
    samples = links.samples_of(keyframes)
    broken = samples._replace(noise=np.full_like(samples.noise, np.nan))
    row = np.array([1])
    with pytest.raises(NoSolutionError, match="motion: 1 intervals between keyframes have no cov"):
        links.integrate(links.empty_motions(2), row, broken, row, np.zeros((1, 6)))
