"""Azimuth and elevation of a baseline: what two antennas determine, whatever turns about it."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.attitude.baseline_angles import baseline_angles, reported_baselines
from fgnav.evaluation.comparison import compare
from fgnav.evaluation.report.summary import method_table
from fgnav.evaluation.scores import baseline_errors_rad
from fgnav.geometry.rotations import exp, from_euler
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Antenna, Flight, Truth
from tests.evaluation.conftest import MADRID

N = 4000
UNIT_B = np.array([0.6, 0.64, -0.48])


@dataclass(frozen=True)
class Given:
    estimate: Estimate
    name: str = "m"

    def __call__(self, _):
        return self.estimate


def drawn(rng):
    """Return a true attitude at N times, and an estimate that is open about the baseline."""
    R_nb = from_euler(*np.tile([[0.2], [-0.4], [2.8]], (1, N)))
    across = np.linalg.svd(UNIT_B[None])[2][1:]
    root = np.array([[0.01, 0.0], [0.004, 0.006]]) @ across
    tangent = rng.normal(size=(N, 2)) @ root
    open_rad = rng.uniform(-np.pi, np.pi, N)
    P = root.T @ root + np.pi**2 / 3 * np.outer(UNIT_B, UNIT_B)
    t_s = np.arange(float(N))
    turned = exp(open_rad[:, None] * UNIT_B)
    zero = np.zeros((N, 3))
    truth = Truth(t_s=t_s, p_n_m=zero, v_n_mps=zero, R_nb=R_nb @ exp(tangent) @ turned)
    covariance = np.tile(P, (N, 1, 1))
    estimate = Estimate(
        method="m", t_s=t_s, n_epochs=N, R_nb=R_nb, attitude_covariance_rad2=covariance
    )
    return truth, estimate


def test_angles_err_by_their_sigma_however_open_the_rotation_about_the_baseline_is():
    truth, estimate = drawn(np.random.default_rng(3))
    angles = baseline_angles(estimate, UNIT_B)
    errors = baseline_errors_rad(angles, truth, UNIT_B)
    ratio = (errors / angles.sigma_rad).std(axis=0)
    np.testing.assert_allclose(ratio, 1.0, atol=4 / np.sqrt(2 * N))
    assert angles.sigma_rad.max() < 0.02
    places = (np.zeros(3), 2.0 * UNIT_B)
    antennas = tuple(Antenna(name=f"a{k}", position_b_m=place) for k, place in enumerate(places))
    flight = Flight(name="f", start_gps_s=0.0, origin=MADRID, antennas=antennas, truth=truth)
    comparison = compare(flight, [Given(replace(estimate, unobservable=("attitude",)))])
    (figures,) = comparison["m"].score.baselines
    assert abs(figures.nees_mean - 2.0) < 4 * np.sqrt(4 / N)
    assert f"{figures.nees_mean:.2f} of 2" in method_table(comparison).rows[0]


def test_antennas_in_a_line_have_one_and_others_none():
    places = [(0, 0, 0), (0.5, 0, -0.5), (1, 0, -1), (0, 1, 0)]
    antennas = tuple(
        Antenna(name=f"a{k}", position_b_m=np.array(place, float))
        for k, place in enumerate(places, start=1)
    )
    flight = Flight(name="f", start_gps_s=0.0, origin=MADRID, antennas=antennas[:3])
    (found,) = reported_baselines(flight).items()
    assert found[0] == "a1 to a3"
    np.testing.assert_allclose(found[1], np.array([1, 0, -1]) / np.sqrt(2))
    assert not reported_baselines(replace(flight, antennas=antennas))
    assert not reported_baselines(replace(flight, antennas=antennas[:1]))
