"""GNSS receivers: code, carrier phase, Doppler and C/N0 of every antenna, from light time up."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray
from fgnav.geometry.earth import C_MPS, geodetic, ned_axes
from fgnav.gnss.signals import wavelengths_m
from fgnav.progress import report
from fgnav.types.flight import LinkIntegers
from fgnav.types.observations import LOST_LOCK, Observations
from fgnav.types.orbits import BroadcastOrbits, PreciseOrbits
from fgnav_sim.gauss_markov import gauss_markov
from fgnav_sim.gnss.channels import Channels, channels_in_view, empty_sky, places_e_m
from fgnav_sim.gnss.clocks import clocks
from fgnav_sim.gnss.interruptions import LARGEST_INTEGER, Sky, Tracking, track
from fgnav_sim.gnss.selection import chosen
from fgnav_sim.gnss.tables import GnssTable, MultipathTable, antenna_names
from fgnav_sim.gnss.true_integers import link_integers
from fgnav_sim.propagation.delays import delays_m
from fgnav_sim.propagation.light_time import Links, links
from fgnav_sim.propagation.multipath import Echoes, echoes
from fgnav_sim.propagation.wind_up import wind_up
from fgnav_sim.scenario import Scenario

_BLOCK = 500  # epochs at a time: 8 antennas and 40 satellites then need some 100 MB


def observe(
    sensor: GnssTable,
    scenario: Scenario,
    orbits: BroadcastOrbits | PreciseOrbits,
    *,
    messages: BroadcastOrbits | None = None,
    satellite_cycles: Mapping[tuple[str, str], float] | None = None,
    rng: np.random.Generator,
) -> "Received":
    """Return the observations of the receivers, and their true integers.

    A receiver measures when its own clock shows the epoch, so its time tag is the epoch and its
    pseudorange holds its clock offset. All receivers track what the reference antenna has above the
    receivers' mask, as long as nothing interrupts them.

    Parameters
    ----------
    orbits : BroadcastOrbits or PreciseOrbits
        How the satellites fly.
    messages : BroadcastOrbits or None
        Where orbits are tables: the messages that state group delays and the ionosphere, if any.
    satellite_cycles : mapping, optional
        What satellites add to the phase of a channel, by satellite and signal; drawn where it is
        not given.

    Raises
    ------
    BadInputError
        If no satellite is above the mask at any time, or none of its links is ever tracked.
    """
    clock_rng, cycles_rng, noise_rng, tracking_rng, echo_rng = rng.spawn(5)
    t_s = scenario.epochs_s(sensor.rate_hz)
    channels = channels_in_view(sensor, scenario, orbits, t_s)
    antennas = len(scenario.antennas_b_m)
    offset_s, drift_sps = clocks(sensor.clock, t_s, antennas, rng=clock_rng)
    measured = _Measured.empty(sensor, (len(t_s), antennas, len(channels.satellites)))
    for first in range(0, len(t_s), _BLOCK):
        block = slice(first, first + _BLOCK)
        links = _links(scenario, orbits, channels, t_s[block, None] - offset_s[block])
        delay_m = delays_m(sensor, scenario, messages or orbits, channels, t_s[block], links)
        measured.fill(block, links, offset_s, drift_sps, delay_m)
        if measured.e_b is not None:
            true_s = t_s[block] - offset_s[block, 0]
            measured.e_b[block] = e_b = _directions_b(scenario, true_s, links)
            if sensor.reflectors:
                measured.mirror(block, _echoes(sensor, scenario, channels, true_s, e_b))
        report(min(1.0, (first + _BLOCK) / len(t_s)))
    if sensor.wind_up and measured.e_b is not None:
        true_s = t_s - offset_s[:, 0]
        state = scenario.motion(true_s)
        pole_b = scenario.origin.frame.R_ne[:, 2] @ state.R_nb
        measured.wind(*wind_up(measured.e_b, pole_b, state.w_nb_b_radps, true_s), channels)
    measured.blur(sensor, noise_rng)
    if sensor.multipath is not None:
        measured.echo(sensor, sensor.multipath, echo_rng)
    above = _above(sensor, channels, measured, t_s)
    tracking = track(sensor, above, measured.sky, t_s, antennas, rng=tracking_rng)
    given = satellite_cycles or {}
    return _received(sensor, channels, t_s, measured, above, tracking, given, rng=cycles_rng)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Received:
    """Observations of all antennas, and the true integers of their phase.

    ``satellite_cycles`` is the fraction of a cycle that each satellite's signal brings along.
    """

    observations: Observations
    integers: LinkIntegers
    satellite_cycles: dict[tuple[str, str], float]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Measured:
    """Code, phase, range rate, (n, a, m), and angles, (n, m), being filled.

    ``gain_db``, (n, a, m), and ``e_b``, (n, m, 3), are there where something asks for them.
    """

    code_m: FloatArray
    phase_m: FloatArray
    rate_mps: FloatArray
    elevation_rad: FloatArray
    azimuth_rad: FloatArray
    gain_db: FloatArray
    e_b: FloatArray | None

    @staticmethod
    def empty(sensor: GnssTable, shape: tuple[int, int, int]) -> "_Measured":
        """Return room for measurements."""
        code_m, phase_m, rate_mps = np.empty((3, *shape))
        elevation_rad, azimuth_rad = np.empty((2, *shape[::2]))
        needs_directions = bool(sensor.reflectors) or sensor.body_mask is not None or sensor.wind_up
        return _Measured(
            code_m=code_m,
            phase_m=phase_m,
            rate_mps=rate_mps,
            elevation_rad=elevation_rad,
            azimuth_rad=azimuth_rad,
            gain_db=np.zeros(shape if sensor.reflectors else (shape[0], 1, 1)),
            e_b=np.empty((*shape[::2], 3)) if needs_directions else None,
        )

    @property
    def sky(self) -> Sky:
        """Directions of the satellites."""
        return Sky(elevation_rad=self.elevation_rad, azimuth_rad=self.azimuth_rad, e_b=self.e_b)

    def fill(
        self,
        block: slice,
        links: Links,
        offset_s: FloatArray,
        drift_sps: FloatArray,
        delay_m: tuple[FloatArray, FloatArray],
    ) -> None:
        """Set what perfect receivers with these clocks would measure at a block of epochs."""
        biased_m = links.range_m + C_MPS * (offset_s[block, :, None] - links.clock_s)
        self.code_m[block] = biased_m + delay_m[0][:, None]
        self.phase_m[block] = biased_m + delay_m[1][:, None]
        drift = drift_sps[block, :, None] - links.clock_drift_sps
        self.rate_mps[block] = links.range_rate_mps + C_MPS * drift
        self.elevation_rad[block] = links.elevation_rad
        self.azimuth_rad[block] = links.azimuth_rad

    def mirror(self, block: slice, echo: Echoes) -> None:
        """Add what the body mirrors, at a block of epochs."""
        self.code_m[block] += echo.code_m
        self.phase_m[block] += echo.phase_m
        self.rate_mps[block] += echo.rate_mps
        self.gain_db[block] += echo.gain_db

    def wind(self, cycles: FloatArray, rate_hz: FloatArray, channels: Channels) -> None:
        """Add the phase's wind-up, cycles, and its rate, (n, m), to all antennas alike."""
        wavelength_m = wavelengths_m(channels.satellites, channels.signals)
        self.phase_m[:] += (wavelength_m * cycles)[:, None]
        self.rate_mps[:] += (wavelength_m * rate_hz)[:, None]

    def blur(self, sensor: GnssTable, rng: np.random.Generator) -> None:
        """Add white noise; each kind of measurement draws from its own generator."""
        sigmas = (sensor.code_noise_m, sensor.phase_noise_m, sensor.doppler_noise_mps)
        values = (self.code_m, self.phase_m, self.rate_mps)
        for value, sigma, kind_rng in zip(values, sigmas, rng.spawn(3), strict=True):
            for first in range(0, len(value), _BLOCK):
                block = slice(first, first + _BLOCK)
                factor = self.noise_factor(sensor, block)
                value[block] += sigma * factor * kind_rng.standard_normal(value[block].shape)

    def echo(self, sensor: GnssTable, table: MultipathTable, rng: np.random.Generator) -> None:
        """Add echoes from anywhere, one antenna after the other."""
        weight = _elevation_factor(sensor, self.elevation_rad)
        pairs = ((self.code_m, table.code_m), (self.phase_m, table.phase_m))
        for (value, sigma), kind_rng in zip(pairs, rng.spawn(2), strict=True):
            for antenna in range(value.shape[1]):
                process = gauss_markov(
                    table.time_constant_s, 1 / sensor.rate_hz, weight.shape, rng=kind_rng
                )
                value[:, antenna] += sigma * weight * process

    def noise_factor(self, sensor: GnssTable, block: slice) -> FloatArray:
        """Return the noise of a block of epochs against that at the zenith, (n, a or 1, m)."""
        if sensor.cn0.sets_noise:
            short_db = sensor.cn0.zenith_dbhz - self.cn0_dbhz(sensor, block)
            # Thermal noise of tracking loops goes with 1 / sqrt(C/N0): Kaplan and Hegarty,
            # Understanding GPS/GNSS, the receivers' PLL and DLL; squaring losses left out.
            factor: FloatArray = 10 ** (short_db / 20)
        else:
            factor = _elevation_factor(sensor, self.elevation_rad[block])[:, None]
        per_antenna = np.array(sensor.antenna_noise or (1.0,))
        return np.asarray(factor * per_antenna[None, :, None])

    def cn0_dbhz(self, sensor: GnssTable, block: slice) -> FloatArray:
        """Return carrier-to-noise density, as a patch antenna would see it, (n, a or 1, m)."""
        low, high = sensor.cn0.horizon_dbhz, sensor.cn0.zenith_dbhz
        by_elevation = low + (high - low) * np.sin(self.elevation_rad[block])
        return np.asarray(by_elevation[:, None] + self.gain_db[block])


def _above(
    sensor: GnssTable, channels: Channels, measured: _Measured, t_s: FloatArray
) -> BoolArray:
    """Select the channels above the mask, and chosen, (n, m)."""
    above = measured.elevation_rad > np.radians(sensor.receiver_mask_deg)
    if sensor.choose == "all":
        return np.asarray(above)
    first = np.unique(channels.at, return_index=True)[1]  # of each satellite
    of_satellites = chosen(
        sensor.choose,
        above[:, first],
        measured.elevation_rad[:, first],
        measured.azimuth_rad[:, first],
        t_s,
    )
    return np.asarray(of_satellites[:, channels.at])


def _received(
    sensor: GnssTable,
    channels: Channels,
    t_s: FloatArray,
    measured: _Measured,
    above: BoolArray,
    tracking: Tracking,
    given: Mapping[tuple[str, str], float],
    *,
    rng: np.random.Generator,
) -> Received:
    """Return observations of what is tracked; channels that never are have no place."""
    antennas = measured.code_m.shape[1]
    kept = np.flatnonzero(tracking.tracked.any(axis=(0, 1)))
    if not above.any():
        raise empty_sky(sensor)
    if not kept.size:
        raise BadInputError("gnss: no link is ever tracked; outages or body_mask cover them all")
    wavelength_m = wavelengths_m(channels.satellites, channels.signals)
    rises = np.vstack([np.zeros_like(above[:1]), above[1:] & ~above[:-1]])

    def dense(value: FloatArray) -> FloatArray:
        return np.where(tracking.tracked, value, np.nan)[..., kept]

    of_satellite, of_receiver, integers = _cycles(channels, rises, antennas, rng=rng)
    pairs = tuple(zip(channels.satellites, channels.signals, strict=True))
    drawn = dict(zip(pairs, of_satellite.tolist(), strict=True))
    sent = {pair: given.get(pair, fraction) for pair, fraction in drawn.items()}
    fractions = of_receiver + np.array(list(sent.values()))
    cycles = integers + 0.5 * tracking.half_cycles
    cn0_dbhz = np.round(measured.cn0_dbhz(sensor, slice(None)), 2)
    flags: NDArray[Any] = LOST_LOCK * tracking.flagged[..., kept]
    observations = Observations(
        t_s=t_s,
        tag_s=np.repeat(t_s[:, None], antennas, axis=1),
        satellites=tuple(channels.satellites[k] for k in kept),
        signals=tuple(channels.signals[k] for k in kept),
        code_m=dense(measured.code_m),
        phase_cycles=dense(measured.phase_m / wavelength_m + fractions + cycles),
        doppler_hz=dense(-measured.rate_mps / wavelength_m),
        cn0_dbhz=dense(cn0_dbhz),
        lock_flags=flags,
    )
    named = tuple(zip(observations.satellites, observations.signals, strict=True))
    names = antenna_names(antennas)
    return Received(
        observations=observations,
        integers=link_integers(names, named, t_s, tracking.tracked[..., kept], cycles[..., kept]),
        satellite_cycles=sent,
    )


def _links(
    scenario: Scenario,
    orbits: BroadcastOrbits | PreciseOrbits,
    channels: Channels,
    t_s: FloatArray,
) -> Links:
    """Return the links of all channels at true times of reception, (n, a)."""
    origin = scenario.origin.frame
    lever_b_m = np.tile(np.array(scenario.antennas_b_m), (len(t_s), 1))
    p_n_m, v_n_mps, _ = scenario.motion(t_s.ravel()).at(lever_b_m)
    p_e_m = origin.to_e(p_n_m).reshape(*t_s.shape, 3)
    v_e_mps = (v_n_mps @ origin.R_ne).reshape(*t_s.shape, 3)
    return links(orbits, channels.in_view, t_s, p_e_m, v_e_mps).of(channels.at)


def _directions_b(scenario: Scenario, t_s: FloatArray, links: Links) -> FloatArray:
    """Return directions to satellites in body axes, (n, m, 3), at true times (n,)."""
    flat = np.cos(links.elevation_rad)
    e_local = np.stack(
        [
            flat * np.cos(links.azimuth_rad),
            flat * np.sin(links.azimuth_rad),
            -np.sin(links.elevation_rad),
        ],
        axis=-1,
    )
    # Angles are those at the antenna, whose horizon is not that of the origin.
    geodetic_place = geodetic(places_e_m(scenario, t_s))
    to_b = np.einsum(
        "nli,ji,njk->nlk",
        ned_axes(geodetic_place[:, 0], geodetic_place[:, 1]),
        scenario.origin.frame.R_ne,
        scenario.motion(t_s).R_nb,
    )
    return np.asarray(np.einsum("nml,nlk->nmk", e_local, to_b))


def _echoes(
    sensor: GnssTable, scenario: Scenario, channels: Channels, t_s: FloatArray, e_b: FloatArray
) -> Echoes:
    return echoes(
        sensor.reflectors,
        np.array(scenario.antennas_b_m),
        e_b,
        scenario.motion(t_s).w_nb_b_radps,
        wavelengths_m(channels.satellites, channels.signals),
    )


def _elevation_factor(sensor: GnssTable, elevation_rad: FloatArray) -> FloatArray:
    if sensor.elevation_weights == "uniform":
        return np.ones_like(elevation_rad)
    return np.asarray(1.0 / np.sin(np.maximum(elevation_rad, np.radians(1.0))))


def _cycles(
    channels: Channels, rises: BoolArray, antennas: int, *, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return phase offsets, cycles: of satellites, of receivers, and integers.

    Shapes are (m,), (a, m) and (n, a, m).

    An arbitrary integer per antenna, channel and pass; a fraction per antenna and kind of signal
    and one per satellite's signal, as hardware delays are, which double differences remove.
    """
    passes = np.cumsum(rises, axis=0)
    kinds = [name[0] + s for name, s in zip(channels.satellites, channels.signals, strict=True)]
    kind = np.unique(kinds, return_inverse=True)[1]
    of_receiver = rng.random((antennas, kind.max() + 1))[:, kind]
    of_satellite = rng.random(len(kind))
    integers = rng.integers(
        -LARGEST_INTEGER, LARGEST_INTEGER, (passes.max() + 1, antennas, len(kind))
    )
    # All channels of one pass number at once: few passes, so no array of indices (n, a, m).
    of_pass = integers.transpose(0, 2, 1)[passes, np.arange(len(kind))].swapaxes(1, 2)
    return of_satellite, of_receiver, np.asarray(of_pass)
