"""Windows for learning gravity: the physics that connects what is measured with the answer."""

import msgspec
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fgnav.checks import BadInputError
from fgnav_sim.data_sets.gravity import gravity_epochs
from fgnav_sim.data_sets.gravity_motions import PHASES
from fgnav_sim.data_sets.gravity_world import GravityWorld, PhasesTable, WindowsTable
from fgnav_sim.scenario import ImuTable

CALM = ImuTable(
    accelerometer_noise_mps2_per_sqrt_hz=1e-9,
    accelerometer_bias_mps2=1e-9,
    accelerometer_bias_walk_mps2_per_sqrt_s=1e-9,
)


def drawn(world, count=400, seed=1):
    return gravity_epochs(world, np.random.default_rng(seed), count)


def angle_deg(a, b):
    cosine = (a * b).sum(axis=1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def test_specific_force_without_acceleration_and_the_earths_turn_is_gravity():
    world = GravityWorld(imu=CALM, velocity_noise_mps=1e-9, velocity_step_s=1e-3)
    epochs = drawn(world)
    f_b_mps2 = epochs.f_b_mps2[:, -1]
    a_b_mps2 = np.einsum("nij,ni->nj", epochs.R_nb, epochs.a_n_mps2)
    v_n_mps = epochs.v_n_mps
    coriolis_n_mps2 = 2 * np.cross(world.origin.frame.earth_rate_n_radps, v_n_mps)
    coriolis_b_mps2 = np.einsum("nij,ni->nj", epochs.R_nb, coriolis_n_mps2)
    g_b_mps2 = epochs.gravity_mps2[:, None] * epochs.g_b
    # What remains is a cubic term of the velocity's difference: far below 0.1 mm/s2.
    assert_allclose(a_b_mps2 + coriolis_b_mps2 - g_b_mps2, f_b_mps2, rtol=0, atol=1e-4)


def test_gravity_points_down_and_has_its_size():
    epochs = drawn(GravityWorld())
    g_n = np.einsum("nij,nj->ni", epochs.R_nb, epochs.g_b)
    # Within 15 km of the origin the plumb line turns by 0.14 degrees.
    assert angle_deg(g_n, np.tile([0.0, 0.0, 1.0], (len(g_n), 1))).max() < 0.2
    assert_allclose(np.linalg.norm(epochs.g_b, axis=1), 1.0, atol=1e-12)
    assert 9.74 < epochs.gravity_mps2.min() < epochs.gravity_mps2.max() < 9.85


def test_windows_hold_consecutive_samples_and_noise_as_specified():
    noisy = GravityWorld(
        windows=WindowsTable(samples=50), imu=msgspec.structs.replace(CALM, rate_hz=200.0)
    )
    loud = msgspec.structs.replace(
        noisy,
        imu=msgspec.structs.replace(noisy.imu, accelerometer_noise_mps2_per_sqrt_hz=1e-2),
    )
    difference = drawn(loud).f_b_mps2 - drawn(noisy).f_b_mps2
    assert difference.shape == (400, 50, 3)
    assert difference.std() == pytest.approx(1e-2 * np.sqrt(200.0), rel=0.02)


def test_each_kind_of_motion_shows():
    everything = drawn(GravityWorld(), 4000)
    assert set(everything.phase) == set(range(len(PHASES)))
    assert_array_equal(np.unique(everything.flight), np.arange(200))
    down_mps = {}
    for k, name in enumerate(PHASES):
        own = everything[everything.phase == k]
        down_mps[name] = own.v_n_mps[:, 2]
        tilt = angle_deg(-own.f_b_mps2[:, -1], own.g_b)
        if name == "turn":
            assert np.median(tilt) > 20.0  # the accelerometer feels the turn, not gravity
        elif name == "cruise":
            assert np.median(tilt) < 15.0
    assert (down_mps["climb"] < 1.0).mean() > 0.99
    assert (down_mps["descent"] > -5.0).mean() > 0.9
    assert np.abs(np.median(down_mps["cruise"])) < 1.0


def test_only_phases_with_weight_are_flown():
    world = GravityWorld(phases=PhasesTable(climb=0, cruise=0, descent=0, turn=1, spin=0))
    assert set(drawn(world).phase) == {PHASES.index("turn")}


def test_a_turn_banks_as_lift_requires():
    world = GravityWorld(imu=CALM, phases=PhasesTable(climb=0, cruise=0, descent=0, turn=1, spin=0))
    calm = msgspec.structs.replace(
        world, motion=msgspec.structs.replace(world.motion, wobble_deg=(0, 0), surge_mps2=(0, 0))
    )
    f_b_mps2 = drawn(calm).f_b_mps2[:, -1]
    # Without the Coriolis acceleration, 250 m/s turn over the Earth by at most 0.04 m/s2.
    assert np.abs(f_b_mps2[:, 1]).max() < 0.1
    assert (f_b_mps2[:, 2] < -9.7).all()


def test_same_seed_same_windows_and_a_count_below_one_is_refused():
    one, again = drawn(GravityWorld(), 50), drawn(GravityWorld(), 50)
    assert_array_equal(one.f_b_mps2, again.f_b_mps2)
    assert len(one) == 50
    assert one.flight[-1] == 2
    assert not np.array_equal(one.g_b, drawn(GravityWorld(), 50, seed=2).g_b)
    with pytest.raises(BadInputError, match="count: must be 1 or more, got -1"):
        drawn(GravityWorld(), -1)
