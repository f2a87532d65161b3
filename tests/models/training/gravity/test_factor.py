"""The gravity network as a factor: its graph prepares what the network sees."""

import numpy as np
import pytest
import torch

from fgnav.neural.manifest import Statistic
from fgnav.neural.network import load_network
from fgnav_models.training.ambiguity.released import Release
from fgnav_models.training.gravity.data import draw
from fgnav_models.training.gravity.factor import UNITS, figures_of_windows, release_gravity
from fgnav_models.training.gravity.features import SAMPLES, SPAN_S, course_motion
from fgnav_models.training.gravity.nets import GravityNet
from fgnav_sim.data_sets.gravity_world import GravityWorld

DOMAIN = tuple(Statistic(name=n, unit=unit, range=(-1e3, 1e3)) for n, unit in UNITS.items())


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    folder = tmp_path_factory.mktemp("factor")
    net = GravityNet(aided=True, width=16, seed=3)
    with torch.no_grad():
        net.dense[-1].weight.normal_(0.0, 0.1, generator=torch.Generator().manual_seed(4))
    words = Release(name="down", purpose="Gravity.", notes={}, domain={})
    epochs = draw(GravityWorld(velocity_age_s=0.1), 80, rng=np.random.default_rng(5))
    release_gravity(net, epochs, words, (4.4, 0.25), DOMAIN, {"network, NEES": 2.0}, folder)
    assert "| network, NEES | 2 |" in (folder / "down.md").read_text()
    return net, epochs, load_network(folder / "down.json")


def test_it_answers_as_the_network_does_to_the_same_motion(network):
    net, epochs, factor = network
    f_b_mps2, v, a = map(torch.from_numpy, (epochs.f_b_mps2, epochs.v_n_mps, epochs.a_n_mps2))
    seen = (f_b_mps2.float(), course_motion(v, a).float())
    with torch.no_grad():
        g_b, covariance = (x.double().numpy() for x in net(*seen))
    half_mps = epochs.a_n_mps2 * SPAN_S / 2
    v_n_mps = np.stack([epochs.v_n_mps - half_mps, epochs.v_n_mps, epochs.v_n_mps + half_mps], 1)
    answers = factor([epochs.f_b_mps2, v_n_mps])
    # Velocities of 250 m/s have 8 um/s in single precision, accelerations 0.1 mm/s2.
    np.testing.assert_allclose(answers.value, g_b, rtol=0, atol=1e-4)
    across = np.linalg.svd(answers.value[:, None])[2][:, 1:]
    for ours, theirs in zip(answers.covariance, covariance, strict=True):
        assert np.linalg.eigvalsh(ours)[0] > 0
        np.testing.assert_allclose(np.trace(ours), 1.5 * np.trace(theirs), rtol=1e-3)
    ours, theirs = (across @ P @ across.swapaxes(1, 2) for P in (answers.covariance, covariance))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-3 * theirs.max())
    figures = figures_of_windows(*seen)
    for name, figure in zip(UNITS, answers.figures, strict=True):
        np.testing.assert_allclose(figure, figures[name], rtol=1e-4, atol=1e-3)


def test_the_domain_sees_where_accelerometer_and_velocities_disagree():
    f_b_mps2 = torch.zeros((1, SAMPLES, 3))
    f_b_mps2[:, :, 2] = -9.81
    agree = figures_of_windows(f_b_mps2, torch.tensor([[50.0, 0, 0, 0, 0]]))
    fault = figures_of_windows(f_b_mps2, torch.tensor([[50.0, 0, 20.0, 0, 0]]))
    key = "accelerometer_less_velocities_mps2"
    assert abs(agree[key][0]) < 1e-5
    assert float(fault[key][0]) == pytest.approx(9.81 - np.hypot(20.0, 9.81), rel=1e-5)
    assert key not in figures_of_windows(f_b_mps2, None)


def test_its_manifest_states_how_long_errors_last_as_measured(network):
    output = network[2].manifest.output
    assert (output.half_life_s, output.lasting) == (4.4, 0.25)
    assert (output.measures, output.covariance.form) == ("direction", "cholesky")
