"""Every sensor: its Jacobians, its form in GTSAM, and what its residual means."""

from dataclasses import replace
from functools import partial

import gtsam
import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.geometry.rotations import exp, from_euler
from fgnav.graph import keys
from fgnav.graph.factors.array_phase import ArrayPhase
from fgnav.graph.factors.directions import Directions
from tests.graph.factors import cases, sensors
from tests.graph.factors.sensors import ALL, EARTH_N_RADPS, FIELD_N_UT, SHARED, K, column, unit

SENSORS = {
    "position": sensors.position,
    "position, lever arm": partial(sensors.position, lever=True),
    "velocity": sensors.velocity,
    "velocity at the accelerometer": partial(sensors.velocity, arm=False),
    "velocity, lever arm": partial(sensors.velocity, lever=True),
    "velocity, lever arm alone": partial(sensors.velocity, lever=True, arm=False),
    "height": partial(sensors.height, offset=False),
    "height, offset": sensors.height,
    "heading": partial(sensors.baseline, dimensions=1),
    "baseline's direction": partial(sensors.baseline, dimensions=2),
    "baseline": sensors.baseline,
    "array": sensors.array_shape,
    "array, antennas moved": partial(sensors.array_shape, moved=("a", "c")),
    "array phases": sensors.array_phase,
    "array phases, stretch": partial(sensors.array_phase, stretch=True),
    "array phases, lasting": partial(sensors.array_phase, lasting=6),
    "array phases, both": partial(sensors.array_phase, stretch=True, lasting=6),
    "gravity": sensors.gravity,
    "gravity, tilt": partial(sensors.gravity, tilt=True),
    "line of sight": sensors.sight,
    "line of sight, boresight": partial(sensors.sight, boresight=True),
    "magnetic field": sensors.field,
    "magnetic field, hard iron": partial(sensors.field, iron=True),
    "fins": sensors.fins,
    "wheels": sensors.wheels,
    "standstill": sensors.standstill,
    "resting rate": sensors.resting,
}
WITH, WITHOUT = {"resting rate"}, {"fins"}  # a gyroscope alone
CASES = [
    *((name, True) for name in SENSORS if name not in WITHOUT),
    *((name, False) for name in SENSORS if name not in WITH),
]


def states(rng, *, gyroscope=False, **changes):
    """Return random states; those that are given, at every keyframe."""
    at = cases.random_states(K, SHARED, rng, gyroscope=gyroscope)
    return at._replace(**{name: np.tile(x, (K, *[1] * np.ndim(x))) for name, x in changes.items()})


@pytest.mark.parametrize(("name", "gyroscope"), CASES)
def test_jacobians_are_differences_and_gtsam_says_the_same(name, gyroscope):
    rng = np.random.default_rng(1)
    at = states(rng, gyroscope=gyroscope)
    sensor = SENSORS[name](rng, at)
    if getattr(sensor, "basis", np.empty((0, 0))).size:
        at = at._replace(aux=np.hstack([at.aux, rng.normal(size=(K, 6))]))
    cases.assert_jacobians(sensor, at)
    cases.assert_gtsam_says_the_same(sensor, at, SHARED)


def test_an_antenna_two_metres_ahead_is_two_metres_north_of_a_body_facing_north():
    rng = np.random.default_rng(3)
    at, ahead = states(rng, R_nb=np.eye(3), p_n_m=np.zeros(3)), np.array([2.0, 0.0, 0.0])
    one = replace(sensors.position(rng, at), value_n_m=np.tile(ahead, (K, 1)), arm_b_m=ahead)
    assert np.abs(one.linearise(at, ALL).value).max() == 0.0


def test_directions_that_are_not_known_are_no_degrees_of_freedom():
    rng = np.random.default_rng(4)
    at = states(rng)
    position, form = sensors.position(rng, at), sensors.array_phase(rng, at)
    white, root = position.white.copy(), form.root.copy()
    white[0, 0] = root[0, 5:] = 0.0
    position, form = replace(position, white=white), replace(form, root=root)
    assert position.freedom.tolist() == [2, 3, 3, 3]
    assert form.freedom.tolist() == [5, 9, 9, 9]
    cases.assert_gtsam_says_the_same(position, at, SHARED)


def test_a_turn_to_the_right_moves_an_antenna_ahead_to_the_right():
    rng, aux = np.random.default_rng(3), np.zeros(12)
    aux[5] = 1.0  # rad/s about down
    at = states(rng, R_nb=np.eye(3), v_n_mps=np.zeros(3), aux=aux)
    one = replace(
        sensors.velocity(rng, at),
        value_n_mps=np.tile([0.0, 2.0, 0.0], (K, 1)),
        arm_b_m=np.array([2.0, 0.0, 0.0]),
        earth_rate_n_radps=np.zeros(3),
    )
    assert np.abs(one.linearise(at, ALL).value).max() < 1e-14


def test_a_body_that_turns_with_the_earth_has_no_swing():
    rng = np.random.default_rng(4)
    at = states(rng, gyroscope=True, aux=np.zeros(6))
    turning_b = np.einsum("nji,j->ni", at.R_nb, EARTH_N_RADPS)
    part = replace(sensors.velocity(rng, at), measured_b_radps=turning_b)
    apart = np.einsum("nij,nj->ni", part.white, at.v_n_mps - part.value_n_mps)
    np.testing.assert_allclose(part.linearise(at, ALL).value, apart, rtol=0, atol=1e-12)


def test_between_two_nodes_the_offset_of_heights_lies_on_a_straight_line():
    rng = np.random.default_rng(3)
    at = states(rng)
    part, some = sensors.height(rng, at), np.zeros(SHARED.width)
    some[column("a") :][:3] = 1.0, 2.0, 4.0
    values = [part.linearise(at._replace(constants=c), ALL).value for c in (0 * some, some)]
    taken_m = 0.4 * (values[0] - values[1])[:, 0]
    np.testing.assert_allclose(taken_m, [1.0, 1.4, 3.8, 4.0], rtol=0, atol=1e-12)


def test_a_heading_is_off_by_as_much_as_the_body_is_misaligned_whatever_its_pitch():
    rng = np.random.default_rng(3)
    off_rad, pitch_rad = np.array([-3.0, -0.2, 0.4, 3.1]), np.array([0.0, 0.5, -1.2, 0.9])
    at = states(rng)
    forward = sensors.baseline(rng, at, dimensions=1)
    forward = replace(forward, baseline_b_m=np.array([0.7, 0.0, 0.0]))
    heading_rad = np.arctan2(forward.value_n_m[:, 1], forward.value_n_m[:, 0])
    at = at._replace(R_nb=from_euler(np.zeros(K), pitch_rad, heading_rad + off_rad))
    value = forward.linearise(at, ALL).value
    np.testing.assert_allclose(value[:, 0], 20.0 * off_rad, atol=1e-12)
    assert not value[:, 1:].any()
    assert forward.freedom.tolist() == [1] * K


def test_an_array_of_known_shape_is_a_form_of_the_rotation():
    """vec(R) enters the baselines linearly: root of the one, times that, is root of the other."""
    rng = np.random.default_rng(3)
    at, minimum = states(rng), exp(rng.normal(size=(K, 3)))
    shape = sensors.array_shape(rng, at)
    baselines = shape.baselines_b_m
    exact = replace(shape, minimum_n_m=np.einsum("nij,aj->nai", minimum, baselines))
    by_rotation = np.einsum("ij,bc->bijc", np.eye(3), baselines).reshape(-1, 9)
    rotation = ArrayPhase(
        row=ALL,
        root=np.linalg.qr(shape.root @ by_rotation)[1],
        minimum=minimum,
        element_column=np.full(K, -1),
        constants=SHARED,
    )
    one, other = exact.linearise(at, ALL), rotation.linearise(at, ALL)
    costs = [np.square(part.value).sum(axis=1) for part in (one, other)]
    np.testing.assert_allclose(*costs, rtol=1e-10)
    hessians = [part.state.swapaxes(1, 2) @ part.state for part in (one, other)]
    np.testing.assert_allclose(*hessians, rtol=0, atol=1e-10 * np.abs(hessians[0]).max())


def test_what_lasts_of_array_phases_is_no_longer_white():
    rng = np.random.default_rng(7)
    at = states(rng)
    at = at._replace(aux=np.hstack([at.aux, rng.normal(size=(K, 3))]))
    form = sensors.array_phase(rng, at, lasting=3)
    s, apart = form.share[:, None], (at.R_nb - form.minimum).reshape(K, 9)
    off = np.einsum("kij,kj->ki", form.root, apart) + np.sqrt(s) * (at.aux[:, 12:] @ form.basis.T)
    value = form.linearise(at, ALL).value
    np.testing.assert_allclose(value, off / np.sqrt(1 - s), rtol=1e-12, atol=1e-12)


def test_the_same_phases_stand_on_other_rows():
    form = sensors.array_phase(np.random.default_rng(5), None)
    moved = form.on(form.row + 3)
    assert moved.row.tolist() == [3, 4, 5, 6]
    assert np.array_equal(moved.root, form.root)


def test_wrong_arrays_are_refused_by_name():
    rng = np.random.default_rng(4)
    with pytest.raises(BadInputError, match="barometric height sigma_m: must be positive"):
        sensors.height(rng, None, sigma_m=0.0)
    with pytest.raises(BadInputError, match="array phases root: expected shape"):
        replace(sensors.array_phase(rng, None), root=np.zeros((K, 9, 8)))


def test_a_field_against_the_measured_one_is_further_off_than_one_across():
    """Its sine is zero there: an accelerometer reversed was a body upside down, NEES 3e7."""
    rng = np.random.default_rng(9)
    at = states(rng)._replace(constants=np.zeros(SHARED.width))
    field_b = unit(np.einsum("nji,j->ni", at.R_nb, FIELD_N_UT))
    round_b = Directions.isotropic(field_b, np.radians(1.0)).across_b
    one = replace(sensors.field(rng, at, iron=True), across_b=round_b)
    for angle_rad, least, most in ((1.5, 57.0, 58.0), (2.5, 75.0, 85.0), (3.0, 100.0, 112.0)):
        beside_n = unit(np.cross(FIELD_N_UT, [0.0, 1.0, 0.0]))
        misaligned = at._replace(R_nb=exp(angle_rad * beside_n[None]) @ at.R_nb)
        size = np.linalg.norm(one.linearise(misaligned, ALL).value, axis=1)
        assert ((size > least) & (size < most)).all()
        cases.assert_jacobians(one, misaligned)


def test_a_degree_off_a_round_direction_is_a_degree_in_sigmas():
    rng = np.random.default_rng(3)
    at, down_b = states(rng, R_nb=exp(np.radians([[1.0, 0.0, 0.0]]))[0]), np.array([0.0, 0.0, 1.0])
    known_n = np.tile(down_b, (K, 1))
    across_b = Directions.isotropic(known_n, np.radians(0.5)).across_b
    one = replace(sensors.gravity(rng, at), known_n=known_n, across_b=across_b)
    size = np.linalg.norm(one.linearise(at, ALL).value, axis=1)
    assert size == pytest.approx(2.0, rel=1e-4)  # sine for angle: half of 1e-4


def test_a_line_of_sight_is_gtsams_bearing_near_a_round_direction():
    rng = np.random.default_rng(4)
    at = states(rng)
    way_b = np.einsum("nji,nj->ni", at.R_nb, at.constants[column("a") :][:3] - at.p_n_m)
    e_b = unit(unit(way_b) + 1e-4 * rng.normal(size=(K, 3)))
    part = replace(sensors.sight(rng, at), across_b=Directions.isotropic(e_b, 1e-3).across_b)
    unit_noise = gtsam.noiseModel.Isotropic.Sigma(2, 1e-3)
    for i in ALL:
        values = cases.values_of(at, i, SHARED, 7)
        measured = gtsam.Unit3(e_b[i])
        native = gtsam.BearingFactor3D(keys.pose(7), keys.constant(0), measured, unit_noise)
        A, minus_r = native.linearize(values).jacobian()
        B, minus_s = part.factor(i, 7).linearize(values).jacobian()
        np.testing.assert_allclose(B.T @ B, A.T @ A, rtol=0, atol=1e-3 * np.abs(A.T @ A).max())
        np.testing.assert_allclose(minus_s @ minus_s, minus_r @ minus_r, rtol=1e-6)


def test_the_size_of_a_hard_iron_along_the_field_does_not_count():
    rng = np.random.default_rng(5)
    at = states(rng, R_nb=np.eye(3))
    part, iron_ut, values = sensors.field(rng, at, iron=True), np.zeros(SHARED.width), []
    for share in (0.0, -0.5, 3.0):
        iron_ut[column("a") :][:3] = share * FIELD_N_UT
        values.append(part.linearise(at._replace(constants=iron_ut.copy()), ALL).value)
    np.testing.assert_allclose(values[1], values[0], rtol=0, atol=1e-10)
    np.testing.assert_allclose(values[2], values[0], rtol=0, atol=1e-10)
