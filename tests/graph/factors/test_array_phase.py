import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.geometry.rotations import exp
from fgnav.graph.factors.array_phase import ArrayPhase
from tests.graph.factors import cases

K = 4


def phases(rng, shared, *, stretch: bool = False, lasting: int = 0) -> ArrayPhase:
    column = np.full(K, -1)
    if stretch:
        column[1:3] = shared.column("b")
    return ArrayPhase(
        row=np.arange(K),
        root=100 * rng.normal(size=(K, 9, 9)),
        minimum=exp(rng.normal(size=(K, 3, 3))[0]).repeat(2, 0)[:K],
        element_column=column,
        constants=shared,
        share=np.linspace(0.0, 0.9, K),
        basis=np.linalg.qr(rng.normal(size=(9, 9)))[0][:, :lasting],
    )


def with_lasting(at, rng, size):
    return at._replace(aux=np.hstack([at.aux, rng.normal(size=(len(at.aux), size))]))


@pytest.mark.parametrize("gyroscope", [False, True])
@pytest.mark.parametrize("stretch", [False, True])
def test_derivatives_are_differences_and_gtsam_says_the_same(gyroscope, stretch):
    rng, shared = np.random.default_rng(1), cases.constants(2, 9)
    at = cases.random_states(K, shared, rng, gyroscope=gyroscope)
    cases.assert_factor(phases(rng, shared, stretch=stretch), at, shared)


@pytest.mark.parametrize("stretch", [False, True])
def test_a_lasting_error_is_a_part_of_the_keyframes_vector(stretch):
    rng, shared = np.random.default_rng(6), cases.constants(2, 9)
    at = with_lasting(cases.random_states(K, shared, rng), rng, 6)
    form = phases(rng, shared, stretch=stretch, lasting=6)
    cases.assert_jacobians(form, at)
    cases.assert_gtsam_says_the_same(form, at, shared)


def test_what_lasts_is_no_longer_white():
    rng, shared = np.random.default_rng(7), cases.constants()
    at = with_lasting(cases.random_states(K, shared, rng), rng, 3)
    form = phases(rng, shared, lasting=3)
    s = form.share[:, None]
    apart = (at.R_nb - form.minimum).reshape(K, 9)
    off = np.einsum("kij,kj->ki", form.root, apart) + np.sqrt(s) * (at.aux[:, 12:] @ form.basis.T)
    value = form.linearise(at, np.arange(K)).value
    np.testing.assert_allclose(value, off / np.sqrt(1 - s), rtol=1e-12, atol=1e-12)


def test_residual_vanishes_at_the_minimum():
    rng, shared = np.random.default_rng(3), cases.constants()
    at = cases.random_states(K, shared, rng)
    form = phases(rng, shared)
    at = at._replace(R_nb=form.minimum)
    assert np.abs(form.linearise(at, np.arange(K)).value).max() < 1e-12


def test_rows_of_zeros_are_no_degrees_of_freedom():
    rng = np.random.default_rng(4)
    form = phases(rng, cases.constants())
    root = form.root.copy()
    root[0, 5:] = 0.0
    lessened = ArrayPhase(
        row=form.row,
        root=root,
        minimum=form.minimum,
        element_column=form.element_column,
        constants=form.constants,
    )
    assert lessened.freedom.tolist() == [5, 9, 9, 9]


def test_a_wrong_shape_is_named():
    with pytest.raises(BadInputError, match="array phases root: expected shape"):
        ArrayPhase(
            row=np.arange(2),
            root=np.zeros((2, 9, 8)),
            minimum=np.zeros((2, 3, 3)),
            element_column=np.full(2, -1),
            constants=cases.constants(),
        )


def test_the_same_measurements_stand_on_other_rows():
    form = phases(np.random.default_rng(5), cases.constants())
    moved = form.on(form.row + 3)
    assert moved.row.tolist() == [3, 4, 5, 6]
    assert np.array_equal(moved.root, form.root)
