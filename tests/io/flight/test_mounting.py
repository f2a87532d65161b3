import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.flight.folder import load_flight, save_flight
from fgnav.io.flight.series import FORWARD_RIGHT_DOWN, mounting
from tests.io.flights import whole_flight

MM = 1e-3


def test_axes_and_angles_turn_a_unit_into_the_body():
    down = mounting(("-x", "y", "-z"), (0, 0, 0)) @ [0, 0, -9.8]
    np.testing.assert_allclose(down, [0, 0, 9.8], atol=1e-12)
    # Turned right by 90 deg, the unit's own forward axis looks to the right of the body.
    right = mounting(FORWARD_RIGHT_DOWN, (0, 0, 90)) @ [1, 0, 0]
    np.testing.assert_allclose(right, [0, 1, 0], atol=1e-12)
    # Nose up by 10 deg: what the unit feels along its forward axis is partly up in the body.
    up = mounting(FORWARD_RIGHT_DOWN, (0, 10, 0)) @ [1, 0, 0]
    assert up[2] == pytest.approx(-np.sin(np.radians(10)))


@pytest.mark.parametrize(
    ("axes", "text"),
    [
        (("x", "y", "w"), "imu axes: must be x, y, z, -x, -y or -z, got 'w'"),
        (("x", "y", "y"), "must be a right-handed triad such as -x, y, -z, got x, y, y"),
        (("-x", "y", "z"), "must be a right-handed triad such as -x, y, -z, got -x, y, z"),
    ],
)
def test_axes_that_are_no_triad_are_refused(axes, text):
    with pytest.raises(BadInputError, match=text):
        mounting(axes, (0, 0, 0))


def test_keys_of_flight_toml_turn_samples_and_set_the_clock(tmp_path):
    flight = whole_flight(np.random.default_rng(5))
    save_flight(flight, tmp_path / "flight")
    toml = tmp_path / "flight" / "flight.toml"
    text = toml.read_text().replace('axes = ["x", "y", "z"]', 'axes = ["y", "-x", "z"]')
    toml.write_text(text.replace("clock_offset_s = 0.0", "clock_offset_s = -0.25"))
    got = load_flight(tmp_path / "flight").imu
    np.testing.assert_allclose(got.t_s, flight.imu.t_s - 0.25, rtol=0, atol=1e-7)
    x, y, z = flight.imu.f_b_mps2.T
    np.testing.assert_allclose(got.f_b_mps2, np.column_stack([y, -x, z]), rtol=1e-10)
    x, y, z = flight.imu.w_b_radps.T
    np.testing.assert_allclose(got.w_b_radps, np.column_stack([y, -x, z]), rtol=1e-10)


def test_tags_of_which_nothing_is_stated_are_known_to_half_a_sample(tmp_path):
    flight = whole_flight(np.random.default_rng(6))
    save_flight(flight, tmp_path / "flight")
    assert load_flight(tmp_path / "flight").imu.clock_offset_sigma_s == 0.0  # a simulator's
    toml = tmp_path / "flight" / "flight.toml"
    line = "clock_offset_sigma_s = 0.0\n"
    assert line in toml.read_text()
    toml.write_text(toml.read_text().replace(line, ""))
    interval_s = float(np.median(np.diff(flight.imu.t_s)))
    got = load_flight(tmp_path / "flight").imu
    assert got.clock_offset_sigma_s == pytest.approx(interval_s / np.sqrt(12), rel=1e-6)
    toml.write_text(toml.read_text().replace("clock_offset_s = 0.0", line.replace("0.0", "-1.0")))
    with pytest.raises(BadInputError, match="clock_offset_sigma_s: must be 0 or more"):
        load_flight(tmp_path / "flight")
