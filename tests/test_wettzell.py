"""Two real antennas, 1.594 m apart, as a flight: the whole way from files to a comparison."""

import json

import numpy as np
import pytest

import fgnav
from fgnav.cli import main
from fgnav.geometry import rotations
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.integers.resolvers.resolve import resolve
from fgnav.integers.resolvers.truth import true_integers
from fgnav.methods.closed_form import ClosedForm
from fgnav.methods.maximum_likelihood import MaximumLikelihood
from fgnav.methods.rtk import Rtk

# From the stations' coordinates (README of the data): heading and elevation of the baseline.
HEADING_DEG, ELEVATION_DEG, LENGTH_M = 344.777, 3.112, 1.59385
FLIGHT = """\
format = "fgnav-flight/1"
name = "wettzell"
start = "2020-06-25T00:00:00"
[origin]
latitude_deg = 49.1442
longitude_deg = 12.8789
height_m = 666.0
[[antenna]]
name = "WTZR"
position_b_m = [0.0, 0.0, 0.0]
observations = "{wettzell}/WTZR00DEU_R_20201770000_01D_30S_MO_120epoch.rnx"
[[antenna]]
name = "WTZZ"
position_b_m = [1.59385, 0.0, 0.0]
observations = "{wettzell}/WTZZ00DEU_R_20201770000_01D_30S_MO_120epoch.rnx"
[gnss]
navigation = ["{orbits}/ESBC00DNK_R_20201770000_01D_MN.rnx"]
elevation_mask_deg = 10.0
signals = {{ {signals} }}
"""
GPS = 'G = ["1C"]'
THREE = 'G = ["1C"], E = ["1C"], C = ["2I"]'


@pytest.fixture(scope="module")
def folder(shared, tmp_path_factory):
    """Return a maker of the flight's folder with some signals."""

    def write(signals):
        new = tmp_path_factory.mktemp("wettzell")
        text = FLIGHT.format(
            wettzell=shared / "wettzell", orbits=shared / "orbits", signals=signals
        )
        (new / "flight.toml").write_text(text)
        return new

    return write


def true_attitude(epochs):
    angles = np.radians([0.0, ELEVATION_DEG, HEADING_DEG])
    return np.tile(rotations.from_euler(*angles[:, None]), (epochs, 1, 1))


def right_epochs(flight):
    """Return which epochs LAMBDA resolved wholly and rightly."""
    differences, integers = resolve(flight, Lambda())
    true = true_integers(differences, true_attitude(len(differences.t_s)))
    agree = (integers.cycles == true) | ~integers.fixed
    return agree.all(axis=(1, 2)) & integers.fixed.any(axis=(1, 2))


def test_gps_alone_is_right_in_97_percent_of_single_epochs(folder):
    right = right_epochs(fgnav.load_flight(folder(GPS)))
    assert len(right) == 120
    assert right.mean() >= 0.97


def test_three_constellations_are_right_in_every_epoch(folder):
    right = right_epochs(fgnav.load_flight(folder(THREE)))
    assert len(right) == 120
    assert right.all()


@pytest.mark.parametrize("method", [MaximumLikelihood(), ClosedForm(), Rtk()])
def test_heading_and_elevation_are_those_of_the_coordinates(folder, method):
    flight = fgnav.load_flight(folder(GPS))
    right = flight.observations.t_s[right_epochs(flight)]
    estimate = method(flight)
    fixed_right = np.isin(estimate.t_s, right)
    assert fixed_right.sum() >= 60
    euler = rotations.to_euler(estimate.R_nb[fixed_right])
    heading = np.degrees(rotations.wrap(euler[:, 2] - np.radians(HEADING_DEG)))
    elevation = np.degrees(euler[:, 1]) - ELEVATION_DEG
    assert np.sqrt((heading**2).mean()) < 0.15
    assert np.sqrt((elevation**2).mean()) < 0.4


@pytest.mark.parametrize("method", [MaximumLikelihood(), ClosedForm(), Rtk()])
def test_roll_is_named_unobservable_and_not_invented(folder, method):
    estimate = method(fgnav.load_flight(folder(GPS)))
    assert estimate.unobservable == ("roll",)
    np.testing.assert_allclose(rotations.to_euler(estimate.R_nb)[:, 0], 0, atol=1e-9)


def test_compare_goes_on_where_the_smoother_has_no_accelerometer(folder, tmp_path):
    place = tmp_path / "compare.json"
    assert main(["compare", str(folder(GPS)), "--json", str(place)]) == 0
    figures = json.loads(place.read_text())
    assert figures["methods"]["smoother"]["failure"].startswith("motion: between epochs it needs")
    assert figures["methods"]["maximum-likelihood"]["unobservable"] == ["roll"]
    assert figures["methods"]["maximum-likelihood"]["rmse_deg"]["roll"] is None
    pairs = {tuple(d["methods"]): d for d in figures["differences"]}
    apart = pairs["closed-form", "maximum-likelihood"]["rms_deg"]
    assert apart["roll"] is None
    assert apart["yaw"] < 0.2
