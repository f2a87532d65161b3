"""What is left out of a flight is gone, and nothing else."""

import msgspec
import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.evaluation.ablation import KINDS, without
from fgnav_sim.gnss.tables import GnssTable
from fgnav_sim.scenario import ImuTable, Scenario
from fgnav_sim.simulate import simulate


@pytest.fixture(scope="module")
def flight():
    scenario = Scenario(duration_s=1.0, gnss=GnssTable(), imu=ImuTable())
    return simulate(scenario, np.random.default_rng(1))


def test_phase_goes_and_code_stays(flight):
    less = without(flight, ("phase",)).observations
    assert np.isnan(less.phase_cycles).all()
    np.testing.assert_array_equal(less.code_m, flight.observations.code_m)


def test_several_go_together(flight):
    less = without(flight, ("doppler", "inertial"))
    assert less.imu is None
    assert np.isnan(less.observations.doppler_hz).all()


@pytest.mark.parametrize(
    "kind", ["gyroscope", "line-of-sight", "fixes", "barometer", "magnetometer"]
)
def test_what_is_not_there_cannot_be_left_out(flight, kind):
    with pytest.raises(BadInputError, match=f"without {kind}: flight .* has none"):
        without(flight, (kind,))


def test_an_unknown_kind_is_named(flight):
    with pytest.raises(BadInputError, match=", ".join(KINDS)):
        without(flight, ("radar",))


def test_a_gyroscope_goes_and_the_accelerometer_stays():
    imu = ImuTable(
        gyroscope_noise_radps_per_sqrt_hz=1e-3,
        gyroscope_bias_radps=1e-2,
        gyroscope_bias_walk_radps_per_sqrt_s=1e-5,
    )
    scenario = msgspec.structs.replace(Scenario(duration_s=1.0), imu=imu)
    flight = simulate(scenario, np.random.default_rng(1))
    less = without(flight, ("gyroscope",)).imu
    assert less.w_b_radps is None
    np.testing.assert_array_equal(less.f_b_mps2, flight.imu.f_b_mps2)
