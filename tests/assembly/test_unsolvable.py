"""Flights without an answer: the text names the state or the measurement that is missing."""

import dataclasses

import numpy as np
import pytest

from fgnav.assembly.problem import build_problem
from fgnav.assembly.settings import ProblemSettings
from fgnav.checks import BadInputError, NoSolutionError
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.integers.resolvers.registry import default_resolver
from tests.methods.simulated import flown
from tests.methods.test_maximum_likelihood import Off

ARRAYS = ("tag_s", "code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")


def lacking(flight, *, antennas=None, channels=None, epochs=None, without=()):
    """The same flight with some antennas, channels or epochs, and without some observables."""
    seen = flight.observations
    change = {name: np.array(getattr(seen, name)) for name in ARRAYS}
    antennas = range(len(flight.antennas)) if antennas is None else antennas
    change = {name: value[:, list(antennas)] for name, value in change.items()}
    if channels is not None:
        change = {k: v if k == "tag_s" else v[..., channels] for k, v in change.items()}
        change["satellites"] = tuple(seen.satellites[j] for j in channels)
        change["signals"] = tuple(seen.signals[j] for j in channels)
    for name in without:
        change[name][:] = np.nan
    if epochs is not None:
        change = {k: change[k][epochs] if k in ARRAYS else v for k, v in change.items()}
        change["t_s"] = seen.t_s[epochs]
    return dataclasses.replace(
        flight,
        observations=dataclasses.replace(seen, **change),
        antennas=tuple(flight.antennas[k] for k in antennas),
        truth=None,
    )


def inertial(flight, **change):
    return dataclasses.replace(flight, imu=dataclasses.replace(flight.imu, **change))


def dark(flight):
    """Its detector never sees the beacon."""
    currents = np.zeros_like(flight.photodetector.currents)
    return dataclasses.replace(
        flight, photodetector=dataclasses.replace(flight.photodetector, currents=currents)
    )


CASES = {
    "no inertial record": (
        lambda f: dataclasses.replace(f, imu=None),
        r"motion: between epochs it needs an \[imu\], the flight has none",
    ),
    "no motion and no phase": (
        lambda f: lacking(f, without=("phase_cycles", "doppler_hz")),
        "attitude: .* the integers of the array's phases are not fixed, or too few",
    ),
    "one antenna": (
        lambda f: lacking(f, antennas=[0], without=("doppler_hz",)),
        "attitude: .* with one antenna roll needs Doppler or velocities, or a line of sight",
    ),
    "no position": (
        lambda f: lacking(f, without=("code_m",)),
        "no code observation of a supported satellite",
    ),
    "three satellites": (
        lambda f: lacking(f, channels=[0, 2, 3]),
        "position: no epoch has a code solution .*fewer satellites than unknowns",
    ),
    "no epoch": (lambda f: lacking(f, epochs=[]), "no code observation"),
    "one epoch": (lambda f: lacking(f, epochs=[5]), "attitude: 1 epochs .* needs 2 or more"),
    "two epochs": (
        lambda f: lacking(f, epochs=[5, 6]),
        "rate: 2 epochs with an attitude are too few .* without a gyroscope, needs 5",
    ),
    "one baseline and no Doppler": (
        lambda f: lacking(f, antennas=[0, 3], without=("doppler_hz",)),
        "attitude: .* array leaves roll open; a baseline out of line or Doppler determines them",
    ),
    "an inertial record of another time": (
        lambda f: inertial(f, t_s=f.imu.t_s + 100),
        "no GNSS epoch lies within the accelerometer's record, 100.000 to 10",
    ),
    "one inertial sample": (
        lambda f: inertial(f, t_s=f.imu.t_s[:1], f_b_mps2=f.imu.f_b_mps2[:1]),
        r"motion: the \[imu\] has 1 samples, needs 2",
    ),
    "a record that holds one attitude": (
        lambda f: inertial(f, t_s=f.imu.t_s[:2], f_b_mps2=f.imu.f_b_mps2[:2]),
        "1 within the accelerometer's record",
    ),
}


def build(flight, resolver=None):
    return build_problem(flight, ProblemSettings(resolver=resolver or Lambda()))


@pytest.mark.parametrize("name", CASES)
def test_what_is_missing_is_named(name):
    change, text = CASES[name]
    with pytest.raises(NoSolutionError, match=text):
        build(change(flown("demo", 5.0)))


def blind():
    """One antenna, no Doppler, and a detector that never sees."""
    return lacking(dark(flown("approach", 60.0)), antennas=[0], without=("doppler_hz",))


def test_a_detector_that_never_sees_beside_one_antenna_is_named():
    with pytest.raises(NoSolutionError, match=r"roll needs Doppler .* line of sight"):
        build(blind())


def contradicting(flight):
    """Phases that agree with no attitude: half a cycle of noise."""
    noise = np.random.default_rng(0).uniform(-0.5, 0.5, flight.observations.phase_cycles.shape)
    phase_cycles = flight.observations.phase_cycles + noise
    seen = dataclasses.replace(flight.observations, phase_cycles=phase_cycles)
    return dataclasses.replace(flight, observations=seen)


def test_phases_that_all_contradict_each_other_are_named():
    with pytest.raises(NoSolutionError, match="array phases contradict each other at"):
        build(contradicting(flown("demo", 5.0)))


def test_nothing_fixed_is_named():
    with pytest.raises(NoSolutionError, match="are not fixed, or too few"):
        build(flown("demo", 5.0), Off(nothing=True))


def test_an_array_at_one_place_is_named_whatever_else_there_is():
    flight = flown("demo", 5.0)
    heap = tuple(dataclasses.replace(one, position_b_m=np.zeros(3)) for one in flight.antennas)
    with pytest.raises(BadInputError, match="all antennas are at one place"):
        build(dataclasses.replace(flight, antennas=heap), default_resolver())
