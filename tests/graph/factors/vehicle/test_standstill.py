"""Zero velocity at rest: the factor, and what it does for a car that loses GNSS before it stops."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.assembly.truncation import truncated
from fgnav.checks import BadInputError
from fgnav.geometry.interpolation import interpolate
from fgnav.graph.factors.vehicle.standstill import NAME
from fgnav.io.flight.folder import load_flight, save_flight
from fgnav.methods.observation_stream import ObservationStream
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav.types.vehicle import WheeledVehicle
from tests.assembly.stops import STOPS_S, stops
from tests.methods.test_stream_replay import assert_joined

LOST_S = (50.0, 75.0)


@pytest.fixture(scope="module")
def lost():
    return stops(2, lost_s=LOST_S)


@pytest.mark.parametrize("method", [Smoother(), Forward(), Batch()], ids=lambda m: m.name)
def test_a_stop_without_gnss_bounds_the_velocity(lost, method):
    method, truth = replace(method, noise="nominal"), lost.truth
    rms_mps, squares = {}, {}
    for asked in (False, True):
        found = method(replace(lost, standstill=asked))
        at_rest = (found.t_s > STOPS_S[-1][0] + 2.0) & (found.t_s < STOPS_S[-1][1])
        v = interpolate(found.t_s, truth.t_s, truth.v_n_mps)
        error, P = (found.v_n_mps - v)[at_rest], found.velocity_covariance_m2ps2[at_rest]
        rms_mps[asked] = np.sqrt((error**2).mean())
        squares[asked] = np.einsum("ni,nij,nj->n", error, np.linalg.inv(P), error).mean()
    assert rms_mps[True] < 0.05  # one measurement at a stop
    assert rms_mps[True] < 0.5 * rms_mps[False]
    assert squares[True] < 3
    test = next(one for one in found.consistency if one.what == NAME)
    assert test.count > 20
    assert test.nis < 1


def test_a_stream_stands_as_the_filter_does():
    flight, end_s = stops(1), 8.0
    method, part = Forward(noise="nominal"), truncated(flight, end_s)
    assert any(one.name == NAME for one in method.prepare(part).problem.sensors)
    assert_joined(ObservationStream.replay(part, method), method(part))


def test_a_flight_folder_keeps_the_request(lost, tmp_path):
    for k, vehicle in enumerate((None, WheeledVehicle())):
        folder = tmp_path / f"flight {k}"
        save_flight(replace(lost, vehicle=vehicle), folder)
        read = load_flight(folder)
        assert read.standstill
        assert (read.vehicle is None) == (vehicle is None)


def test_keys_of_wheels_without_a_kind_are_refused(lost, tmp_path):
    folder = tmp_path / "flight"
    save_flight(lost, folder)
    toml = folder / "flight.toml"
    toml.write_text(toml.read_text().replace("standstill = true", "standstill = false"))
    with pytest.raises(BadInputError, match=r"key vehicle\.kind: is missing; add"):
        load_flight(folder)
