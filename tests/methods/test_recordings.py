"""Real recordings with their data sheets' noise and default settings: answered, and right where it is known."""

import numpy as np
import pytest

from fgnav.geometry.rotations import to_euler, wrap
from fgnav.methods.smoother import Batch
from tests.recordings import quadrotor


@pytest.mark.parametrize("path", ["path_10", "path_15"])
def test_a_quadrotor_s_vibration_is_noise_and_no_contradiction(path, shared):
    """Its accelerometer is a hundred times as loud as stated; the autopilot has its own mounting."""
    flight = quadrotor(shared, path)
    estimate = Batch()(flight)
    assert estimate.converged
    assert len(estimate.t_s) > 0.98 * estimate.epochs
    table = np.genfromtxt(
        shared / "flights" / "quadrotor" / path / "GT.csv", delimiter=",", skip_header=1
    )
    inside = (estimate.t_s > table[0, 0]) & (estimate.t_s < table[-1, 0])
    theirs = np.interp(estimate.t_s[inside], table[:, 0], np.unwrap(np.radians(table[:, 3])))
    off = to_euler(estimate.R_nb[inside])[:, 2] - theirs
    off = wrap(off - np.angle(np.exp(1j * off).mean()))
    assert np.degrees(np.sqrt((off**2).mean())) < 2.0
