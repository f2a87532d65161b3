"""Recordings with the noise of data sheets and default settings: right, where that is known."""

import numpy as np

from fgnav.assembly.truncation import truncated
from fgnav.geometry.rotations import to_euler, wrap
from fgnav.methods.smoother import Batch
from tests.recordings import drive, quadrotor


def test_a_quadrotor_s_vibration_is_noise_and_no_contradiction(shared):
    """A hundred times what is stated; the autopilot has its own mounting."""
    path = "path_10"
    flight = quadrotor(shared, path)
    estimate = Batch()(flight)
    assert estimate.converged
    assert len(estimate.t_s) > 0.98 * estimate.n_epochs
    table = np.genfromtxt(
        shared / "flights" / "quadrotor" / path / "GT.csv", delimiter=",", skip_header=1
    )
    inside = (estimate.t_s > table[0, 0]) & (estimate.t_s < table[-1, 0])
    theirs = np.interp(estimate.t_s[inside], table[:, 0], np.unwrap(np.radians(table[:, 3])))
    off = to_euler(estimate.R_nb[inside])[:, 2] - theirs
    off = wrap(off - np.angle(np.exp(1j * off).mean()))
    assert np.degrees(np.sqrt((off**2).mean())) < 2.0


def test_a_car_s_late_velocities_and_stretched_clock_are_found(shared):
    """Two minutes: by all nine its velocities are .128 s old, its clock runs 261 ppm slow."""
    estimate = Batch()(truncated(drive(shared, stretched=True), 120.0))
    assert estimate.converged
    constants = {one.name: one for one in estimate.calibration}
    assert 0.115 < constants["velocity delay"].value[0] < 0.140
    rate_ppm = constants["clock rate"].value[0]
    assert abs(rate_ppm + 261.0) < 3 * np.sqrt(constants["clock rate"].covariance[0, 0])
