"""The gravity network as a factor: its graph prepares what the network sees."""

import numpy as np
import pytest
import torch

from fgnav.neural.manifest import Statistic
from fgnav.neural.network import load_network
from fgnav_models.training.contract import Release
from fgnav_models.training.gravity.data import Rows, draw
from fgnav_models.training.gravity.factor import (
    SIGMA,
    UNITS,
    GravityFactor,
    figures_of_windows,
    release_gravity,
)
from fgnav_models.training.gravity.features import SAMPLES, VELOCITIES
from fgnav_models.training.gravity.nets import GravityNet
from fgnav_sim.data_sets.gravity_world import GravityWorld

DOMAIN = tuple(Statistic(name=n, unit=unit, range=(-1e3, 1e3)) for n, unit in UNITS.items())


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    folder = tmp_path_factory.mktemp("factor")
    net = GravityNet(aided=True, width=16, seed=3)
    epochs = draw(GravityWorld(), 80, seed=[5])
    rows = Rows.of(epochs)
    net.scale_inputs(*rows.seen(aided=True))
    with torch.no_grad():
        net.dense[-1].weight.normal_(0.0, 0.1, generator=torch.Generator().manual_seed(4))
    words = Release(name="down", purpose="Gravity.", notes={}, domain={})
    release_gravity(net, epochs, words, (4.4, 0.25), DOMAIN, {"network, NEES": 2.0}, folder)
    assert "| network, NEES | 2 |" in (folder / "down.md").read_text()
    return net, epochs, load_network(folder / "down.json")


def test_it_answers_as_the_network_does_to_the_same_windows(network):
    net, epochs, factor = network
    rows = Rows.of(epochs)
    seen = tuple(x.double() for x in rows.seen(aided=True))
    with torch.no_grad():
        g_b, covariance = (x.double().numpy() for x in net(*seen))
        figures = figures_of_windows(net, seen[0], net.motion(seen[1]), net(*seen)[1])
    answers = factor([epochs.f_b_mps2, epochs.v_n_mps])
    np.testing.assert_allclose(answers.value, g_b, rtol=0, atol=1e-5)
    across = np.linalg.svd(answers.value[:, None])[2][:, 1:]
    for ours, theirs in zip(answers.covariance, covariance, strict=True):
        assert np.linalg.eigvalsh(ours)[0] > 0
        np.testing.assert_allclose(np.trace(ours), 1.5 * np.trace(theirs), rtol=1e-3)
    ours, theirs = (across @ P @ across.swapaxes(1, 2) for P in (answers.covariance, covariance))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-3 * theirs.max())
    for name, figure in zip(UNITS, answers.figures, strict=True):
        np.testing.assert_allclose(figure, figures[name], rtol=1e-4, atol=1e-3)
    across = np.linalg.svd(answers.value[:, None])[2][:, 1:]
    variance = np.einsum("nii->n", across @ answers.covariance @ across.swapaxes(1, 2))
    np.testing.assert_allclose(answers.figures[0], np.sqrt(variance / 2), rtol=1e-3)


def test_the_domain_sees_where_accelerometer_and_velocities_disagree():
    net = GravityNet(aided=True, width=4, seed=1)
    f_b_mps2 = torch.zeros((1, SAMPLES, 3))
    f_b_mps2[:, :, 2] = -9.81
    t_s = torch.arange(1 - VELOCITIES, 1) / 10
    level = torch.tensor([50.0, 0.0, 0.0]).expand(1, VELOCITIES, 3)
    surging = level + 20.0 * t_s[None, :, None] * torch.tensor([1.0, 0.0, 0.0])
    key = "accelerometer_less_velocities_mps2"
    agree, fault = (
        figures_of_windows(net, f_b_mps2, net.motion(v), net(f_b_mps2, v)[1])
        for v in (level, surging)
    )
    assert abs(float(agree[key])) < 1e-4
    assert float(fault[key]) == pytest.approx(9.81 - np.hypot(20.0, 9.81), rel=1e-4)
    alone = GravityNet(aided=False, width=4, seed=1)
    figures = figures_of_windows(alone, f_b_mps2, None, alone(f_b_mps2)[1])
    assert key not in figures
    assert next(iter(figures)) == SIGMA


def test_both_networks_share_one_architecture_and_the_factor_has_what_its_manifest_needs():
    for aided in (True, False):
        seen = (torch.randn((2, SAMPLES, 3)), torch.randn((2, VELOCITIES, 3)))[: 2 if aided else 1]
        with torch.no_grad():
            g_b, cholesky, *figures = GravityFactor(GravityNet(aided=aided, width=4, seed=1))(*seen)
        assert g_b.shape == (2, 3)
        assert cholesky.shape == (2, 6)
        assert len(figures) == (9 if aided else 5)


def test_its_manifest_states_how_long_errors_last_as_measured(network):
    output = network[2].manifest.output
    assert (output.half_life_s, output.lasting) == (4.4, 0.25)
    assert (output.measures, output.covariance.form) == ("direction", "cholesky")
