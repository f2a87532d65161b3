"""The gravity network as a factor: its graph prepares what the estimator prepares."""

import numpy as np
import pytest
import torch

from fgnav.neural.network import load_network
from fgnav_models.gravity_features import SPAN_S, course_motion, domain_values
from fgnav_models.training.ambiguity.released import Release
from fgnav_models.training.gravity.data import draw
from fgnav_models.training.gravity.factor import FIGURES, release_gravity
from fgnav_models.training.gravity.nets import GravityNet
from fgnav_sim.data_sets.gravity_world import GravityWorld

DOMAIN = {name: [-1e3, 1e3] for name in FIGURES} | {"half_life_s": 4.4}


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    folder = tmp_path_factory.mktemp("factor")
    net = GravityNet(aided=True, width=16, seed=3)
    with torch.no_grad():
        net.dense[-1].weight.normal_(0.0, 0.1, generator=torch.Generator().manual_seed(4))
    words = Release(name="down", purpose="Gravity.", notes={}, domain={})
    epochs = draw(GravityWorld(velocity_age_s=0.1), 80, rng=np.random.default_rng(5))
    release_gravity(net, epochs, words, DOMAIN, {"network, NEES": 2.0}, folder)
    assert "| network, NEES | 2 |" in (folder / "down.md").read_text()
    return net, epochs, load_network(folder / "down.json")


def test_it_answers_as_the_network_does_to_the_same_motion(network):
    net, epochs, factor = network
    motion = course_motion(epochs.v_n_mps, epochs.a_n_mps2)
    with torch.no_grad():
        seen = (torch.from_numpy(x).float() for x in (epochs.f_b_mps2, motion))
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
    figures = domain_values(epochs.f_b_mps2, motion)
    for name, figure in zip(FIGURES, answers.figures, strict=True):
        np.testing.assert_allclose(figure, figures[name], rtol=1e-4, atol=1e-3)


def test_its_manifest_states_the_half_life_that_was_measured(network):
    output = network[2].manifest.output
    assert output.half_life_s == 4.4
    assert (output.measures, output.covariance.form) == ("direction", "cholesky")
