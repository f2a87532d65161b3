"""A flight fed epoch by epoch ends where ``forward`` ends, in states and covariances."""

from dataclasses import fields, replace

import msgspec
import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.geometry.rotations import to_euler
from fgnav.methods import causal
from fgnav.methods.observation_stream import ObservationStream
from fgnav.methods.smoother import Forward
from fgnav.methods.smoothing.concatenation import concatenate_estimates
from fgnav.methods.stream import Stream
from fgnav.methods.streaming import going_on
from fgnav.methods.streaming.recording import concatenate_flights, epochs_s, pieces
from fgnav.types.flight import InitialAttitude
from fgnav_sim.gnss.tables import OutageTable, Point, SlipsTable
from fgnav_sim.motion import Straight
from fgnav_sim.scenario import FixesTable
from fgnav_sim.simulate import simulate
from tests.methods.test_truncation import scenario

STATED = Forward(noise="nominal")
ONE = ((0.5, 0.1, 0.0),)
SLIPS = SlipsTable(rate_per_hour=60.0, largest_cycles=10, flagged_share=0.5)
AHEAD = Point(latitude_deg=40.36, longitude_deg=-3.88, height_m=600.0)
GONE = OutageTable(from_s=4.0, until_s=5.0)
RISING = OutageTable(until_s=5.0, azimuth_deg=(0.0, 150.0))


def one_antenna(span_s, **gnss):
    found = scenario("demo", span_s, gyroscope=True, **gnss)
    return msgspec.structs.replace(found, antennas_b_m=ONE)


def every_second(made):
    return msgspec.structs.replace(made, fixes=FixesTable(rate_hz=1.0))


def hovering(span_s):
    """Return a drone that hovers, its heading by fixes of two antennas alone."""
    made = scenario("drone", span_s)
    still = msgspec.structs.replace(made.motion, path=Straight(speed_mps=0.01))
    fixes = msgspec.structs.replace(made.fixes, rate_hz=1.0)
    return msgspec.structs.replace(made, motion=still, baseline=None, fixes=fixes)


# The body, what it carries, and a seed that nothing was chosen on.
FLIGHTS = {
    "one antenna, satellites that rise, an outage": (
        one_antenna(10.0, rate_hz=2.0, outages=(RISING, GONE), wind_up=True),
        41_002,
    ),
    "a base that it comes nearer to": (one_antenna(4.0, rate_hz=2.0, base=AHEAD), 41_004),
    "an array": (scenario("demo", 1.5), 41_005),
    "an array once a second": (scenario("demo", 6.0, rate_hz=1.0), 41_006),
    "an array and a gyroscope": (scenario("demo", 1.5, gyroscope=True), 41_007),
    "a baseline and a gyroscope": (scenario("drone", 4.0), 41_014),
    "a baseline and no gyroscope": (scenario("drone", 3.0, gyroscope=None), 41_015),
    "a landmark in sight": (scenario("approach", 1.5, range_m=9000.0), 41_008),
}


def flown(which):
    made, seed = FLIGHTS[which]
    return simulate(made, np.random.default_rng(seed))


def with_heading(flight):
    """Return a flight that states its first heading."""
    heading_rad = to_euler(flight.truth.R_nb[:1])[0, 2]
    initial = InitialAttitude(heading_rad=heading_rad, heading_sigma_rad=0.02)
    return replace(flight, initial=initial)


def assert_same(flight, method):
    assert_joined(ObservationStream.replay(flight, method), method(flight))


def assert_joined(parts, whole):
    n = len(whole.t_s)
    streamed = concatenate_estimates([part for part in parts if len(part.t_s)], n, n)
    np.testing.assert_array_equal(streamed.t_s, whole.t_s)
    for name in (one.name for one in fields(whole)):
        if isinstance(expected := getattr(whole, name), np.ndarray):
            found = getattr(streamed, name)
            np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9, err_msg=name)


@pytest.mark.parametrize("which", FLIGHTS)
def test_a_replayed_flight_ends_where_forward_ends(which):
    assert_same(flown(which), STATED)


def test_the_heading_of_one_of_them_becomes_known_on_the_way():
    """Phases before it are wound up about the one that was assumed, not about the one found."""
    flight = flown("one antenna, satellites that rise, an outage")
    opening = STATED.prepare(flight).opening
    assert flight.gnss_noise.wind_up
    assert 5.0 < opening.until_s < epochs_s(flight)[-1]


def test_every_epoch_is_answered_when_it_comes():
    flight = simulate(one_antenna(1.5), np.random.default_rng(41_011))
    epochs_s = flight.observations.t_s
    answers = [part.t_s for part in Stream.replay(flight, STATED)]
    assert len(answers) == len(epochs_s) + 2  # of what comes after the last one, and the end
    np.testing.assert_array_equal(answers[1], epochs_s[:2])  # one keyframe alone has no motion
    assert [t_s.tolist() for t_s in answers[2:-2]] == [[t] for t in epochs_s[2:].tolist()]


def test_noise_is_identified_anew_while_it_runs(monkeypatch):
    """Of velocities twice as loud as stated, the heading stated; looked at sooner."""
    monkeypatch.setattr(causal, "_FIRST_S", 5.0)
    made = scenario("six", 7.0, fixes=True, gyroscope=True)
    flight = simulate(made, np.random.default_rng(41_010))
    fixes = replace(flight.fixes[0], velocity_sigma_mps=flight.fixes[0].velocity_sigma_mps / 2)
    flight = with_heading(replace(flight, fixes=(fixes,)))
    prepared = Forward().prepare(flight)
    assert len(Forward()._stretches(flight, prepared)) > 1
    whole = Forward().estimate_prepared(flight, prepared)
    assert_joined(ObservationStream.replay(flight, Forward()), whole)


def test_pieces_of_a_flight_are_the_flight():
    flight = flown("one antenna, satellites that rise, an outage")
    first, *rest = pieces(flight)
    for piece in rest:
        first = concatenate_flights(first, piece)
    np.testing.assert_array_equal(first.imu.f_b_mps2, flight.imu.f_b_mps2)
    seen, of = first.observations, flight.observations
    order = [
        list(zip(of.satellites, of.signals, strict=True)).index(c)
        for c in zip(seen.satellites, seen.signals, strict=True)
    ]
    np.testing.assert_array_equal(seen.phase_cycles, of.phase_cycles[:, :, order])
    np.testing.assert_array_equal(seen.lock_flags, of.lock_flags[:, :, order])


def test_orbits_are_the_newest_that_came():
    first, second, *_ = pieces(flown("one antenna, satellites that rise, an outage"))
    newer = replace(second.broadcast, klobuchar=2 * second.broadcast.klobuchar)
    assert concatenate_flights(first, replace(second, broadcast=newer)).broadcast is newer
    assert (
        concatenate_flights(first, replace(second, observations=None, broadcast=None)).broadcast
        is first.broadcast
    )


def test_what_does_not_go_on_is_named():
    first, second, *_ = pieces(flown("one antenna, satellites that rise, an outage"))
    stream = ObservationStream(STATED)
    stream.update(first)
    stream.update(second)
    with pytest.raises(BadInputError, match=r"stream imu t_s: must come after 0\.5, got"):
        stream.update(second)


def test_factors_that_a_stream_of_observations_does_not_take_are_named():
    with pytest.raises(BadInputError, match="stream factors: of one's own go into Stream"):
        ObservationStream(Forward(factors=(lambda *_: (),)))


# Of a heading that is stated, or told by the field, nothing looks back for half a minute.
LONG = {
    "one antenna whose turns wind up phases": (
        one_antenna(22.0, rate_hz=1.0, outages=(GONE,), wind_up=True, slips=SLIPS),
        41_012,
        10.0,
    ),
    "fixes": (
        every_second(scenario("six", 50.0, fixes=True, gyroscope=True)),
        41_013,
        going_on.KEPT_S,
    ),
    "fixes of two antennas at rest": (hovering(50.0), 41_016, going_on.KEPT_S),
}


@pytest.mark.parametrize("which", LONG)
def test_a_stream_that_has_let_its_beginning_go_ends_there_as_well(which, monkeypatch):
    made, seed, kept_s = LONG[which]
    monkeypatch.setattr(going_on, "KEPT_S", kept_s)
    flight = simulate(made, np.random.default_rng(seed))
    if not flight.fixes:
        flight = with_heading(flight)
    stream = ObservationStream(STATED)
    parts = [stream.update(piece) for piece in pieces(flight)]
    assert epochs_s(stream.kept)[0] > epochs_s(flight)[-1] - kept_s - 2.0
    assert stream.kept.imu.t_s[0] > epochs_s(stream.kept)[0] - 2.0
    assert_joined([*parts, stream.finish()], STATED(flight))
