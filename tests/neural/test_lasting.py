"""Errors that last as long as a flight: how their share is measured, and a constant that has it."""

import gtsam
import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.graph.correlation import inflation, interval_s
from fgnav.graph.keys import Timeline, constant, pose
from fgnav.methods.smoother import Batch
from fgnav.neural import NeuralFactor
from fgnav.neural.correlation import half_life_s, lasting_share, together
from fgnav.neural.network import load_network
from fgnav.neural.outputs import Counted, factor_of
from fgnav_sim.gauss_markov import gauss_markov
from tests.assembly import flights
from tests.methods.simulated import flown
from tests.neural import graphs
from tests.neural.test_methods import streamed

SHARE, HALF_LIFE_S, STEP_S = 0.4, 0.3, 0.1


def errors(rng, share, count=300, n=300):
    """Return flights of errors, a share of whose variance lasts, (n, 2) each."""
    t_s = STEP_S * np.arange(n)
    new = gauss_markov(HALF_LIFE_S / np.log(2), STEP_S, (n, count, 2), rng=rng)
    lasts = rng.standard_normal((count, 2))
    error = np.sqrt(share) * lasts + np.sqrt(1 - share) * new
    return [(t_s, error[:, k]) for k in range(count)]


def test_what_lasts_is_told_from_what_is_soon_new():
    of = errors(np.random.default_rng(1), SHARE)
    share = lasting_share(of)
    assert abs(share - SHARE) < 0.05  # 1-sigma of 600 constants: 0.4 sqrt(2/600) = 0.023
    assert abs(half_life_s(of, share) / HALF_LIFE_S - 1) < 0.15
    between_s = interval_s(HALF_LIFE_S)
    assert abs(together(of, HALF_LIFE_S, between_s, share) - 1) < 0.15
    assert together(of, HALF_LIFE_S, between_s) > 5


def test_of_errors_that_are_soon_new_nothing_lasts():
    rng = np.random.default_rng(2)
    assert lasting_share(errors(rng, 0.0)) < 0.02
    assert lasting_share(errors(rng, 0.9, count=1)) == 0.0  # nobody knows


def test_answers_that_share_a_constant_know_what_their_joint_covariance_says(tmp_path):
    """Eight heights of one place: ``1' C^-1 1`` of C = sigma^2 (s 11' + (1 - s) c I)."""
    network = load_network(graphs.heading(tmp_path, measures="height", value=20.0, spread=0.5))
    answers, n, inflation = network([np.zeros((1, 5, 3))]), 8, 1.25
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    values.insert(pose(0), gtsam.Pose3(gtsam.Rot3(), np.array([0.0, 0.0, -20.0])))
    values.insert(constant(0), np.zeros(1))
    wide = gtsam.noiseModel.Isotropic.Sigma(6, 1e4)
    graph.add(gtsam.PriorFactorPose3(pose(0), values.atPose3(pose(0)), wide))
    unit = gtsam.noiseModel.Unit.Create(1)
    graph.add(gtsam.PriorFactorVector(constant(0), np.zeros(1), unit))
    counted = Counted(inflation, SHARE, constant(0))
    output, one = network.manifest.output, (answers.value[0], answers.covariance[0])
    for _ in range(n):
        graph.add(factor_of("net", output, (0, 0), *one, counted).factor)
    found = gtsam.Marginals(graph, values).marginalCovariance(pose(0))[5, 5]
    C = answers.covariance[0, 0, 0] * (SHARE + (1 - SHARE) * inflation * np.eye(n))
    assert abs(found * np.linalg.inv(C).sum() - 1) < 1e-6


def test_in_a_graph_many_answers_leave_what_lasts(tmp_path):
    """Of a flight, and of a stream, whose heights nothing else knows to a centimetre."""
    sigma_m = 0.02
    sure, lasts = (
        graphs.heading(made, measures="height", value=30.0, spread=np.log(sigma_m), lasting=share)
        for share, made in ((0.0, tmp_path), (0.5, tmp_path / "lasts"))
        if made.mkdir(exist_ok=True) is None
    )
    flight = flown("surroundings", 5.0)
    case = flights.turning(np.random.default_rng(3), span_s=4.0, gyro=True)
    for path, low, high in ((sure, 0.0, 0.3), (lasts, 0.7, 0.9)):
        estimate = Batch(factors=(str(path),))(flight)
        last = streamed(case, (NeuralFactor(path),))[-1]
        for one in (estimate, last):
            assert not any("lasting" in known.name for known in one.calibration)
            ratio = np.sqrt(one.position_covariance_m2[len(one.t_s) // 2, 2, 2]) / sigma_m
            assert low < ratio < high


def test_who_asks_it_without_its_constant_is_told(tmp_path):
    source = NeuralFactor(graphs.heading(tmp_path, lasting=0.3))
    with pytest.raises(BadInputError, match=r"key output\.lasting: its factors share a constant"):
        source(flown("surroundings", 5.0), Timeline(t_s=np.arange(1.0, 2.0, 0.1), gyroscope=True))


def test_errors_that_swing_are_counted_at_their_own_frequency():
    """At another one in each flight: the mean over flights of what is correlated shows nothing."""

    def swinging(rng, count=200, n=300):
        t_s = STEP_S * np.arange(n)
        rates = rng.uniform(1.0, 3.0, (count, 1, 2))
        starts = rng.uniform(0, 2 * np.pi, (count, 1, 2))
        swing = np.sqrt(2) * np.cos(rates * t_s[:, None] + starts)
        new = rng.standard_normal((count, n, 2))
        return [(t_s, np.sqrt(0.3) * a + np.sqrt(0.7) * b) for a, b in zip(swing, new, strict=True)]

    rng = np.random.default_rng(11)
    found_s = half_life_s(swinging(rng))
    every = round(interval_s(found_s) / STEP_S)

    def largest(errors, counted):
        answers = [error[::every] - error[::every].mean(axis=0) for _, error in errors]
        spectra = [np.abs(np.fft.rfft(one, axis=0)) ** 2 for one in answers]
        return (
            np.mean(
                [s[1:-1].mean(axis=1).max() / len(a) for s, a in zip(spectra, answers, strict=True)]
            )
            / counted
        )

    white = [(None, rng.standard_normal((300, 2))) for _ in range(400)]
    inflated = inflation(found_s, every * STEP_S)
    assert largest(swinging(rng), inflated) < 1.1 * largest(white, 1.0)
    assert found_s > 2 * STEP_S
