"""Noise that a flight folder leaves out."""

import re

from fgnav.io.flight.folder import load_flight, save_flight
from fgnav.types.instruments import USUAL_IMU_NOISE
from tests.methods.simulated import flown


def test_noise_left_out_is_the_usual_and_stays_left_out_when_written_again(tmp_path):
    save_flight(flown("demo", 2.0), tmp_path / "flight")
    toml = tmp_path / "flight" / "flight.toml"
    toml.write_text(re.sub(r"\n\w*(noise|bias)\w* = .*", "", toml.read_text()))
    silent = load_flight(tmp_path / "flight")
    assert "accelerometer_noise_mps2_per_sqrt_hz" in silent.imu.unstated
    assert "gyroscope_noise_radps_per_sqrt_hz" not in silent.imu.unstated  # there is none
    usual = USUAL_IMU_NOISE["accelerometer_noise_mps2_per_sqrt_hz"]
    assert silent.imu.accelerometer_noise_mps2_per_sqrt_hz == usual
    assert silent.gnss_noise.unstated == ("code_m", "phase_m", "doppler_mps")
    save_flight(silent, tmp_path / "again")
    assert "noise" not in (tmp_path / "again" / "flight.toml").read_text()
