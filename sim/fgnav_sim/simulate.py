"""From a scenario and a seeded generator to a flight whose truth is known."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from fgnav.checks import Loss
from fgnav.flight import Antenna, Flight, GnssNoise, Truth
from fgnav.orbits import BroadcastOrbits
from fgnav_sim.constellation import KLOBUCHAR, built_in_orbits
from fgnav_sim.detector import watch
from fgnav_sim.fixes import fix
from fgnav_sim.inertial import sense
from fgnav_sim.receiver import observe
from fgnav_sim.scenario import GnssTable, Scenario


def _silent(_share: float) -> None:
    """Take note of progress where nobody watches."""


def simulate(
    scenario: Scenario, rng: np.random.Generator, progress: Callable[[float], None] = _silent
) -> Flight:
    """Return the flight that a scenario describes, with its truth.

    Every sensor draws from a generator of its own, so switching one on or off, or changing its
    figures, leaves the noise of the others as it was.

    Parameters
    ----------
    scenario : Scenario
    rng : numpy.random.Generator
        The same seed gives the same flight, bit by bit.
    progress : callable
        Told the share done, up to 1, while the receivers run: that is nearly all of the time.

    Raises
    ------
    BadInputError
        If a navigation file is bad, or no satellite is ever in view.
    """
    gnss_rng, imu_rng, fixes_rng, seeker_rng = rng.spawn(4)
    gnss, imu, fixes, seeker = scenario.gnss, scenario.imu, scenario.fixes, scenario.seeker
    orbits = _orbits(gnss, scenario) if gnss else None
    watched = watch(seeker, scenario, rng=seeker_rng) if seeker else None
    unseen = Loss(what="seeker", reason="beacon never within range and field of view", count=1)
    return Flight(
        name=scenario.name,
        start_gps_s=scenario.start_gps_s,
        origin=scenario.origin.frame,
        antennas=_antennas(scenario),
        observations=observe(gnss, scenario, orbits, rng=gnss_rng, progress=progress)
        if gnss and orbits
        else None,
        broadcast=orbits,
        elevation_mask_rad=np.radians(gnss.elevation_mask_deg if gnss else 10.0),
        gnss_noise=_noise(gnss) if gnss else GnssNoise(),
        imu=sense(imu, scenario, rng=imu_rng) if imu else None,
        fixes=fix(fixes, scenario, "a1", rng=fixes_rng) if fixes else None,
        seeker=watched,
        truth=_truth(scenario),
        losses=(unseen,) if seeker and watched is None else (),
    )


def _antennas(scenario: Scenario) -> tuple[Antenna, ...]:
    """Return the antennas that say something: all with receivers, else that of the fixes."""
    count = len(scenario.antennas_b_m) if scenario.gnss else int(scenario.fixes is not None)
    return tuple(
        Antenna(name=f"a{k}", position_b_m=np.array(lever_b_m))
        for k, lever_b_m in enumerate(scenario.antennas_b_m[:count], start=1)
    )


def _orbits(gnss: GnssTable, scenario: Scenario) -> BroadcastOrbits:
    """Return the satellites of the scenario's files, or the built-in ones.

    Without an atmosphere there are no coefficients of one either: estimators take zeros for none.
    """
    if gnss.navigation:
        from fgnav.io.rinex import read_navigation  # noqa: PLC0415  # lazy: it loads RTKLIB

        orbits = read_navigation([Path(name) for name in gnss.navigation], scenario.start_gps_s)
        if gnss.atmosphere:
            return orbits
        return BroadcastOrbits(records=orbits.records, klobuchar=np.zeros(8), losses=orbits.losses)
    klobuchar = KLOBUCHAR if gnss.atmosphere else np.zeros(8)
    return built_in_orbits(
        tuple(gnss.signals), scenario.start_gps_s, scenario.duration_s, klobuchar
    )


def _noise(gnss: GnssTable) -> GnssNoise:
    return GnssNoise(
        code_m=gnss.code_noise_m,
        phase_m=gnss.phase_noise_m,
        doppler_mps=gnss.doppler_noise_mps,
        elevation_weights=gnss.elevation_weights,
    )


def _truth(scenario: Scenario) -> Truth:
    t_s = scenario.epochs_s(scenario.truth_rate_hz)
    state = scenario.motion(t_s)
    return Truth(t_s=t_s, p_n_m=state.p_n_m, v_n_mps=state.v_n_mps, R_nb=state.R_nb)
