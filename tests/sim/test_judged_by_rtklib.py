"""Flights as files: RTKLIB finds the vehicle in them, and residuals are as large as stated."""

import numpy as np
import pytest

from fgnav.gnss.difference import double_differences
from fgnav.io.flight.folder import load_flight, save_flight
from fgnav_sim.gnss.tables import GnssTable, LossOfLockTable, OutageTable, SlipsTable
from fgnav_sim.scenario import Scenario
from fgnav_sim.simulate import simulate
from tests.gnss import rtklib
from tests.sim import moving_base
from tests.sim.motions import SWING
from tests.sim.statistics import whitened_square

ROUGH = {
    "slips": SlipsTable(rate_per_hour=60.0),
    "loss_of_lock": LossOfLockTable(rate_per_hour=60.0),
    "outages": (OutageTable(from_s=10.0, until_s=15.0, azimuth_deg=(0.0, 90.0)),),
}


def written(folder, *, duration_s=30.0, rinex="3.04", **gnss):
    scenario = Scenario(
        duration_s=duration_s,
        motion=SWING,
        antennas_b_m=((0.0, 0.0, 0.0), (0.0, 0.1, 0.0), (1.0, 0.0, 0.0), (-0.8, 0.0, -0.1)),
        gnss=GnssTable(code_noise_m=0.3, **gnss),
    )
    flight = simulate(scenario, np.random.default_rng(1))
    save_flight(flight, folder, rinex=rinex)
    return flight


@pytest.mark.parametrize("interruptions", [{}, ROUGH])
def test_rtklib_positions_the_vehicle_within_three_metres(tmp_path, interruptions):
    signals = {"G": ("1C",), "E": ("1C",), "C": ("2I",)}
    flight = written(tmp_path / "flight", signals=signals, rate_hz=2.0, **interruptions)
    nav = rtklib.navigation(tmp_path / "flight" / "broadcast.rnx")
    t_s, p_e_m = rtklib.point_positions(tmp_path / "flight" / "a1.rnx", nav)
    assert len(t_s) == 60
    epoch = np.round(t_s * 10).astype(int)
    error_m = flight.origin.to_n(p_e_m) - flight.truth.p_n_m[epoch]
    assert np.linalg.norm(error_m, axis=1).max() < 3.0
    assert np.abs(error_m.mean(axis=0)).max() < 1.0  # no model of ours that RTKLIB has not


def test_rtklib_fixes_the_baselines_of_a_moving_base_within_two_centimetres(tmp_path):
    flight = written(
        tmp_path / "flight",
        duration_s=60.0,
        rate_hz=5.0,
        signals={"G": ("1C",), "E": ("1C",), "C": ("2I",)},
        elevation_weights="uniform",
    )
    for antenna in flight.antennas[1:]:
        t_s, status, arm_e_m = moving_base.baselines(tmp_path / "flight", antenna.name)
        assert len(t_s) == 300
        fixed = status == moving_base.FIXED
        assert fixed.mean() >= 0.95
        truth = flight.truth.R_nb[np.round(t_s * 10).astype(int)] @ antenna.position_b_m
        error_m = np.linalg.norm(arm_e_m @ flight.origin.R_ne.T - truth, axis=1)
        assert error_m[fixed].max() < 0.02


def test_rtklib_reads_rinex_4_as_it_reads_rinex_3(tmp_path):
    signals = {"G": ("1C",), "E": ("1C",), "C": ("2I",)}
    found = []
    for rinex in ("3.04", "4.00"):
        folder = tmp_path / rinex
        written(folder, duration_s=5.0, rate_hz=2.0, rinex=rinex, signals=signals)
        nav = rtklib.navigation(folder / "broadcast.rnx")
        for k in range(8):  # its ionosphere is the header's, which RINEX 4 has not
            nav.ion_gps[k] = 0.0
        found.append((nav.n, *rtklib.point_positions(folder / "a1.rnx", nav)))
    (third, third_s, third_m), (fourth, fourth_s, fourth_m) = found
    assert third == fourth
    np.testing.assert_array_equal(third_s, fourth_s)
    np.testing.assert_array_equal(third_m, fourth_m)


@pytest.mark.parametrize("weights", ["uniform", "sine"])
@pytest.mark.parametrize("interruptions", [{}, ROUGH])
def test_residuals_of_the_true_integers_fill_the_stated_covariance(
    tmp_path, weights, interruptions
):
    flight = written(tmp_path / "flight", elevation_weights=weights, **interruptions)
    differences = double_differences(load_flight(tmp_path / "flight"))
    array_m = differences.array_m(flight.truth.R_nb)
    phase_m = differences.phase_m - array_m
    integers = np.round(phase_m / differences.wavelength_m)
    phase = phase_m - integers * differences.wavelength_m
    code = differences.code_m - array_m
    for residual_m, variance_m2 in (
        (phase, differences.phase_variance_m2),
        (code, differences.code_variance_m2),
    ):
        square, freedom = whitened_square(differences, residual_m, variance_m2)
        assert freedom > 4000
        assert square == pytest.approx(freedom, abs=4 * np.sqrt(2 * freedom))
    changes = np.diff(integers, axis=0) != 0
    same_arc = (differences.arc[1:] == differences.arc[:-1]) & (differences.arc[1:] >= 0)
    assert not changes[same_arc].any()
    assert (differences.arc.max() > 0) == bool(interruptions)
