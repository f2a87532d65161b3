"""GNSS receivers: code, carrier phase, Doppler and C/N0 of every antenna, from light time up."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray
from fgnav.earth import C_MPS, geodetic
from fgnav.gnss.atmosphere import klobuchar_m, saastamoinen_m
from fgnav.gnss.satellites import group_delay_s, look_angles, satellite_states
from fgnav.gnss.signals import frequency_hz, wavelengths_m
from fgnav.observations import LOST_LOCK, Observations
from fgnav.orbits import BroadcastOrbits
from fgnav_sim.clocks import clocks
from fgnav_sim.light_time import Links, links
from fgnav_sim.scenario import GnssTable, Scenario

_BLOCK = 500  # epochs at a time: 8 antennas and 40 satellites then need some 100 MB
_SCAN_S = 30.0  # a satellite climbs less than _MARGIN_RAD meanwhile
_MARGIN_RAD = np.radians(0.5)
_LARGEST_INTEGER = 1_000_000


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Channels:
    """Signals of satellites; ``at`` is each channel's place among ``in_view``, the satellites."""

    in_view: tuple[str, ...]
    at: IntArray
    satellites: tuple[str, ...]
    signals: tuple[str, ...]


def observe(
    sensor: GnssTable,
    scenario: Scenario,
    orbits: BroadcastOrbits,
    *,
    rng: np.random.Generator,
    progress: Callable[[float], None],
) -> Observations:
    """Return what the receivers measure.

    A receiver measures when its own clock shows the epoch, so its time tag is the epoch and its
    pseudorange holds its clock offset. All receivers track what the reference antenna has above the
    receivers' mask.

    Parameters
    ----------
    sensor : GnssTable
    scenario : Scenario
    orbits : BroadcastOrbits
    rng : numpy.random.Generator
    progress : callable
        Told the share done, up to 1.

    Raises
    ------
    BadInputError
        If no satellite is above the mask at any time.
    """
    clock_rng, cycles_rng, noise_rng = rng.spawn(3)
    t_s = scenario.epochs_s(sensor.rate_hz)
    channels = _channels(sensor, _in_view(sensor, scenario, orbits, t_s))
    offset_s, drift_sps = clocks(sensor.clock, t_s, len(scenario.antennas_b_m), rng=clock_rng)
    shape = (*offset_s.shape, len(channels.satellites))
    code_m, phase_m, rate_mps = np.empty((3, *shape))
    measured = _Measured(code_m, phase_m, rate_mps, np.empty(shape[::2]))
    for first in range(0, len(t_s), _BLOCK):
        block = slice(first, first + _BLOCK)
        seen = _links(scenario, orbits, channels, t_s[block, None] - offset_s[block])
        delays_m = _delays_m(sensor, scenario, orbits, channels, t_s[block], seen)
        measured.fill(block, seen, offset_s, drift_sps, delays_m)
        progress(min(1.0, (first + _BLOCK) / len(t_s)))
    measured.blur(sensor, noise_rng)
    return _observations(sensor, channels, t_s, measured, rng=cycles_rng)


@dataclass(frozen=True, eq=False, slots=True)
class _Measured:
    """Code, phase and range rate, (n, a, m), and elevation, (n, m), being filled."""

    code_m: FloatArray
    phase_m: FloatArray
    rate_mps: FloatArray
    elevation_rad: FloatArray

    def fill(
        self,
        block: slice,
        seen: Links,
        offset_s: FloatArray,
        drift_sps: FloatArray,
        delays_m: tuple[FloatArray, FloatArray],
    ) -> None:
        """Set what perfect receivers with these clocks would measure at a block of epochs."""
        biased_m = seen.range_m + C_MPS * (offset_s[block, :, None] - seen.clock_s)
        self.code_m[block] = biased_m + delays_m[0][:, None]
        self.phase_m[block] = biased_m + delays_m[1][:, None]
        drift = drift_sps[block, :, None] - seen.clock_drift_sps
        self.rate_mps[block] = seen.range_rate_mps + C_MPS * drift
        self.elevation_rad[block] = seen.elevation_rad

    def blur(self, sensor: GnssTable, rng: np.random.Generator) -> None:
        """Add white noise; each kind of measurement draws from its own generator."""
        sigmas = (sensor.code_noise_m, sensor.phase_noise_m, sensor.doppler_noise_mps)
        values = (self.code_m, self.phase_m, self.rate_mps)
        for value, sigma, own in zip(values, sigmas, rng.spawn(3), strict=True):
            for first in range(0, len(value), _BLOCK):
                block = slice(first, first + _BLOCK)
                factor = _noise_factor(sensor, self.elevation_rad[block])[:, None]
                value[block] += sigma * factor * own.standard_normal(value[block].shape)


def _observations(
    sensor: GnssTable,
    channels: _Channels,
    t_s: FloatArray,
    measured: _Measured,
    *,
    rng: np.random.Generator,
) -> Observations:
    """Return observations of what is above the mask; channels that never are have no place."""
    antennas = measured.code_m.shape[1]
    tracked = measured.elevation_rad > np.radians(sensor.receiver_mask_deg)
    rises = np.vstack([np.zeros_like(tracked[:1]), tracked[1:] & ~tracked[:-1]])
    wavelength_m = wavelengths_m(channels.satellites, channels.signals)
    kept = np.flatnonzero(tracked.any(axis=0))
    if not kept.size:
        raise _empty_sky(sensor)

    def dense(value: FloatArray) -> FloatArray:
        return np.where(tracked[:, None], value, np.nan)[..., kept]

    def alike(value: NDArray[Any]) -> NDArray[Any]:
        return np.repeat(value[:, None], antennas, axis=1)

    phase_cycles = measured.phase_m / wavelength_m + _cycles(channels, rises, antennas, rng=rng)
    return Observations(
        t_s=t_s,
        tag_s=np.repeat(t_s[:, None], antennas, axis=1),
        satellites=tuple(channels.satellites[k] for k in kept),
        signals=tuple(channels.signals[k] for k in kept),
        code_m=dense(measured.code_m),
        phase_cycles=dense(phase_cycles),
        doppler_hz=dense(-measured.rate_mps / wavelength_m),
        cn0_dbhz=dense(alike(_cn0_dbhz(measured.elevation_rad))),
        lock_flags=alike(LOST_LOCK * rises[:, kept]),
    )


def _in_view(
    sensor: GnssTable, scenario: Scenario, orbits: BroadcastOrbits, t_s: FloatArray
) -> tuple[str, ...]:
    """Return the satellites of the wanted constellations that may come above the mask."""
    names = np.unique(orbits.records["satellite"])
    wanted = tuple(str(name) for name in names if name[0] in sensor.signals)
    scan_s = np.append(np.arange(t_s[0], t_s[-1], _SCAN_S), t_s[-1])
    states = satellite_states(orbits, wanted, np.repeat(scan_s[:, None], len(wanted), axis=1))
    _, elevation_rad, _ = look_angles(_places_e_m(scenario, scan_s), states.p_e_m)
    lowest_rad = np.radians(sensor.receiver_mask_deg) - _MARGIN_RAD
    above = (elevation_rad > lowest_rad).any(axis=0)
    if not above.any():
        raise _empty_sky(sensor)
    return tuple(name for name, seen in zip(wanted, above, strict=True) if seen)


def _empty_sky(sensor: GnssTable) -> BadInputError:
    return BadInputError(
        f"gnss: no satellite of {', '.join(sensor.signals)} above receiver_mask_deg "
        f"{sensor.receiver_mask_deg:g} at this place and time"
    )


def _channels(sensor: GnssTable, in_view: tuple[str, ...]) -> _Channels:
    rows = [(k, name, s) for k, name in enumerate(in_view) for s in sensor.signals[name[0]]]
    return _Channels(
        in_view=in_view,
        at=np.array([k for k, _, _ in rows]),
        satellites=tuple(name for _, name, _ in rows),
        signals=tuple(signal for _, _, signal in rows),
    )


def _places_e_m(scenario: Scenario, t_s: FloatArray) -> FloatArray:
    return scenario.origin.frame.to_e(scenario.motion(t_s).p_n_m)


def _links(
    scenario: Scenario, orbits: BroadcastOrbits, channels: _Channels, t_s: FloatArray
) -> Links:
    """Return the links of all channels at true times of reception, (n, a)."""
    origin = scenario.origin.frame
    lever_b_m = np.tile(np.array(scenario.antennas_b_m), (len(t_s), 1))
    p_n_m, v_n_mps, _ = scenario.motion(t_s.ravel()).at(lever_b_m)
    p_e_m = origin.to_e(p_n_m).reshape(*t_s.shape, 3)
    v_e_mps = (v_n_mps @ origin.R_ne).reshape(*t_s.shape, 3)
    return links(orbits, channels.in_view, t_s, p_e_m, v_e_mps).of(channels.at)


def _delays_m(
    sensor: GnssTable,
    scenario: Scenario,
    orbits: BroadcastOrbits,
    channels: _Channels,
    t_s: FloatArray,
    seen: Links,
) -> tuple[FloatArray, FloatArray]:
    """Return what code and phase travel longer than light in vacuum, (n, m), at all antennas.

    The air is that of the reference antenna: 1 m of height changes it by 0.3 mm at the zenith.
    """
    times_s = np.repeat(t_s[:, None], len(channels.satellites), axis=1)
    late_m = C_MPS * group_delay_s(orbits, channels.satellites, channels.signals, times_s)
    if not sensor.atmosphere:
        return late_m, np.zeros_like(late_m)
    place = geodetic(_places_e_m(scenario, t_s))
    air_m = saastamoinen_m(place, seen.elevation_rad)
    ions_m = klobuchar_m(
        orbits.klobuchar, place, seen.elevation_rad, seen.azimuth_rad, scenario.start_gps_s + t_s
    )
    pairs = zip(channels.satellites, channels.signals, strict=True)
    hz = np.array([frequency_hz(*pair) for pair in pairs])
    ions_m *= (frequency_hz("G", "1C") / hz) ** 2
    return late_m + air_m + ions_m, air_m - ions_m


def _noise_factor(sensor: GnssTable, elevation_rad: FloatArray) -> FloatArray:
    if sensor.elevation_weights == "uniform":
        return np.ones_like(elevation_rad)
    return np.asarray(1.0 / np.sin(np.maximum(elevation_rad, np.radians(1.0))))


def _cn0_dbhz(elevation_rad: FloatArray) -> FloatArray:
    """Return a carrier-to-noise density that a patch antenna would see, by elevation."""
    return np.asarray(np.round(35.0 + 15.0 * np.sin(elevation_rad), 2))


def _cycles(
    channels: _Channels, rises: BoolArray, antennas: int, *, rng: np.random.Generator
) -> FloatArray:
    """Return what phase holds beside the way, cycles, (n, a, m).

    An arbitrary integer per antenna, channel and pass; a fraction per antenna and kind of signal
    and one per satellite's signal, as hardware delays are, which double differences remove.
    """
    passes = np.cumsum(rises, axis=0)
    kinds = [name[0] + s for name, s in zip(channels.satellites, channels.signals, strict=True)]
    kind = np.unique(kinds, return_inverse=True)[1]
    of_receiver = rng.random((antennas, kind.max() + 1))[:, kind]
    of_satellite = rng.random(len(kind))
    integers = rng.integers(
        -_LARGEST_INTEGER, _LARGEST_INTEGER, (passes.max() + 1, antennas, len(kind))
    )
    constant = integers + of_receiver + of_satellite
    # All channels of one pass number at once: few passes, so no array of indices (n, a, m).
    return np.asarray(constant.transpose(0, 2, 1)[passes, np.arange(len(kind))].swapaxes(1, 2))
