"""Phases louder than stated are identified as that; slips and errors of satellites are none."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.gnss.undifferenced import undifferenced
from fgnav.identification.likelihood.satellite_errors import phase_evidence
from fgnav.identification.noise.loud_phases import loud_spans, loudness_notes
from fgnav.methods.smoother import Smoother
from fgnav.types.instruments import LoudPhases
from tests.gnss.based import flown
from tests.identification.test_satellite_errors import dense_log_likelihood, phases
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.flights import right_flight

CYCLES = 0.16  # .003 m are stated
TIMES = np.hypot(CYCLES * 0.1903, 0.003) / 0.003
SHOWN = 4 / np.sqrt(2 * 40 * 4 * 2 / 3)  # sigmas of the logarithm, of 40 steps of 8 satellites


@pytest.fixture(scope="module")
def right():
    return right_flight("raw", 80_200_000)


def with_noise(flight, from_s, until_s):
    seen, rng = flight.observations, np.random.default_rng(80_200_001)
    inside = (seen.t_s >= from_s) & (seen.t_s <= until_s)
    noise = inside[:, None, None] * CYCLES * rng.normal(size=seen.phase_cycles.shape)
    seen = replace(seen, phase_cycles=seen.phase_cycles + noise)
    return replace(flight, observations=seen)


def spans(flight):
    return loud_spans(flight.observations, undifferenced(flight))


@pytest.mark.parametrize(("from_s", "until_s"), [(-np.inf, np.inf), (3.1, 9.1), (4.1, np.inf)])
def test_noise_is_found_with_its_size_and_when(right, from_s, until_s):
    (one,) = spans(with_noise(right, from_s, until_s))
    assert abs(np.log(one.factor / TIMES)) < SHOWN + 0.05  # factors are .1 apart
    for edge_s, true_s in ((one.from_s, from_s), (one.until_s, until_s)):
        assert edge_s == true_s or abs(edge_s - true_s) <= 0.6  # three epochs


@pytest.mark.parametrize("seed", range(80_200_010, 80_200_015))
def test_a_right_flight_has_none(seed):
    assert spans(right_flight("raw", seed)) == ()


def test_slips_are_no_noise(right):
    """An eighth of the epochs; of all channels at one, too, which no step after has any more."""
    seen, rng = right.observations, np.random.default_rng(80_200_002)
    slips = rng.integers(1, 6, seen.phase_cycles.shape) / 2
    slips *= rng.random(slips.shape) < 0.015
    slips[30] = rng.integers(-9, 9, slips[30].shape)
    cycles = seen.phase_cycles + slips.cumsum(axis=0)
    assert spans(replace(right, observations=replace(seen, phase_cycles=cycles))) == ()


def test_jumps_of_the_clock_are_no_noise(right):
    """As a receiver's of a millisecond: satellites are taken where they were then."""
    seen = right.observations
    jumps_s = 1e-3 * np.isin(np.arange(len(seen.t_s)), (12, 30, 47)).cumsum()[:, None, None]
    seen = replace(
        seen,
        phase_cycles=seen.phase_cycles + 1_575.42e6 * jumps_s,
        code_m=seen.code_m + 299_792_458.0 * jumps_s,
    )
    assert spans(replace(right, observations=seen)) == ()


def test_a_loss_of_lock_that_is_reported_is_no_noise(right):
    seen, rng = right.observations, np.random.default_rng(80_200_003)
    lost = rng.random(seen.phase_cycles.shape) < 0.5
    cycles = seen.phase_cycles + (lost * 0.2 * rng.normal(size=lost.shape)).cumsum(axis=0)
    flags = np.where(lost, seen.lock_flags | 1, seen.lock_flags)
    seen = replace(seen, phase_cycles=cycles, lock_flags=flags)
    assert spans(replace(right, observations=seen)) == ()


def test_errors_of_satellites_that_move_are_no_noise():
    """A second from one epoch to the next they are steps of 1 cm; they are the same all along."""
    moving = {"satellite_error_rate_mps": 1e-2, "message_errors": True, "rate_hz": 1.0}
    flight = flown.__wrapped__(base=None, seed=93_011, gyroscope=True, **moving)
    noise = replace(flight.gnss_noise, satellite_error_rate_mps=2e-4)
    flight = replace(flight, gnss_noise=noise)
    assert spans(flight)
    notes = Smoother().prepare(flight).notes
    assert not any("Noise of phases" in note for note in notes)
    assert any("Rate of satellites' errors" in note for note in notes)


def test_the_evidence_is_a_density():
    """It falls by the logarithm of what rows, codes left out, are multiplied by."""
    phase = phases(93_020, 4.0, message_errors=True)
    blocks = [
        one._replace(
            **{name: getattr(one, name)[: one.size] for name in ("before", "after", "right")}
        )
        for one in phase.blocks
    ]
    likelihood = dense_log_likelihood(replace(phase, blocks=blocks))
    likelihood += sum(np.log(one.after.diagonal()).sum() for one in blocks)
    # Of steps free of the place what it is multiplied with is left out: alike in all of them.
    freed = sum(np.linalg.slogdet(one.G.T @ one.G)[1] / 2 for one in phase.rows)
    evidence = phase_evidence(phase, np.ones(len(phase.row)))
    assert abs(evidence - likelihood - freed) < 1e-3
    louder = phase_evidence(phase, np.full(len(phase.row), 2.0))
    freedom = sum(len(one.z) - 3 for one in phase.rows)
    assert abs(evidence - louder - freedom * np.log(2.0)) < 1e-9


def test_attitudes_beside_loud_phases_are_as_sure_as_they_are(right):
    """Every epoch was a slip, and what one of .47 cycles left had an attitude NEES of 57."""
    loud = with_noise(right, 3.1, np.inf)
    estimate = Smoother()(loud)
    (note,) = [one for one in estimate.notes if "Noise of phases" in one]
    assert "s on is" in note
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 10.0


def test_a_note_tells_when():
    noise = right_flight("raw", 1).gnss_noise
    spans = (
        LoudPhases(-np.inf, np.inf, 3.0), LoudPhases(-np.inf, 2.0, 3.0),
        LoudPhases(1.0, 2.0, 3.0), LoudPhases(1.0, np.inf, 3.0),
    )  # fmt: skip
    notes = loudness_notes(replace(noise, loud_phases=spans))
    for note, when in zip(
        notes, ("throughout", "until 2.0 s", "from 1.0 to 2.0 s", "from 1.0 s on"), strict=True
    ):
        assert note == (
            f"Noise of phases {when} is 3 x what flight.toml states, 0.009 m: used instead."
        )
