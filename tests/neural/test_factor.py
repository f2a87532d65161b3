"""Outputs as factors, the windows they come from, and how outputs that err alike are counted."""

import json
import pickle

import gtsam
import numpy as np
import pytest

from fgnav.geometry import rotations
from fgnav.geometry.interpolation import interpolate
from fgnav.graph import jacobian_misfit
from fgnav.graph.correlation import inflation, interval_s
from fgnav.graph.custom import check_factor
from fgnav.graph.keys import Timeline, constant, pose, velocity
from fgnav.messages import note
from fgnav.neural import NeuralFactor, Record
from fgnav.neural.correlation import half_life_s, together
from fgnav.neural.network import load_network
from fgnav.neural.outputs import Counted, factor_of
from fgnav.neural.records import of_flight
from fgnav_sim.gauss_markov import gauss_markov
from tests.methods.simulated import flown
from tests.neural import graphs, sun_compass

R_NB = rotations.from_euler(*np.array([[0.2], [-0.3], [2.5]]))[0]
P_N_M, V_N_MPS = np.array([10.0, -20.0, -300.0]), np.array([12.0, 5.0, -1.0])

STEP_S = 0.1  # between answers


@pytest.fixture(name="values")
def states():
    values = gtsam.Values()
    values.insert(pose(3), gtsam.Pose3(gtsam.Rot3(R_NB), P_N_M))
    values.insert(velocity(3), V_N_MPS)
    R_before = R_NB @ rotations.exp(np.array([[0.1, -0.2, 0.3]]))[0]
    values.insert(pose(1), gtsam.Pose3(gtsam.Rot3(R_before), P_N_M - V_N_MPS))
    values.insert(constant(0), np.zeros(1))
    values.insert(constant(1), np.zeros(3))
    return values


MEASURED = {
    "heading": (2.5, {}),
    "attitude": (R_NB.ravel(), {"form": "cholesky", "spread": [0.1, 0, 0.1, 0, 0, 0.1]}),
    "direction": (R_NB[2], {}),
    "velocity": (V_N_MPS, {}),
    "velocity in b": (R_NB.T @ V_N_MPS, {"frame": "b"}),
    "speed": (np.linalg.norm(V_N_MPS), {}),
    "height": (300.0, {}),
    "position": (P_N_M, {}),
    "displacement": (V_N_MPS, {"over_s": 0.2}),
    "displacement in b": (
        (R_NB @ rotations.exp(np.array([[0.1, -0.2, 0.3]]))[0]).T @ V_N_MPS,
        {"frame": "b", "over_s": 0.2},
    ),
}


@pytest.mark.parametrize("what", MEASURED)
def test_a_right_answer_leaves_no_residual_and_its_jacobian_is_that_of_differences(
    tmp_path, values, what
):
    value, options = MEASURED[what]
    network = load_network(
        graphs.heading(tmp_path, measures=what.split()[0], value=value, **options)
    )
    answers = network([np.zeros((1, 5, 3))])
    output = network.manifest.output
    lasts = Counted(1.5, 0.3, constant(int(output.measure.freedom > 1)))
    for counted in (Counted(), lasts):
        one = factor_of("net", output, (1, 3), answers.value[0], answers.covariance[0], counted)
        check_factor(one, values)
        assert one.factor.error(values) < 1e-6
        assert jacobian_misfit(one, values) < 1e-7


def test_a_quaternion_is_its_rotation_matrix(tmp_path):
    w, x, y, z = rotations.quaternion_wxyz(R_NB[None])[0]
    spread = [0.1, 0, 0.1, 0, 0, 0.1]
    path = graphs.heading(
        tmp_path, measures="attitude", value=[w, x, y, z], form="cholesky", spread=spread
    )
    value = load_network(path)([np.zeros((1, 5, 3))]).value
    np.testing.assert_allclose(value.reshape(3, 3), R_NB, rtol=0, atol=1e-6)


def test_onnxruntime_says_what_torch_says(tmp_path):
    """Of a trained network, through its manifest."""
    import torch

    notebook = sun_compass.made()
    seen, diodes = notebook["seen"][:500], notebook["diodes"]
    answers = load_network(sun_compass.written(tmp_path))([seen])
    x = torch.tensor((seen - diodes.mean) / diodes.scale, dtype=torch.float32)
    with torch.no_grad():
        direction, log_sigma = (part.double().numpy() for part in notebook["net"](x))
    heading_rad = np.arctan2(direction[:, 1], direction[:, 0])
    np.testing.assert_allclose(rotations.wrap(answers.value[:, 0] - heading_rad), 0.0, atol=1e-5)
    sigma_rad = np.sqrt(answers.covariance[:, 0, 0])
    np.testing.assert_allclose(sigma_rad, np.exp(log_sigma[:, 0]), rtol=1e-5)


def test_windows_end_at_keyframes_and_hold_nothing_later(tmp_path):
    """Samples after a keyframe are beyond the domain, and nobody notices."""
    t_s = np.arange(0.0, 3.0, 0.01)
    values = np.where(t_s[:, None] > 2.0, 1e9, 0.0) * np.ones(3)
    record = Record(t_s=t_s, values=values, unit="rad/s", frame="b")
    source = NeuralFactor(graphs.heading(tmp_path), records={"gyroscope": record})
    found = source(flown("surroundings", 5.0), timeline(np.array([0.02, 1.0, 2.0, 2.01, 2.9, 3.5])))
    assert [one.factor.keys() for one in found] == [[pose(1)], [pose(2)]]
    lost = {loss.reason: loss.count for loss in found.unused}
    assert lost == {
        "gyroscope has no window of 5 samples at 100 Hz": 2,
        "gyroscope channel 0 outside -1000 to 1000 rad/s, the network's training domain": 2,
    }
    assert {loss.what for loss in found.unused} == {"net answer"}


def test_a_gap_in_a_window_leaves_its_answer_out(tmp_path):
    t_s = np.delete(np.arange(0.0, 3.0, 0.01), slice(100, 103))
    record = Record(t_s=t_s, values=np.zeros((len(t_s), 3)), unit="rad/s", frame="b")
    source = NeuralFactor(graphs.heading(tmp_path), records={"gyroscope": record})
    found = source(flown("surroundings", 5.0), timeline(np.array([0.95, 1.04, 1.2])))
    assert [one.factor.keys() for one in found] == [[pose(0)], [pose(2)]]


def test_outside_of_what_its_graph_computes_a_factor_leaves(tmp_path):
    path = graphs.heading(tmp_path)  # its output s is -3
    content = json.loads(path.read_text())
    times = timeline(np.arange(1.0, 2.0, 0.1))
    for low, count in ((-4.0, 10), (-2.0, 0)):
        content["domain"] = [{"name": "s", "unit": "m/s2", "range": [low, 0.0]}]
        path.write_text(json.dumps(content))
        found = NeuralFactor(path)(flown("surroundings", 5.0), times)
        assert len(list(found)) == count
    reason = "s outside -2 to 0 m/s2, the network's training domain"
    assert [(loss.reason, loss.count) for loss in found.unused] == [(reason, 10)]


def test_answers_within_two_half_lives_are_left_out_and_the_rest_are_inflated(tmp_path):
    sigma_rad = np.exp(-3.0)
    source = NeuralFactor(graphs.heading(tmp_path, half_life_s=0.25))
    found = source(flown("surroundings", 5.0), timeline(np.arange(1.0, 4.01, 0.1)))
    assert [one.factor.keys()[0] for one in found] == [pose(k) for k in range(0, 31, 5)]
    assert [loss.count for loss in found.unused] == [31 - 7]
    for one in found:
        np.testing.assert_allclose(
            one.factor.noiseModel().sigmas(), np.sqrt(5 / 3) * sigma_rad, rtol=1e-6
        )


def test_a_displacement_needs_a_keyframe_where_it_begins(tmp_path):
    path = graphs.heading(tmp_path, measures="displacement", value=np.ones(3), over_s=0.3)
    found = NeuralFactor(path)(flown("surroundings", 5.0), timeline(np.array([1.0, 1.2, 1.3, 1.4])))
    assert [list(one.factor.keys()) for one in found] == [[pose(0), pose(2)]]
    assert [(loss.count, loss.reason[:27]) for loss in found.unused] == [
        (3, "no keyframe stands 0.3 s be")
    ]


def test_a_sensor_that_the_graph_uses_too_is_noted(tmp_path):
    path = graphs.heading(tmp_path, sensor="magnetometer", rate_hz=10.0)
    found = NeuralFactor(path)(flown("surroundings", 5.0), timeline(np.arange(1.0, 3.0, 0.5)))
    assert found.notes == (note("W406", network="net", sensor="magnetometer"),)


def test_a_factor_goes_to_another_process(tmp_path):
    source = pickle.loads(pickle.dumps(NeuralFactor(graphs.heading(tmp_path), interval_s=0.7)))
    assert (source.name, source.between_s) == ("net", 0.7)


@pytest.mark.parametrize("half_life", [0.1, 0.5, 3.0])
def test_inflated_answers_know_of_a_constant_what_correlated_ones_do(half_life):
    between_s = interval_s(half_life)
    t_s = between_s * np.arange(400)
    correlation = 2.0 ** (-np.abs(t_s[:, None] - t_s) / half_life)
    information = np.linalg.inv(correlation).sum()  # of a constant, of unit errors
    np.testing.assert_allclose(len(t_s) / inflation(half_life, between_s), information, rtol=5e-3)
    # Whatever the states do, never less than the true covariance.
    assert np.linalg.eigvalsh(correlation)[-1] <= inflation(half_life, between_s)


def test_outputs_of_any_times_claim_no_more_than_they_know():
    rng = np.random.default_rng(3)
    t_s = np.cumsum(1.0 + rng.exponential(1.0, 200))
    correlation = 2.0 ** (-np.abs(t_s[:, None] - t_s) / 0.5)
    assert np.linalg.eigvalsh(correlation)[-1] <= inflation(0.5, 1.0)


def test_independent_answers_are_not_inflated():
    assert inflation(0.0, 0.1) == 1.0


def correlated(half_life_s, shape, rng):
    """Return errors of unit variance, a tenth of a second apart along the first axis."""
    return gauss_markov(half_life_s / np.log(2), STEP_S, shape, rng=rng)


def test_the_half_life_of_a_gauss_markov_process_is_found():
    rng = np.random.default_rng(4)
    error, t_s = correlated(0.5, (20_000, 2), rng), STEP_S * np.arange(20_000)
    # The autocorrelation's sum has a relative 1-sigma of about sqrt(4 M / n): 5 % of M = 25 lags.
    assert abs(half_life_s([(t_s, error)]) / 0.5 - 1) < 0.15
    assert half_life_s([(t_s, rng.standard_normal((20_000, 2)))]) < 0.3 * STEP_S


def test_a_half_life_is_found_across_missing_answers():
    rng = np.random.default_rng(6)
    error, t_s = correlated(0.5, (20_000, 2), rng), STEP_S * np.arange(20_000)
    there = rng.random(20_000) < 0.7
    assert abs(half_life_s([(t_s[there], error[there])]) / 0.5 - 1) < 0.15


def test_errors_that_partly_last_for_a_flight_are_counted_right_over_one():
    """A quarter of the variance is the flight's own: no single half-life has that."""

    def flights(rng):
        t_s = STEP_S * np.arange(300)
        return [
            (t_s, np.sqrt(0.75) * correlated(0.3, (300, 2), rng) + 0.5 * rng.standard_normal(2))
            for _ in range(400)
        ]

    rng = np.random.default_rng(7)
    found_s = half_life_s(flights(rng))
    others = flights(rng)
    assert 1.8 < 2 * together(others, found_s, interval_s(found_s)) < 2.2
    assert 2 * together(others, 0.0, 0.0) > 3
    assert 2 * together(others, 0.3, interval_s(0.3)) > 3  # what their neighbours would tell


def test_answers_that_err_alike_throughout_are_together_as_sure_as_one():
    rng, t_s = np.random.default_rng(8), STEP_S * np.arange(100)
    flights = [(t_s, np.tile(rng.standard_normal(1), (100, 1))) for _ in range(50)]
    found_s = half_life_s(flights)
    one = np.mean([error[0] ** 2 for _, error in flights])
    assert together(flights, found_s, interval_s(found_s)) == pytest.approx(one, rel=0.02)


def timeline(t_s):
    return Timeline(t_s=t_s, gyroscope=True)


def test_velocities_of_raw_observations_are_those_that_a_network_sees():
    flight = flown("demo", span_s=3.0)
    record = of_flight(flight)["velocity"]
    truth = interpolate(record.t_s, flight.truth.t_s, flight.truth.v_n_mps)
    assert len(record.t_s) == len(flight.observations.t_s)
    assert np.abs(record.values - truth).max() < 1.0
