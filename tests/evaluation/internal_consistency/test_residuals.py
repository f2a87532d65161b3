"""Residuals by satellite: none of a right estimate, and an error where it was put."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.evaluation.internal_consistency.residuals import (
    antenna_residuals,
    array_phase_residuals,
)
from fgnav.geometry import rotations
from fgnav.gnss.undifferenced import Undifferenced
from fgnav.types.estimate import Estimate

N, M = 50, 7
ARM_B_M = np.array([0.4, -0.2, 0.1])
BASELINES_B_M = np.array([[0.9, 0.0, 0.0], [0.0, 0.8, 0.0], [0.0, 0.1, 0.7]])


def mean_free(error_m):
    """Return what clocks leave of an error of each channel."""
    return error_m - error_m.mean()


@pytest.fixture
def estimate():
    t_s = np.arange(N) * 0.1
    R_nb = rotations.from_euler(0.1 + 0 * t_s, 0.2 * t_s, 0.3 * t_s)
    p_n_m = np.stack([30 * t_s, 5 * t_s, -t_s], axis=1)
    return Estimate(method="right", t_s=t_s, n_epochs=N, R_nb=R_nb, p_n_m=p_n_m)


@pytest.fixture
def observed(estimate):
    """Return observations without error, modelled 8 m beside, with clocks and ambiguities."""
    rng = np.random.default_rng(3)
    e_n = rng.standard_normal((M, 3))
    e_n = np.tile(e_n / np.linalg.norm(e_n, axis=1)[:, None], (N, 1, 1))
    antenna_n_m = estimate.p_n_m + estimate.R_nb @ ARM_B_M
    place_n_m = antenna_n_m + rng.uniform(-5, 5, (N, 3))
    away_m = -np.einsum("nmi,ni->nm", e_n, antenna_n_m - place_n_m)
    clock_m = 1e3 * rng.standard_normal((N, 1))
    arc = np.zeros((N, M), dtype=np.int64)
    arc[20:, 2] = 1
    ambiguity_m = np.where(arc, 17.3, np.arange(M) * 2.1)
    return Undifferenced(
        t_s=estimate.t_s,
        place_n_m=place_n_m,
        e_n=e_n,
        phase_m=away_m + clock_m + ambiguity_m,
        code_m=away_m + clock_m,
        arc=arc,
        phase_sigma_m=np.full((N, M), 0.003),
        code_sigma_m=np.full((N, M), 0.3),
        error_sigma_m=np.ones((N, M)),
        error_rate_mps=np.full(N, 1e-3),
        error_walk_m_per_sqrt_s=np.full(N, 1e-3),
        satellites=tuple(f"G{k:02d}" for k in range(M)),
        signals=("1C",) * M,
        group=np.zeros(M, dtype=np.int64),
        wavelength_m=np.full(M, 0.1903),
        integers=False,
        pole_n=None,
        losses=(),
    )


def test_right_positions_leave_nothing_of_code_and_phase(estimate, observed):
    for of_phase in (False, True):
        left = antenna_residuals(observed, estimate, ARM_B_M, of_phase=of_phase)
        assert np.abs(left.value_m).max() < 1e-6
        assert left.channels[0] == "G00 1575"
        assert len(left.t_s) == N


def test_an_error_of_one_satellite_stands_in_its_row(estimate, observed):
    error_m = np.zeros(M)
    error_m[4] = 2.0
    wrong = replace(observed, code_m=observed.code_m + error_m)
    left = antenna_residuals(wrong, estimate, ARM_B_M, of_phase=False)
    np.testing.assert_allclose(left.value_m, np.tile(mean_free(error_m), (N, 1)), atol=1e-6)


def test_a_constant_of_an_arc_is_its_ambiguity_and_a_drift_is_not(estimate, observed):
    drift_m = np.zeros((N, M))
    drift_m[:, 5] = np.linspace(-1, 1, N)
    drifting = replace(observed, phase_m=observed.phase_m + drift_m)
    left = antenna_residuals(drifting, estimate, ARM_B_M, of_phase=True)
    # All arcs but that of the slip last throughout: what it takes of the drift is theirs to share.
    assert left.value_m[:, 5].std() > 0.8 * drift_m[:, 5].std()
    assert np.abs(np.delete(left.value_m, 5, axis=1)).max() < 0.2


def test_without_positions_there_are_no_residuals_of_one_antenna(estimate, observed):
    nowhere = replace(estimate, p_n_m=None)
    assert antenna_residuals(observed, nowhere, ARM_B_M, of_phase=False) is None


def test_a_right_attitude_leaves_nothing_of_the_array_and_a_wrong_satellite_shows(
    estimate, array_differences
):
    differences = array_differences(estimate.R_nb, BASELINES_B_M, np.random.default_rng(1), M)
    left = array_phase_residuals(differences, estimate)
    assert left.value_m.max() < 1e-6
    echo_m = np.zeros(M)
    echo_m[4] = 0.02
    wrong = replace(differences, phase_m=differences.phase_m + echo_m)
    expected_m = np.abs(mean_free(echo_m))
    left = array_phase_residuals(wrong, estimate)
    np.testing.assert_allclose(left.value_m, np.tile(expected_m, (N, 1)), atol=1e-6)


def test_a_wrong_attitude_shows_in_the_array(estimate, array_differences):
    differences = array_differences(estimate.R_nb, BASELINES_B_M, np.random.default_rng(1), M)
    turned = replace(estimate, R_nb=estimate.R_nb @ rotations.exp(np.array([[0.0, 0.0, 0.05]])))
    # 0.05 rad of a metre: 5 cm across, a part of which each satellite sees.
    assert np.median(array_phase_residuals(differences, turned).value_m) > 0.01
