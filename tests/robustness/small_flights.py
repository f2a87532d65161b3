"""Two flights of four seconds that hold every kind of file, written once."""

import gzip
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np

from fgnav.geometry.earth import C_MPS
from fgnav.gnss.orbits.satellites import satellite_states
from fgnav.io.flight.folder import save_flight
from fgnav.types.orbits import PreciseOrbits
from fgnav_sim.scenario import FixesTable, load_scenario
from fgnav_sim.simulate import simulate

SCENARIOS = Path(__file__).resolve().parents[2] / "sim" / "fgnav_sim" / "scenarios"
ANTENNAS_B_M = ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.1))
SEED = 25_000


def write_flights(folder: Path) -> tuple[Path, ...]:
    """Write a flight of three antennas with RINEX and SP3, and one of fixes and instruments."""
    rng = np.random.default_rng(SEED)
    array, instruments = folder / "array", folder / "instruments"
    save_flight(_array(rng), array)
    antenna = array / "a3.rnx"  # a packed one, too
    antenna.write_bytes(gzip.compress(antenna.read_bytes(), mtime=0))
    save_flight(_instruments(rng), instruments)
    return array, instruments


def _array(rng):
    """Return a flight of raw observations, orbits both ways, and an accelerometer."""
    demo = load_scenario(SCENARIOS / "demo.toml")
    flight = simulate(_short(demo, antennas_b_m=ANTENNAS_B_M), rng)
    return replace(flight, precise=_tabulated(flight.broadcast))


def _instruments(rng):
    """Return a flight of a receiver's own fixes, a gyroscope and whatever else is read."""
    surroundings = load_scenario(SCENARIOS / "surroundings.toml")
    scenario = _short(
        load_scenario(SCENARIOS / "approach.toml"),
        antennas_b_m=ANTENNAS_B_M[:1],
        gnss=None,
        fixes=FixesTable(rate_hz=5.0),
        barometer=surroundings.barometer,
        magnetometer=surroundings.magnetometer,
    )
    gyroscope = msgspec.structs.replace(surroundings.imu, rate_hz=50.0)
    photodetector = msgspec.structs.replace(scenario.photodetector, range_m=2e4)
    return simulate(
        msgspec.structs.replace(scenario, imu=gyroscope, photodetector=photodetector), rng
    )


def _short(scenario, **changes):
    """Return a scenario of four seconds at low rates."""
    gnss = scenario.gnss and msgspec.structs.replace(scenario.gnss, rate_hz=5.0, outages=())
    imu = msgspec.structs.replace(scenario.imu, rate_hz=50.0)
    return msgspec.structs.replace(
        scenario, **({"duration_s": 4.0, "gnss": gnss, "imu": imu} | changes)
    )


def _tabulated(messages) -> PreciseOrbits:
    """Return what broadcast messages say, as a table of half an hour to both sides."""
    names = tuple(np.unique(messages.records["satellite"]).tolist())
    t_s = np.arange(-1800.0, 1801.0, 300.0)
    states = satellite_states(messages, names, np.repeat(t_s[:, None], len(names), axis=1))
    periodic_s = 2 * np.einsum("nmi,nmi->nm", states.p_e_m, states.v_e_mps) / C_MPS**2
    return PreciseOrbits(
        t_s=t_s, satellites=names, p_e_m=states.p_e_m, clock_s=states.clock_s + periodic_s
    )
