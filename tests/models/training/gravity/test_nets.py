import numpy as np
import pytest
import torch

from fgnav.checks import BadInputError
from fgnav_models.training.ambiguity.nets import Architecture
from fgnav_models.training.gravity.data import (
    BASELINES,
    Drawn,
    Rows,
    angles_deg,
    baseline,
    draw,
    rms,
    split,
)
from fgnav_models.training.gravity.figures import Answers, by_kind, free_flight
from fgnav_models.training.gravity.nets import (
    GravityNet,
    PaperGravity,
    deviation,
    negative_log_likelihood,
)
from fgnav_models.training.gravity.trainer import calibrate
from fgnav_sim.data_sets.gravity import PHASES
from fgnav_sim.data_sets.gravity_world import (
    GravityWorld,
    MotionRanges,
    PhasesTable,
    WindowsTable,
)
from fgnav_sim.scenario import ImuTable

ANY_RAD = np.pi


@pytest.fixture(scope="module")
def epochs():
    return draw(GravityWorld(windows=WindowsTable(flight_s=10.0)), 600, seed=[5])


def test_untrained_the_networks_answer_as_physics_does(epochs):
    for aided, name in ((True, "physical pair"), (False, "newest sample")):
        net = GravityNet(aided=aided, width=8, seed=0)
        ours = Answers.of(net, epochs).g_b
        told = angles_deg(ours, baseline(name, epochs))
        assert np.median(told) < 1e-2  # single precision
        felt = np.linalg.norm(epochs.f_b_mps2[:, -1], axis=1) > 1.0
        assert told[felt].max() < 5.0  # the pair of forces nearly along the nose


def test_covariance_is_symmetric_and_lies_across_the_answer(epochs):
    net = GravityNet(aided=False, width=8, seed=3)
    with torch.no_grad():
        net.dense[-1].weight.normal_(0.0, 0.3, generator=torch.Generator().manual_seed(1))
        g_b, covariance = net(*Rows.of(epochs).seen(aided=False))
    values = torch.linalg.eigvalsh(covariance.double())
    assert torch.allclose(covariance, covariance.transpose(1, 2), atol=1e-7)
    along = torch.einsum("nij,nj->ni", covariance, g_b).norm(dim=1)
    assert float((along / values[:, 2]).max()) < 1e-5
    assert float(values[:, 1].min()) > 0
    assert float((values[:, 2] / values[:, 1]).max()) > 1.5  # two axes, not one circle


def test_an_error_is_an_angle_and_its_square_is_weighed_by_the_covariance():
    down = torch.tensor([[0.0, 0.0, 1.0]] * 2)
    true = torch.tensor([[np.sin(0.4), 0.0, np.cos(0.4)], [0.0, np.sin(2.0), np.cos(2.0)]])
    covariance = torch.diag(torch.tensor([0.04, 0.01, 0.0])).expand(2, 3, 3)
    error, squared, log_determinant = deviation((down, covariance), true.float())
    np.testing.assert_allclose(error.norm(dim=1), [0.4, 2.0], rtol=1e-5)
    np.testing.assert_allclose(squared, [0.4**2 / 0.04, 2.0**2 / 0.01], rtol=1e-5)
    np.testing.assert_allclose(log_determinant, np.log(4e-4), rtol=1e-5)


def test_the_loss_is_least_where_the_covariance_is_that_of_the_errors():
    rng = np.random.default_rng(1)
    small = rng.standard_normal((4000, 2)) * [0.02, 0.05]
    true = np.concatenate([small, np.sqrt(1 - (small**2).sum(axis=1, keepdims=True))], axis=1)
    true_b = torch.from_numpy(true).float()
    down = torch.tensor([0.0, 0.0, 1.0]).expand(len(true), 3)

    def loss(scale):
        C = torch.diag(torch.tensor([(0.02 * scale) ** 2, (0.05 * scale) ** 2, 0.0]))
        return float(negative_log_likelihood(lambda: (down, C.expand(len(true), 3, 3)), (true_b,)))

    assert loss(1.0) < min(loss(0.9), loss(1.1))


def test_calibration_makes_the_mean_normalised_square_that_of_its_freedom(epochs):
    net = GravityNet(aided=True, width=8, seed=0)
    calibrate(net, epochs, ANY_RAD)
    answers = Answers.of(net, epochs)
    answer = torch.from_numpy(answers.g_b), torch.from_numpy(answers.covariance)
    _, squared, _ = deviation(answer, torch.from_numpy(epochs.g_b))
    assert float(squared.mean()) == pytest.approx(2.0, rel=1e-3)


def test_tables_count_only_windows_within_the_stated_sigma(epochs):
    net = GravityNet(aided=True, width=8, seed=0)
    everything, metrics = by_kind(net, epochs, ANY_RAD)
    assert metrics["windows answered, %"] == 100.0
    assert [line.split(" | ")[0].strip("| ") for line in everything.splitlines()[2:]] == list(
        PHASES
    )
    assert by_kind(net, epochs, np.radians(6.0))[1]["windows answered, %"] == 100.0  # first: 4.7
    nothing, metrics = by_kind(net, epochs[:20], np.radians(89.0))
    assert "–" in nothing


def test_the_bound_of_a_coasting_rocket_is_below_what_physics_errs_by():
    world = GravityWorld(phases=PhasesTable(**(dict.fromkeys(PHASES, 0.0) | {"rocket": 1.0})))
    table = free_flight(GravityNet(aided=True, width=8, seed=0), draw(world, 600, seed=[6]), world)
    rows = [line.strip("| ").split(" | ") for line in table.splitlines()[2:]]
    assert len(rows) == 4
    assert all(float(row[1]) < float(row[2]) for row in rows)


def test_half_of_a_batch_is_mirrored(epochs):
    rows = Rows.of(epochs)
    tensors = (*rows.seen(aided=True), rows.g_b)
    plain, mirrored = (
        Drawn(tensors=tensors, batch=8, seed=1, mirrored=m)(3) for m in (False, True)
    )
    for one, other in zip(plain, mirrored, strict=True):
        assert torch.equal(other[:4], one[:4] * torch.tensor([1.0, -1.0, 1.0]))
        assert torch.equal(other[4:], one[4:])


def test_the_papers_network_answers_within_the_training_sets_extremes(epochs):
    rows = Rows.of(epochs)
    gravity = 9.81 * rows.g_b
    for kind in ("mlp", "rnn"):
        net = PaperGravity(Architecture(kind=kind, dense=(8,)), rows.f_b_mps2, gravity, seed=1)
        scaled = net.scaled(gravity)
        assert float(scaled.amin()) == pytest.approx(0.0, abs=1e-6)
        assert float(scaled.amax()) == pytest.approx(1.0, abs=1e-6)
        told = net.gravity_b_mps2(rows.f_b_mps2)
        assert bool((told <= gravity.amax(dim=0)).all() & (told >= gravity.amin(dim=0)).all())


def test_without_acceleration_noise_or_wobble_every_baseline_is_right():
    steady = GravityWorld(
        velocity_noise_mps=(1e-9, 1e-9),
        accelerometer_arm_m=(0.0, 0.0, 0.0),
        antenna_arm_m=(0.0, 0.0, 0.0),
        phases=PhasesTable(turn=0, spin=0, rocket=0, guided=0, glider=0, vacuum=0),
        motion=MotionRanges(surge_mps2=(0.0, 0.0), wobble_deg=(0.0, 0.0)),
        imu=ImuTable(
            accelerometer_noise_mps2_per_sqrt_hz=1e-9,
            accelerometer_bias_mps2=1e-9,
            accelerometer_bias_walk_mps2_per_sqrt_s=1e-9,
        ),
    )
    epochs = draw(steady, 60, seed=[3])
    for name in BASELINES:
        # The Earth turns below: Coriolis takes 250 m/s by 0.2 degrees off the vertical.
        assert angles_deg(baseline(name, epochs), epochs.g_b).max() < 0.25


def test_the_physical_pair_is_right_in_turns_where_the_accelerometer_is_not(epochs):
    turn = epochs[epochs.phase == 3]
    pair, sample = (
        rms(angles_deg(baseline(name, turn), turn.g_b)) for name in ("physical pair", BASELINES[0])
    )
    assert pair < 5.0
    assert sample > 20.0


@pytest.mark.parametrize(("by", "apart"), [("flights", True), ("samples", False)])
def test_only_a_split_by_flights_keeps_flights_apart(epochs, by, apart):
    parts = split(epochs.flight, (0.7, 0.15, 0.15), by, seed=1)
    np.testing.assert_array_equal(np.sort(np.concatenate(parts)), np.arange(len(epochs)))
    assert len(parts[0]) == pytest.approx(0.7 * len(epochs), abs=20)
    seen, tested = (set(epochs.flight[part]) for part in (parts[0], parts[2]))
    assert seen.isdisjoint(tested) == apart


def test_a_world_of_other_windows_is_refused():
    with pytest.raises(
        BadInputError, match=r"windows\.samples, windows\.velocities, imu\.rate_hz must"
    ):
        draw(GravityWorld(windows=WindowsTable(samples=3)), 20, seed=[1])
