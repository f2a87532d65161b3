"""From a scenario and a seeded generator to a flight whose truth is known."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import msgspec
import numpy as np

from fgnav.checks import Unused
from fgnav.types.flight import Antenna, Flight, GnssNoise, LinkIntegers, Truth
from fgnav.types.orbits import BroadcastOrbits, PreciseOrbits
from fgnav.types.vehicle import FinnedVehicle
from fgnav_sim.dispersions import Draw, disperse
from fgnav_sim.gnss.base import stand
from fgnav_sim.gnss.constellation import KLOBUCHAR, built_in_orbits, orbits_of_files
from fgnav_sim.gnss.fixes import baseline, fix
from fgnav_sim.gnss.receiver import observe
from fgnav_sim.gnss.tables import GnssTable, antenna_names
from fgnav_sim.propagation.message_errors import with_message_errors
from fgnav_sim.scenario import Scenario
from fgnav_sim.sensors import detector, inertial
from fgnav_sim.sensors.surroundings import point, press
from fgnav_sim.vehicle.tables import Vehicle

_STILL = 1e-6  # m/s and m per root second, of satellites without errors: far below any noise


class Simulated(NamedTuple):
    """A flight, and what was drawn for it of the scenario's dispersions."""

    flight: Flight
    draws: tuple[Draw, ...]


def simulate(scenario: Scenario, rng: np.random.Generator) -> Flight:
    """Return the flight that a scenario describes, with its truth.

    Every sensor draws from a generator of its own, so switching one on or off, or changing its
    figures, leaves the noise of the others as it was.

    Parameters
    ----------
    rng : numpy.random.Generator
        The same seed gives the same flight, bit by bit.

    Raises
    ------
    BadInputError
        If a navigation file is bad, no satellite is ever in view, or a rigid body cannot be flown.
    """
    return simulate_dispersed(scenario, rng).flight


def simulate_dispersed(scenario: Scenario, rng: np.random.Generator) -> Simulated:
    """Return the flight of ``simulate`` with what was drawn for it; it reports its progress."""
    streams = rng.spawn(8)
    dispersed, draws = disperse(scenario, scenario.dispersions, streams[4])
    moving, unused = dispersed, tuple[Unused, ...]()
    if scenario.flown:
        from fgnav_sim.vehicle.take_off import take_off  # noqa: PLC0415  # lazy: compiled code

        moving, unused = take_off(dispersed, streams[5])
    flight = _sensed(moving, streams)
    vehicle = _finned(dispersed)
    return Simulated(replace(flight, unused=unused + flight.unused, vehicle=vehicle), draws)


def _finned(scenario: Scenario) -> FinnedVehicle | None:
    """Return the vehicle model of a flight with fins; None without."""
    flown = scenario.flown
    if flown is None or not isinstance(flown.vehicle, Vehicle) or flown.vehicle.fins is None:
        return None
    return flown.vehicle.fins.stated()


def _sensed(scenario: Scenario, rngs: Sequence[np.random.Generator]) -> Flight:
    """Return the measurements of a scenario's sensors; each has its place in rngs."""
    (
        gnss_rng,
        imu_rng,
        fixes_rng,
        photodetector_rng,
        drawn_rng,
        _,
        barometer_rng,
        magnetometer_rng,
    ) = rngs
    baseline_rng = barometer_rng.spawn(1)[0]
    gnss, imu, fixes, photodetector = (
        scenario.gnss,
        scenario.imu,
        scenario.fixes,
        scenario.photodetector,
    )
    barometer, magnet = scenario.barometer, scenario.magnetometer
    broadcast, precise = _orbits(gnss, scenario) if gnss else (None, None)
    flown = precise or broadcast
    real = _misplaced(scenario, drawn_rng.spawn(1)[0])
    watched = (
        detector.watch(photodetector, scenario, rng=photodetector_rng) if photodetector else None
    )
    sensed = inertial.sense(imu, scenario, rng=imu_rng) if imu else None
    unused = inertial.saturated(imu, sensed) if imu and sensed else ()
    if photodetector and watched:
        unused += detector.saturated(photodetector, watched)
    elif photodetector:
        reason = "beacon never within range and field of view"
        unused += (Unused(what="photodetector", reason=reason, count=1),)
    received = base = None
    if gnss and flown:
        received = observe(gnss, real, flown, messages=broadcast, rng=gnss_rng)
        if gnss.base:
            base = stand(
                gnss.base,
                gnss,
                scenario,
                flown,
                messages=broadcast,
                satellite_cycles=received.satellite_cycles,
                rng=gnss_rng.spawn(1)[0],
            )
    flight = Flight(
        name=scenario.name,
        start_gps_s=scenario.start_gps_s,
        origin=scenario.origin.frame,
        antennas=_antennas(scenario),
        observations=received.observations if received else None,
        broadcast=broadcast,
        precise=precise,
        elevation_mask_rad=np.radians(gnss.elevation_mask_deg if gnss else 10.0),
        gnss_noise=_noise(gnss) if gnss else GnssNoise(),
        base=base,
        imu=sensed,
        fixes=tuple(fix(fixes, real, fixes_rng)) if fixes else (),
        baselines=(baseline(scenario.baseline, real, baseline_rng),) if scenario.baseline else (),
        photodetector=watched,
        barometer=press(barometer, scenario, rng=barometer_rng) if barometer else None,
        magnetometer=point(magnet, scenario, rng=magnetometer_rng) if magnet else None,
        truth=_truth(scenario, received.integers if received else None),
        unused=unused,
    )
    if gnss and gnss.message_errors:
        return with_message_errors(flight, gnss_rng.spawn(1)[0])
    return flight


def _misplaced(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """Return a scenario whose antennas sit where they really do."""
    nominal_b_m = np.array(scenario.antennas_b_m)
    error_b_m = scenario.antenna_misplacement_m * rng.standard_normal(nominal_b_m.shape)
    positions = tuple((x, y, z) for x, y, z in (nominal_b_m + error_b_m).tolist())
    return msgspec.structs.replace(scenario, antennas_b_m=positions)


def _antennas(scenario: Scenario) -> tuple[Antenna, ...]:
    """Return the antennas that a receiver speaks of: all with observations."""
    names = antenna_names(len(scenario.antennas_b_m))
    used = {*scenario.fixes.antennas} if scenario.fixes else set()
    used |= {*scenario.baseline.antennas} if scenario.baseline else set()
    return tuple(
        Antenna(name=name, position_b_m=np.array(lever_b_m))
        for name, lever_b_m in zip(names, scenario.antennas_b_m, strict=True)
        if scenario.gnss or name in used
    )


def _orbits(
    gnss: GnssTable, scenario: Scenario
) -> tuple[BroadcastOrbits | None, PreciseOrbits | None]:
    """Return the messages and the tables of the scenario's files, or the built-in messages.

    Without an atmosphere there are no coefficients of one either: estimators take zeros for none.
    """
    if not (gnss.navigation or gnss.orbits):
        klobuchar = KLOBUCHAR if gnss.atmosphere else np.zeros(8)
        letters = tuple(gnss.signals)
        return built_in_orbits(letters, scenario.start_gps_s, scenario.duration_s, klobuchar), None
    broadcast, precise = orbits_of_files(gnss.navigation, gnss.orbits, scenario.start_gps_s)
    if broadcast and not gnss.atmosphere:
        broadcast = replace(broadcast, klobuchar=np.zeros(8))
    return broadcast, precise


def _noise(gnss: GnssTable) -> GnssNoise:
    """Return the nominal noise of a link: its noise and multipath from anywhere together."""
    echoes, errs = gnss.multipath, gnss.message_errors or bool(gnss.orbits)
    rate_mps, walk = gnss.satellite_error_rate_mps, gnss.satellite_error_walk_m_per_sqrt_s
    return GnssNoise(
        code_m=math.hypot(gnss.code_noise_m, echoes.code_m if echoes else 0.0),
        phase_m=math.hypot(gnss.phase_noise_m, echoes.phase_m if echoes else 0.0),
        doppler_mps=gnss.doppler_noise_mps,
        elevation_weights=gnss.elevation_weights,
        atmosphere=gnss.atmosphere,
        wind_up=gnss.wind_up,
        message_errors=errs,
        satellite_error_rate_mps=rate_mps if errs else _STILL,
        satellite_error_walk_m_per_sqrt_s=walk if errs else _STILL,
    )


def _truth(scenario: Scenario, integers: LinkIntegers | None) -> Truth:
    t_s = scenario.epochs_s(scenario.truth_rate_hz)
    state = scenario.motion(t_s)
    return Truth(
        t_s=t_s,
        p_n_m=state.p_n_m,
        v_n_mps=state.v_n_mps,
        R_nb=state.R_nb,
        integers=integers,
        source="simulated",
    )
