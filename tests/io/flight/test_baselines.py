"""A receiver's heading in a flight's folder."""

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.flight.folder import load_flight, save_flight

TOML = """\
format = "fgnav-flight/1"
name = "dual"
start = "2020-06-25T00:00:00"
[origin]
latitude_deg = 40.0
longitude_deg = -4.0
height_m = 700.0
[[antenna]]
name = "left"
position_b_m = [0, -0.5, 0]
[[antenna]]
name = "right"
position_b_m = [0, 0.5, 0]
[[baseline]]
samples = "b.csv"
antennas = ["left", "right"]
"""
HEADINGS = "t_s,heading_deg,pitch_deg,sigma_heading_deg\n0,30,10,0.5\n1,350,10,0.5\n"
VECTORS = "t_s,north_m,east_m,down_m\n0,1,0,0\n1,1,0,0\n"


def loaded(folder, samples, offset_deg):
    (folder / "flight.toml").write_text(TOML + f"heading_offset_deg = {offset_deg}\n")
    (folder / "b.csv").write_text(samples)
    return load_flight(folder)


@pytest.mark.parametrize("offset_deg", [0, 90, -90.5, 180])
def test_an_offset_that_the_receiver_has_added_is_taken_off(tmp_path, offset_deg):
    """A vehicle's heading along an axis from the left to the right antenna is 90 deg more."""
    flight = loaded(tmp_path, HEADINGS, offset_deg)
    (baseline,) = flight.baselines
    angles = np.radians(np.array([30.0, 350.0]) - offset_deg)
    up = np.full(2, -np.sin(np.radians(10)))
    want = np.column_stack([np.cos(angles), np.sin(angles)]) * np.cos(np.radians(10))
    np.testing.assert_allclose(baseline.vector_n_m, np.column_stack([want, up]), atol=1e-12)
    np.testing.assert_allclose(np.degrees(baseline.heading_sigma_rad), 0.5, rtol=1e-9)
    save_flight(flight, tmp_path / "again")
    again = load_flight(tmp_path / "again").baselines[0]
    np.testing.assert_allclose(again.vector_n_m, baseline.vector_n_m, atol=1e-12)


def test_a_vector_has_no_offset(tmp_path):
    with pytest.raises(BadInputError, match=r"b.csv: line 1: heading_offset_deg needs heading_deg"):
        loaded(tmp_path, VECTORS, 90)
