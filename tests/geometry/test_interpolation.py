"""Straight lines between samples, and what they sum up to."""

import numpy as np

from fgnav.geometry.interpolation import integral, interpolate

SAMPLES_S = np.array([0.0, 1.0, 3.0])
VALUES = np.array([[0.0, 6.0], [2.0, 4.0], [6.0, 0.0]])  # 2 t, 6 - 2 t


def test_lines_are_met_and_end_with_the_samples():
    t_s = np.array([-1.0, 0.5, 2.0, 9.0])
    np.testing.assert_allclose(
        interpolate(t_s, SAMPLES_S, VALUES), [[0, 6], [1, 5], [4, 2], [6, 0]], rtol=0, atol=1e-15
    )
    np.testing.assert_array_equal(
        interpolate(t_s, SAMPLES_S, VALUES, causal=True), VALUES[[0, 0, 1, 2]]
    )


def test_integrals_of_lines_are_exact():
    t = SAMPLES_S[:, None]
    np.testing.assert_allclose(
        integral(SAMPLES_S, VALUES), np.hstack([t**2, 6 * t - t**2]), rtol=0, atol=1e-15
    )
