"""Forces by velocities and by the unit are the same vectors, whatever the heading."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.geometry.rotations import exp
from fgnav.identification.track.forces import force_consistency
from fgnav.methods.smoother import Smoother
from tests.robustness.drawn.flights import right_flight

SEEDS = range(61_000, 61_010)


def _nis(flight):
    (one,) = force_consistency(flight)
    return one.nis, one.contradictions


def _force(flight, f_b_mps2):
    return replace(flight, imu=replace(flight.imu, f_b_mps2=f_b_mps2))


@pytest.mark.parametrize("kind", ["fixes", "instruments", "raw"])
def test_forces_of_right_flights_agree_within_their_noise(kind):
    flights = [right_flight(kind, seed) for seed in SEEDS]
    assert max(_nis(flight)[0] for flight in flights) < 2.25
    assert not any(_nis(flight)[1] for flight in flights)


def test_a_unit_turned_as_a_whole_feels_the_same_forces():
    flight = right_flight("fixes", 61_000)
    turn, imu = exp(np.array([[0.5, -1.0, 2.0]]))[0], flight.imu
    turned = replace(imu, f_b_mps2=imu.f_b_mps2 @ turn, w_b_radps=imu.w_b_radps @ turn)
    antennas = tuple(replace(a, position_b_m=a.position_b_m @ turn) for a in flight.antennas)
    same = replace(flight, imu=turned, antennas=antennas)
    np.testing.assert_allclose(_nis(same)[0], _nis(flight)[0], rtol=1e-6)


@pytest.mark.parametrize("order", [(1, 0, 2), (0, 2, 1), (2, 0, 1)])
@pytest.mark.parametrize("kind", ["fixes", "raw"])
def test_axes_exchanged_beside_the_gyroscope_contradict_throughout(kind, order):
    flight = right_flight(kind, 61_000)
    nis, (span,) = _nis(_force(flight, flight.imu.f_b_mps2[:, order]))
    assert nis > 10.0
    assert span.throughout


def test_velocities_of_another_time_contradict():
    flight = right_flight("fixes", 61_000)
    late = replace(flight.fixes, v_n_mps=np.roll(flight.fixes.v_n_mps, 5, axis=0))
    assert _nis(replace(flight, fixes=late))[1]


def test_without_velocities_or_gyroscope_nothing_is_tested():
    flight = right_flight("fixes", 61_000)
    assert force_consistency(replace(flight, imu=None)) == ()
    places = replace(flight.fixes, v_n_mps=None, velocity_sigma_mps=None)
    assert force_consistency(replace(flight, fixes=places)) == ()
    raw = right_flight("raw", 61_000)
    seen = replace(raw.observations, doppler_hz=np.full_like(raw.observations.doppler_hz, np.nan))
    assert force_consistency(replace(raw, observations=seen)) == ()


@pytest.mark.parametrize(("kind", "number"), [("fixes", 7346), ("raw", 951000637 // 12)])
def test_a_flight_whose_heading_is_open_for_that_reason_is_refused(kind, number):
    """Without the test level and sigma were wrong: attitude NEES 173 in silence, 16 of raw data."""
    flight = right_flight(kind, number)
    exchanged = _force(flight, flight.imu.f_b_mps2[:, [0, 2, 1]])
    with pytest.raises(NoSolutionError, match=r"specific force \(throughout"):
        Smoother()(exchanged)
