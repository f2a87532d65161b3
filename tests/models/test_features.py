import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav_models.features import (
    INPUTS,
    ambiguity_inputs,
    by_elevation,
    double_differences,
)


def inputs(names, n=3, d=4, m=3):
    rng = np.random.default_rng(0)
    e_n = rng.normal(size=(n, m, 3))
    e_n /= np.linalg.norm(e_n, axis=2, keepdims=True)
    return ambiguity_inputs(
        names,
        range_cycles=rng.normal(size=(n, d)),
        phase_cycles=rng.normal(size=(n, d)),
        e_n=e_n,
        t_s=np.arange(n) * 3600.0,
    )


def test_double_differences_are_baseline_by_baseline_and_free_of_clocks():
    rng = np.random.default_rng(1)
    links = rng.normal(size=(5, 3, 4))
    differences = double_differences(links)
    assert differences.shape == (5, 6)
    by_hand = links[:, 2, 3] - links[:, 0, 3] - links[:, 2, 0] + links[:, 0, 0]
    np.testing.assert_allclose(differences[:, 5], by_hand, rtol=0, atol=1e-14)
    clocks = rng.normal(size=(5, 3, 1)) + rng.normal(size=(5, 1, 4))
    np.testing.assert_allclose(double_differences(links + clocks), differences, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("name", "columns"),
    [("range", 4), ("phase", 8), ("constellation", 1), ("geometry", 6), ("time", 32)],
)
def test_each_input_has_its_columns(name, columns):
    assert inputs((name,)).shape == (3, columns)


def test_phase_is_seen_without_its_whole_cycles():
    arguments = {"range_cycles": np.zeros((2, 1)), "e_n": np.ones((2, 2, 3)), "t_s": np.zeros(2)}
    phase = np.array([[0.3], [7.3]])
    seen = ambiguity_inputs(("phase",), phase_cycles=phase, **arguments)
    np.testing.assert_allclose(seen[0], seen[1], rtol=0, atol=1e-6)


def test_what_is_missing_becomes_zero():
    nothing = np.full((1, 2), np.nan)
    e_n = np.array([[[0, 0, -1.0], [1, 0, 0], [0, 0, 0]]])
    seen = ambiguity_inputs(
        INPUTS, range_cycles=nothing, phase_cycles=nothing, e_n=e_n, t_s=np.zeros(1)
    )
    assert np.isfinite(seen).all()
    np.testing.assert_array_equal(seen[0, :6], 0.0)  # ranges, sines and cosines of phases
    assert seen[0, 6] == 99.0  # two satellites fix no position
    np.testing.assert_array_equal(seen[0, 7:13], [1, 0, 1, 0, 0, 0])  # differences to the first


def test_four_satellites_dilute_as_the_textbook_says():
    s = np.sqrt(8 / 9)  # one at the zenith, three evenly spread 19.5 degrees below the horizon
    angles = np.radians([0, 120, 240])
    others = np.column_stack([s * np.cos(angles), s * np.sin(angles), np.full(3, 1 / 3)])
    e_n = np.concatenate([[[0, 0, -1.0]], others])[None]
    arguments = {"range_cycles": np.zeros((1, 1)), "phase_cycles": np.zeros((1, 1))}
    seen = ambiguity_inputs(("constellation",), e_n=e_n, t_s=np.zeros(1), **arguments)
    # A regular tetrahedron: sum of e eᵀ is 4/3 of the identity, so each axis has variance 3/4.
    np.testing.assert_allclose(seen, np.sqrt(9 / 4), rtol=1e-6, atol=0)


def test_satellites_stand_by_falling_elevation_and_empty_slots_last():
    order = by_elevation(np.array([[0.3, np.nan, 1.2, 0.3]]))
    np.testing.assert_array_equal(order, [[2, 0, 3, 1]])


@pytest.mark.parametrize("names", [(), ("range", "clock")])
def test_unknown_inputs_are_refused(names):
    with pytest.raises(BadInputError, match="inputs: must be some of range, phase"):
        inputs(names)
