"""Every sensor: Jacobians against differences, GTSAM's factors against the one statement."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.geometry.rotations import exp, from_euler
from fgnav.graph import keys
from fgnav.graph.delayed import CLOCK_OFFSET, CLOCK_RATE, VELOCITY_DELAY
from fgnav.graph.factors.array_phase import FLOAT_AMBIGUITIES, ArrayPhase
from fgnav.graph.factors.barometer import OFFSET
from fgnav.graph.factors.check import values_of
from fgnav.graph.factors.directions import Directions
from fgnav.graph.factors.gravity import TILT
from fgnav.graph.factors.line_of_sight import BORESIGHT, LANDMARK, LineOfSight
from fgnav.graph.factors.magnetometer import HARD_IRON
from fgnav.graph.factors.position import LEVER_ARM
from fgnav.graph.factors.vehicle.aerodynamic_angles import MEAN, WIND
from fgnav.graph.factors.vehicle.wheels import AXES, AXLE
from tests.graph.factors import cases, sensors
from tests.graph.factors.sensors import ROWS, K

EVERY = [
    (sensors.position, ()),
    (sensors.position, (LEVER_ARM,)),
    (sensors.velocity, ()),
    (sensors.velocity, (LEVER_ARM,)),
    (sensors.accelerometer_velocity, ()),
    (sensors.accelerometer_velocity, (LEVER_ARM,)),
    (sensors.late_velocity, (CLOCK_OFFSET, CLOCK_RATE, VELOCITY_DELAY)),
    (sensors.late_velocity, (CLOCK_OFFSET, CLOCK_RATE, VELOCITY_DELAY, LEVER_ARM)),
    (sensors.phases, (FLOAT_AMBIGUITIES,)),
    (sensors.shape, ()),
    (sensors.shape, ("antenna a2",)),
    (sensors.vector, ()),
    (sensors.heading, ()),
    (sensors.down, ()),
    (sensors.down, (TILT,)),
    (sensors.sight, (LANDMARK,)),
    (sensors.sight, (LANDMARK, BORESIGHT)),
    (sensors.field, ()),
    (sensors.field, (HARD_IRON,)),
    (sensors.height, ()),
    (sensors.height, (OFFSET,)),
    (sensors.rolling, (AXES, AXLE)),
    (sensors.airflow, (WIND, MEAN)),
    (sensors.standing, ()),
    (sensors.resting, ()),
]


@pytest.mark.parametrize(
    ("sensor", "names", "gyroscope"),
    [
        pytest.param(sensor, names, gyroscope, id=" ".join([sensor.__name__, *names, motion]))
        for sensor, names in EVERY
        for motion, gyroscope in (("rate a state", False), ("gyroscope", True))
        if gyroscope or sensor is not sensors.resting  # a rate at rest is a gyroscope's
    ],
)
def test_derivatives_are_differences_and_gtsam_says_the_same(sensor, names, gyroscope):
    rng, shared = np.random.default_rng(1), sensors.constants(*names, "another")
    at = cases.random_states(K, rng, shared, gyroscope=gyroscope)
    cases.assert_factor(sensor(rng, at).bound(shared), at, shared)


@pytest.mark.parametrize("names", [(), (FLOAT_AMBIGUITIES,)], ids=["fixed", "float"])
def test_a_correlated_error_of_phases_is_a_part_of_the_keyframes_vector(names):
    rng, shared = np.random.default_rng(6), sensors.constants("another", *names)
    at = cases.random_states(K, rng, shared)
    at = at._replace(aux=np.hstack([at.aux, rng.normal(size=(K, 6))]))
    form = sensors.phases(rng, at, correlated=6).bound(shared)
    cases.assert_factor(form, at, shared)
    s = form.share[:, None]
    apart = (at.R_nb - form.minimum).reshape(K, 9)
    off = np.einsum("kij,kj->ki", form.root, apart) + np.sqrt(s) * (at.aux[:, 12:] @ form.basis.T)
    fixed = form.stretch < 0
    value = form.linearise(at, ROWS).value
    np.testing.assert_allclose(value[fixed], (off / np.sqrt(1 - s))[fixed], rtol=1e-12, atol=1e-12)


def test_rows_of_zeros_are_no_degrees_of_freedom():
    rng, shared = np.random.default_rng(4), sensors.constants()
    at = cases.random_states(K, rng, shared)
    for full, field in ((sensors.position(rng, at), "white"), (sensors.phases(rng, at), "root")):
        whitening = getattr(full, field).copy()
        whitening[0, 2:] = 0.0
        partial = replace(full, **{field: whitening})
        assert partial.freedom.tolist() == [2, *full.freedom[1:]]


def test_a_wrong_shape_is_named():
    form = sensors.phases(np.random.default_rng(5), None)
    with pytest.raises(BadInputError, match="array phases root: expected shape"):
        replace(form, root=np.zeros((K, 9, 8)))
    with pytest.raises(BadInputError, match="barometric height sigma_m: must be positive"):
        sensors.height(np.random.default_rng(4), None, sigma_m=0.0)


def test_the_same_measurements_stand_on_other_rows():
    form = sensors.phases(np.random.default_rng(5), None)
    moved = form.move(form.row + 3)
    assert moved.row.tolist() == [3, 4, 5, 6]
    assert moved.root is form.root or np.array_equal(moved.root, form.root)


def test_an_antenna_two_metres_ahead_is_two_metres_north_of_a_body_facing_north():
    shared = sensors.constants()
    at = cases.random_states(K, np.random.default_rng(3), shared)
    at = at._replace(R_nb=np.tile(np.eye(3), (K, 1, 1)), p_n_m=np.zeros((K, 3)))
    arm_b_m = np.array([2.0, 0.0, 0.0])
    ahead = replace(sensors.position(np.random.default_rng(3), at), arm_b_m=arm_b_m)
    ahead = replace(ahead, value_n_m=np.tile(arm_b_m, (K, 1)))
    assert not ahead.linearise(at, ROWS).value.any()


def test_a_turn_to_the_right_moves_an_antenna_ahead_to_the_right():
    shared = sensors.constants()
    at = cases.random_states(K, np.random.default_rng(3), shared)
    aux = np.zeros((K, 12))
    aux[:, 5] = 1.0  # rad/s about down
    at = at._replace(R_nb=np.tile(np.eye(3), (K, 1, 1)), v_n_mps=np.zeros((K, 3)), aux=aux)
    ahead = replace(
        sensors.velocity(np.random.default_rng(3), at),
        value_n_mps=np.tile([0.0, 2.0, 0.0], (K, 1)),
        arm_b_m=np.array([2.0, 0.0, 0.0]),
    )
    assert np.abs(ahead.linearise(at, ROWS).value).max() < 1e-14


def test_an_array_of_known_shape_is_a_form_of_the_rotation():
    """vec(R) enters the baselines linearly: root of the one, times that, is root of the other."""
    rng, shared = np.random.default_rng(3), sensors.constants()
    at, minimum = (cases.random_states(K, rng, shared) for _ in range(2))
    shape = sensors.shape(rng, at)
    exact = replace(shape, minimum_n_m=np.einsum("nij,aj->nai", minimum.R_nb, shape.baselines_b_m))
    by_rotation = np.einsum("ij,bc->bijc", np.eye(3), shape.baselines_b_m).reshape(12, 9)
    upper = np.linalg.qr(shape.root @ by_rotation)[1]
    fixed = np.full(K, -1)
    rotation = ArrayPhase(row=ROWS, root=upper, minimum=minimum.R_nb, stretch=fixed)
    one, other = (part.linearise(at, ROWS) for part in (exact, rotation))
    np.testing.assert_allclose(*((part.value**2).sum(1) for part in (one, other)), rtol=1e-10)
    hessians = [part.state.swapaxes(1, 2) @ part.state for part in (one, other)]
    np.testing.assert_allclose(*hessians, rtol=0, atol=1e-10 * np.abs(hessians[0]).max())


def test_a_heading_is_off_by_as_much_as_the_body_is_turned_whatever_its_pitch():
    rng, shared = np.random.default_rng(3), sensors.constants()
    turned_rad, pitch_rad = np.array([-3.0, -0.2, 0.4, 3.1]), np.array([0.0, 0.5, -1.2, 0.9])
    one = replace(sensors.heading(rng, None), baseline_b_m=np.array([0.7, 0.0, 0.0]))
    heading_rad = np.arctan2(one.value_n_m[:, 1], one.value_n_m[:, 0])
    at = cases.random_states(K, rng, shared)
    at = at._replace(R_nb=from_euler(np.zeros(K), pitch_rad, heading_rad + turned_rad))
    value = one.linearise(at, ROWS).value
    np.testing.assert_allclose(value[:, 0], 20.0 * turned_rad, atol=1e-12)
    assert not value[:, 1:].any()
    assert one.freedom.tolist() == [1] * K


def test_a_field_against_the_measured_one_is_further_off_than_one_across():
    """Its sine is zero there: an accelerometer reversed was a body upside down, NEES 3e7."""
    rng, shared = np.random.default_rng(9), sensors.constants(HARD_IRON)
    at = cases.random_states(K, rng, shared)
    seen_b = np.einsum("nji,j->ni", at.R_nb, sensors.FIELD_N_UT)
    round_b = Directions.isotropic(sensors.unit(seen_b), np.radians(1.0)).across_b
    one = replace(sensors.field(rng, at), across_b=round_b).bound(shared)
    for turn_rad, least, most in ((1.5, 57.0, 58.0), (2.5, 75.0, 85.0), (3.0, 100.0, 112.0)):
        beside_n = sensors.unit(np.cross(one.field_n_ut, [0.0, 1.0, 0.0]))
        R_nb = exp(turn_rad * beside_n[None]) @ at.R_nb
        turned = at._replace(R_nb=R_nb, constants=np.zeros(3))
        size = np.linalg.norm(one.linearise(turned, ROWS).value, axis=1)
        assert ((size > least) & (size < most)).all()
        cases.assert_factor(one, turned, shared)


def test_the_size_of_a_hard_iron_along_the_field_does_not_count():
    rng, shared = np.random.default_rng(5), sensors.constants(HARD_IRON)
    at = cases.random_states(K, rng, shared)
    at = at._replace(R_nb=np.tile(np.eye(3), (K, 1, 1)))
    part = sensors.field(rng, at).bound(shared)
    values = [
        part.linearise(at._replace(constants=share * part.field_n_ut), ROWS).value
        for share in (0.0, -0.5, 3.0)
    ]
    np.testing.assert_allclose(values[1], values[0], rtol=0, atol=1e-10)
    np.testing.assert_allclose(values[2], values[0], rtol=0, atol=1e-10)


def test_a_degree_off_a_round_direction_is_a_degree_in_sigmas():
    shared, down_b = sensors.constants(), np.tile([0.0, 0.0, 1.0], (K, 1))
    at = cases.random_states(K, np.random.default_rng(3), shared)
    at = at._replace(R_nb=exp(np.radians(np.tile([1.0, 0.0, 0.0], (K, 1)))))
    round_b = Directions.isotropic(down_b, np.radians(0.5)).across_b
    some = sensors.down(np.random.default_rng(3), at)
    one = replace(some, known_n=down_b, across_b=round_b)
    size = np.linalg.norm(one.linearise(at, ROWS).value, axis=1)
    assert size == pytest.approx(2.0, rel=1e-4)  # sine for angle: half of 1e-4


def test_a_line_of_sight_is_gtsams_bearing_near_a_round_direction():
    rng, shared = np.random.default_rng(4), sensors.constants(LANDMARK)
    at = cases.random_states(K, rng, shared)
    way_b = sensors.unit(np.einsum("nji,nj->ni", at.R_nb, at.constants - at.p_n_m))
    e_b = sensors.unit(way_b + 1e-4 * rng.normal(size=(K, 3)))
    part = LineOfSight(row=ROWS, across_b=Directions.isotropic(e_b, 1e-3).across_b).bound(shared)
    unit_noise = gtsam.noiseModel.Isotropic.Sigma(2, 1e-3)
    values = values_of(at, shared)
    for i in ROWS:
        measured = gtsam.Unit3(e_b[i])
        native = gtsam.BearingFactor3D(keys.pose(i), keys.constant(0), measured, unit_noise)
        A, minus_r = native.linearize(values).jacobian()
        B, minus_s = part.factor(i, int(i)).linearize(values).jacobian()
        np.testing.assert_allclose(B.T @ B, A.T @ A, rtol=0, atol=1e-3 * np.abs(A.T @ A).max())
        np.testing.assert_allclose(minus_s @ minus_s, minus_r @ minus_r, rtol=1e-6)


def test_between_two_nodes_the_offset_of_a_barometer_lies_on_a_straight_line():
    rng, shared = np.random.default_rng(3), sensors.constants("another", OFFSET)
    at = cases.random_states(K, rng, shared)
    part = sensors.height(rng, at).bound(shared)
    none = at._replace(constants=np.zeros(5))
    some = at._replace(constants=np.array([0.0, 0.0, 1.0, 2.0, 4.0]))
    taken_m = 0.4 * (part.linearise(none, ROWS).value - part.linearise(some, ROWS).value)[:, 0]
    np.testing.assert_allclose(taken_m, [1.0, 1.4, 3.8, 4.0], rtol=0, atol=1e-12)
