"""A base on the ground: there where the scenario says, and no disturbance to the vehicle."""

import numpy as np

from fgnav.geometry.earth import geodetic
from fgnav.gnss.signals import wavelengths_m
from fgnav.io.flight.folder import load_flight, save_flight
from tests.gnss.based import NEAR, flown


def test_a_base_leaves_what_the_vehicle_measures_as_it_was():
    with_base, without = flown(span_s=3.0), flown(span_s=3.0, base=None)
    assert without.base is None
    for name in ("code_m", "phase_cycles", "doppler_hz"):
        np.testing.assert_array_equal(
            getattr(with_base.observations, name), getattr(without.observations, name)
        )
    np.testing.assert_array_equal(with_base.imu.f_b_mps2, without.imu.f_b_mps2)


def test_a_base_stands_where_the_scenario_says_and_survives_a_folder(tmp_path):
    flight = flown(span_s=3.0)
    latitude, longitude, height_m = geodetic(flight.base.position_e_m[None])[0]
    np.testing.assert_allclose(
        [np.degrees(latitude), np.degrees(longitude), height_m],
        [NEAR.latitude_deg, NEAR.longitude_deg, NEAR.height_m],
        rtol=0,
        atol=1e-6,
    )
    assert flight.base.observations.code_m.shape[1] == 1
    save_flight(flight, tmp_path / "flight")
    again = load_flight(tmp_path / "flight")
    np.testing.assert_allclose(
        again.base.observations.code_m, flight.base.observations.code_m, rtol=0, atol=6e-4
    )


def test_base_and_vehicle_draw_noise_of_their_own():
    flight = flown(span_s=3.0)
    ours, theirs = flight.observations, flight.base.observations
    columns = [theirs.satellites.index(name) for name in ours.satellites]
    wavelength_m = wavelengths_m(ours.satellites, ours.signals)
    code_less_phase = (ours.code_m - wavelength_m * ours.phase_cycles)[:, 0]
    code_less_phase -= (
        theirs.code_m[..., columns] - wavelength_m * theirs.phase_cycles[..., columns]
    )[:, 0]
    sigma_m = np.nanstd(code_less_phase - np.nanmean(code_less_phase, axis=0))
    assert 0.38 < sigma_m < 0.46  # two of 0.3 m
