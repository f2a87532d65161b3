"""Noise identified from the flight."""

from dataclasses import replace

import pytest

from fgnav.checks import NoSolutionError
from fgnav.integers.truth import Truth
from fgnav.io.importers import importer_named
from fgnav.methods.smoother import Batch
from fgnav.methods.tuned import TunedFlight, tuned
from tests.methods.simulated import flown

RIGHT = Truth()


def stated(flight, **factors):
    """The same flight, its noise stated larger by factors."""
    noise = flight.gnss_noise
    changed = {name: factor * getattr(noise, name) for name, factor in factors.items()}
    return replace(flight, gnss_noise=replace(noise, **changed))


def test_noise_that_was_stated_wrong_is_identified_from_the_flight():
    flight = stated(flown("demo", 20.0), phase_m=2.0, doppler_mps=0.5)
    identified = tuned(flight, RIGHT)
    assert identified.settled
    assert abs(identified.factors["array phases"] - 0.5) < 0.05
    assert abs(identified.factors["velocity"] - 2.0) < 0.3  # heavy tails count more than the mean
    assert identified.flight.gnss_noise.phase_m == pytest.approx(0.003, rel=0.1)
    assert all(0.6 < c.nis < 1.15 for c in Batch(resolver=RIGHT)(identified.flight).consistency)
    assert identified.notes[0].startswith("Tuned: noise of array phases is taken as 0.5")


def test_a_flight_too_short_to_tune_is_no_solution():
    with pytest.raises(NoSolutionError, match="tuning needs 30 measurements of a kind"):
        tuned(flown("demo", 2.0), RIGHT)


def test_how_tuning_ends_is_noted():
    flight = flown("demo", 2.0)
    right = TunedFlight(flight=flight, factors={"position": 1.01}, settled=True)
    assert right.notes == ("Tuned: the noise is as the flight states.",)
    wrong = TunedFlight(flight=flight, factors={"position": 3.0}, settled=False)
    assert "position is taken as 3 times" in wrong.notes[0]
    assert "did not settle" in wrong.notes[1]


def test_a_real_flight_passes_its_own_gates_once_tuned(shared):
    """Thor 75 with its gyroscope: one right measurement in a hundred is beyond the 99 % gate."""
    recording = shared / "flights" / "thor75" / "thor_flight75.mat"
    identified = tuned(importer_named("umn")(recording), RIGHT)
    assert identified.settled
    consistency = Batch(resolver=RIGHT)(identified.flight).consistency
    assert {c.what for c in consistency} == {"position", "velocity"}
    assert all(0.005 <= c.beyond_99 <= 0.02 for c in consistency)
