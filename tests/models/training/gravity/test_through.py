"""How a network's errors are counted where it is trained through the smoother."""

from math import ceil

import numpy as np
import pytest
import torch

from fgnav.neural import NeuralFactor, read_manifest
from fgnav_models.runtime.factors import manifest
from fgnav_models.training.gravity.through import DrawnFlights, Errors, symmetric_root


def test_the_root_of_a_covariance_is_symmetric_and_its_own_square_root():
    factor = np.random.default_rng(1).normal(size=(20, 2, 2)) * np.array([[[1.0], [30.0]]])
    P = torch.from_numpy(factor @ factor.swapaxes(1, 2))
    root = symmetric_root(P)
    values, axes = np.linalg.eigh(P.numpy())
    expected = axes * np.sqrt(values)[:, None] @ axes.swapaxes(1, 2)
    np.testing.assert_allclose(root.numpy(), expected, rtol=1e-9, atol=1e-9)


def test_errors_are_counted_as_the_released_factor_counts_them():
    factor = NeuralFactor(manifest("gravity"))
    stated = read_manifest(factor.manifest).output
    errors = Errors.of(factor, stated.half_life_s, stated.lasting)
    assert errors.interval_s == pytest.approx(2 * stated.half_life_s)
    assert errors.inflation == pytest.approx(5 / 3)
    assert errors.constant == factor.constants[0].name
    drawn = DrawnFlights(flights=[None], batch=1, errors=errors, seed=1)
    firsts = {int(drawn(step)[0][0, 1]) for step in range(200)}
    assert firsts == set(range(ceil(10 * errors.interval_s - 1e-6)))  # windows ten times a second
