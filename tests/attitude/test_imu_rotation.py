import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.attitude.imu_rotation import despun, imu_rotation, spun
from fgnav.geometry import rotations
from tests.imu import imu_of

T_S = np.arange(0.0, 4.0, 0.01)
F_N_MPS2 = np.array([3.0, -2.0, -9.5])


ARM_B_M = np.array([0.3, 0.02, 0.0])


def turning(w_b_radps, *, gyroscope=False, noise_mps2=0.0, arm_b_m=(0.0, 0.0, 0.0)):
    """A record of a body that turns at a constant rate under one specific force."""
    w_b_radps = np.asarray(w_b_radps, dtype=float)
    R_nb = rotations.exp(w_b_radps * T_S[:, None])
    f_b = np.einsum("nji,j->ni", R_nb, F_N_MPS2)
    f_b += np.cross(w_b_radps, np.cross(w_b_radps, arm_b_m))
    f_b += noise_mps2 * np.random.default_rng(0).standard_normal(f_b.shape)
    rates = np.tile(w_b_radps, (len(T_S), 1)) if gyroscope else None
    return imu_of(T_S, f_b, rates), R_nb


@pytest.mark.parametrize("rate", [2.0, -12.6, 30.0])
@pytest.mark.parametrize("axis", [[1, 0, 0], [0.6, 0.0, 0.8]])
@pytest.mark.parametrize("arm_b_m", [np.zeros(3), ARM_B_M], ids=["centre", "off the axis"])
def test_the_accelerometer_tells_a_spin_and_its_axis(rate, axis, arm_b_m):
    w_b = rate * np.array(axis)
    imu, _ = turning(w_b, noise_mps2=0.01, arm_b_m=arm_b_m)
    rotation = imu_rotation(imu)
    # From one fix to the next, a tenth of a second, 0.01 rad.
    assert_allclose(rotation.w_b_radps[60:-60], np.tile(w_b, (len(T_S) - 120, 1)), atol=0.1)


def test_what_a_rotation_adds_off_its_axis_is_taken_off_where_asked():
    imu, _ = turning([0.5, 3.0, -1.0], gyroscope=True, arm_b_m=ARM_B_M)
    centre = imu_rotation(imu).forces(imu, -ARM_B_M).f_b_mps2
    assert_allclose(centre, np.tile(F_N_MPS2, (len(T_S), 1)), atol=1e-9)


def test_what_does_not_spin_or_does_not_show_it_has_no_rotation_of_its_own():
    assert imu_rotation(turning([0.5, 0.0, 0.0])[0]) is None
    assert imu_rotation(turning(5 * F_N_MPS2 / np.linalg.norm(F_N_MPS2))[0]) is None
    assert imu_rotation(turning([0.0, 0.0, 0.0], noise_mps2=1.0)[0]) is None


def test_a_gyroscope_tells_slow_turns_too():
    imu, R_nb = turning([0.1, -0.3, 0.2], gyroscope=True)
    rotation = imu_rotation(imu)
    at_s = np.array([0.005, 1.2345, 3.9])
    there = rotations.exp(np.array([0.1, -0.3, 0.2]) * at_s[:, None])
    assert_allclose(rotation.at(at_s), there, atol=1e-9)
    steady = despun(rotation, T_S, R_nb)
    assert_allclose(steady, np.tile(np.eye(3), (len(T_S), 1, 1)), atol=1e-9)
    assert_allclose(spun(rotation, T_S, steady), R_nb, atol=1e-12)
    force = rotation.forces(imu).f_b_mps2
    assert_allclose(force, np.tile(F_N_MPS2, (len(T_S), 1)), atol=1e-9)
