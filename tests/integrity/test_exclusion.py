"""One suspect is left out where the rest is consistent without it; else a flight stays as it is."""

from dataclasses import replace

import numpy as np

from fgnav.integrity.exclusion import exclusions, without_contradictions
from fgnav.methods.smoother import Batch
from fgnav.types.estimate import Verdict
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.flights import right_flight


def verdict(sensor, from_s=0.0, until_s=12.0, ratio=9.0):
    return Verdict(
        sensor=sensor, from_s=from_s, until_s=until_s, ratio=ratio, limit=2.25, test="record"
    )


def test_a_wrong_instrument_is_left_out_and_its_verdict_stays():
    flight = right_flight("instruments", 96_000)
    magnetometer = flight.magnetometer
    field = magnetometer.field_b_ut.copy()
    field[60:] += [40.0, -30.0, 20.0]
    wrong = replace(flight, magnetometer=replace(magnetometer, field_b_ut=field))
    estimate = Batch()(wrong)
    assert nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 10
    assert any(one.what == "magnetic field" for one in estimate.rejections)
    assert [one.sensor for one in estimate.verdicts] == ["magnetic field"]


def test_a_right_flight_is_not_asked_again():
    flight = right_flight("fixes", 96_001)
    estimate = Batch(noise="nominal")(flight)

    def again(_):
        raise AssertionError

    assert without_contradictions(flight, estimate, again) is estimate


def test_instruments_are_the_first_suspects_and_gnss_is_left_out_by_spans():
    flight = right_flight("instruments", 96_002)
    found = list(exclusions(flight, (verdict("velocity", 3.0, 5.0), verdict("magnetic field"))))
    assert found[0].flight.magnetometer is None
    inside = (flight.fixes[0].t_s >= 2.0) & (flight.fixes[0].t_s <= 6.0)
    weightless = (
        found[1].flight.fixes[0].velocity_sigma_mps > 100 * flight.fixes[0].velocity_sigma_mps
    )
    np.testing.assert_array_equal(weightless.all(axis=1), inside)
    assert found[2].flight.barometer is None
    assert [[v.sensor for v in one.verdicts] for one in found] == [
        ["magnetic field"],
        [],
        ["barometric height"],
    ]
    assert [one.rejected[0].what for one in found] == [
        "magnetic field",
        "velocity",
        "barometric height",
    ]


def test_what_contradicts_throughout_and_is_no_instrument_stays():
    flight = right_flight("fixes", 96_003)
    assert list(exclusions(flight, (verdict("velocity"),))) == []


def test_a_flight_that_stays_inconsistent_keeps_its_estimate_and_its_verdicts():
    flight = right_flight("fixes", 96_004)
    up = flight.fixes[0].v_n_mps * [1.0, 1.0, -1.0]
    wrong = replace(flight, fixes=(replace(flight.fixes[0], v_n_mps=up),))
    estimate = Batch()(wrong)
    assert not estimate.consistent
    assert len(estimate.t_s)
    assert np.isfinite(estimate.R_nb).all()
