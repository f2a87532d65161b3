"""Gravity, line of sight and magnetic field: unit vectors in body axes."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest

from fgnav.geometry.rotations import exp
from fgnav.graph import keys
from fgnav.graph.factors.directions import Directions
from fgnav.graph.factors.gravity import Gravity
from fgnav.graph.factors.line_of_sight import LineOfSight
from fgnav.graph.factors.magnetometer import MagneticField
from tests.graph.factors import cases

K, ALL = 4, np.arange(4)


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def across(rng, e_b):
    """Return whitening rows of an ellipse of 0.2 to 1 degree across directions."""
    root = np.radians(rng.uniform(0.2, 1.0, size=(len(e_b), 3, 1))) * exp(rng.normal(size=(K, 3)))
    return Directions.of("some", e_b, root @ root.swapaxes(1, 2)).across_b


def gravity(rng, shared, at, *, tilt: bool) -> Gravity:
    known_n = unit(np.array([0.0, 0.0, 1.0]) + 0.01 * rng.normal(size=(K, 3)))
    e_b = unit(np.einsum("nji,nj->ni", at.R_nb, known_n) + 0.02 * rng.normal(size=(K, 3)))
    return Gravity(
        row=ALL,
        known_n=known_n,
        across_b=across(rng, e_b),
        tilt_column=shared.column("b") if tilt else -1,
        constants=shared,
    )


def sight(rng, shared, at, *, boresight: bool) -> LineOfSight:
    first = shared.column("a")
    away_n = at.constants[first : first + 3] - at.p_n_m
    e_b = unit(np.einsum("nji,nj->ni", at.R_nb, unit(away_n)) + 0.02 * rng.normal(size=(K, 3)))
    return LineOfSight(
        row=ALL,
        across_b=across(rng, e_b),
        landmark_column=first,
        boresight_column=shared.column("b") if boresight else -1,
        constants=shared,
    )


def field(rng, shared, at, *, iron: bool) -> MagneticField:
    field_n_ut = np.array([20.0, 1.0, 45.0])
    e_b = unit(np.einsum("nji,j->ni", at.R_nb, field_n_ut) + rng.normal(size=(K, 3)))
    return MagneticField(
        row=ALL,
        across_b=across(rng, e_b),
        field_n_ut=field_n_ut,
        iron_column=shared.column("a") if iron else -1,
        constants=shared,
    )


def each(rng, at, shared):
    return [
        build(rng, shared, at, **{word: flag})
        for build, word in ((gravity, "tilt"), (sight, "boresight"), (field, "iron"))
        for flag in (False, True)
    ]


@pytest.mark.parametrize("which", range(6))
@pytest.mark.parametrize("gyroscope", [False, True])
def test_derivatives_are_differences_and_gtsam_says_the_same(which, gyroscope):
    rng, shared = np.random.default_rng(1), cases.constants(3, 2)
    at = cases.random_states(K, shared, rng, gyroscope=gyroscope)
    cases.assert_factor(each(rng, at, shared)[which], at, shared)


def test_a_field_against_the_measured_one_is_further_off_than_one_across():
    """Its sine is zero there: an accelerometer reversed was a body upside down, NEES 3e7."""
    rng, shared = np.random.default_rng(9), cases.constants(3)
    at = cases.random_states(K, shared, rng)
    one = replace(field(rng, shared, at, iron=True), across_b=across_b_of_a_degree(at))
    for turn_rad, least, most in ((1.5, 57.0, 58.0), (2.5, 75.0, 85.0), (3.0, 100.0, 112.0)):
        beside_n = unit(np.cross(one.field_n_ut, [0.0, 1.0, 0.0]))
        turned = at._replace(R_nb=exp(turn_rad * beside_n[None]) @ at.R_nb, constants=np.zeros(3))
        size = np.linalg.norm(one.linearise(turned, ALL).value, axis=1)
        assert ((size > least) & (size < most)).all()
        cases.assert_jacobians(one, turned)


def across_b_of_a_degree(at):
    field_b = np.einsum("nji,j->ni", at.R_nb, np.array([20.0, 1.0, 45.0]))
    return Directions.isotropic(unit(field_b), np.radians(1.0)).across_b


def test_a_degree_off_a_round_direction_is_a_degree_in_sigmas():
    shared = cases.constants()
    at = cases.random_states(1, shared, np.random.default_rng(3))
    at = at._replace(R_nb=exp(np.radians([[1.0, 0.0, 0.0]])))
    down_b = np.array([[0.0, 0.0, 1.0]])
    one = Gravity(
        row=ALL[:1],
        known_n=down_b,
        across_b=Directions.isotropic(down_b, np.radians(0.5)).across_b,
        tilt_column=-1,
        constants=shared,
    )
    size = np.linalg.norm(one.linearise(at, ALL[:1]).value)
    assert size == pytest.approx(2.0, rel=1e-4)  # sine for angle: half of 1e-4


def test_a_line_of_sight_is_gtsams_bearing_near_a_round_direction():
    rng, shared = np.random.default_rng(4), cases.constants(3)
    at = cases.random_states(K, shared, rng)
    way_b = unit(np.einsum("nji,nj->ni", at.R_nb, at.constants - at.p_n_m))
    e_b = unit(way_b + 1e-4 * rng.normal(size=(K, 3)))
    part = LineOfSight(
        row=ALL,
        across_b=Directions.isotropic(e_b, 1e-3).across_b,
        landmark_column=0,
        boresight_column=-1,
        constants=shared,
    )
    unit_noise = gtsam.noiseModel.Isotropic.Sigma(2, 1e-3)
    for i in ALL:
        values = cases.values_of(at, i, shared, 7)
        measured = gtsam.Unit3(e_b[i])
        native = gtsam.BearingFactor3D(keys.pose(7), keys.constant(0), measured, unit_noise)
        A, minus_r = native.linearize(values).jacobian()
        B, minus_s = part.factor(i, 7).linearize(values).jacobian()
        np.testing.assert_allclose(B.T @ B, A.T @ A, rtol=0, atol=1e-3 * np.abs(A.T @ A).max())
        np.testing.assert_allclose(minus_s @ minus_s, minus_r @ minus_r, rtol=1e-6)


def test_the_size_of_a_hard_iron_along_the_field_does_not_count():
    rng, shared = np.random.default_rng(5), cases.constants(3)
    at = cases.random_states(K, shared, rng)
    at = at._replace(R_nb=np.tile(np.eye(3), (K, 1, 1)))
    part = field(rng, shared, at, iron=True)
    values = [
        part.linearise(at._replace(constants=share * part.field_n_ut), ALL).value
        for share in (0.0, -0.5, 3.0)
    ]
    np.testing.assert_allclose(values[1], values[0], rtol=0, atol=1e-10)
    np.testing.assert_allclose(values[2], values[0], rtol=0, atol=1e-10)
