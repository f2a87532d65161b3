"""Model of one antenna's pseudoranges and Dopplers, given the satellites."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, NoSolutionError
from fgnav.geometry.earth import C_MPS, geodetic
from fgnav.gnss.atmosphere import klobuchar_m, saastamoinen_m
from fgnav.gnss.orbits.satellites import (
    SatelliteStates,
    accuracy_m,
    group_delay_s,
    states_at_clock,
)
from fgnav.gnss.signals import Selection, band, frequency_hz, known, select
from fgnav.types.flight import Flight
from fgnav.types.observations import Observations
from fgnav.types.orbits import BroadcastOrbits, PreciseOrbits

# Preferred first, as RTKLIB does.
_BANDS = {"G": "125", "E": "15786", "C": "216758", "J": "125", "R": "123"}
_L1_HZ = 1575.42e6
# Standard deviations of what the models leave, as RTKLIB assumes: a share of Klobuchar's delay, and
# metres at the zenith of Saastamoinen's.
_IONOSPHERE_SHARE, _TROPOSPHERE_M = 0.5, 0.3
_NO_GROUP_DELAY_M = 3.0  # what single-frequency delays amount to where no message states them
# Receivers delay each GLONASS carrier differently: means of satellites' residuals at the true place
# of both Wettzell receivers, an hour, have 1.6 and 1.9 m, other constellations' .4 to .7 m.
_BETWEEN_CARRIERS_M = 2.0
_LOWEST_RAD = 0.05  # the atmosphere's models are not asked about less


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class CodeChannels:
    """Channels of one antenna that make its position: one carrier per constellation."""

    column: IntArray  # (m,); of the observations
    satellites: tuple[str, ...]  # length m
    signals: tuple[str, ...]  # length m
    frequency_hz: FloatArray  # (m,)
    constellations: tuple[str, ...]  # length c; letters
    clock_of: FloatArray  # (m, c); 1 where a channel belongs to a constellation

    @property
    def has_carrier(self) -> BoolArray:
        """Mask of channels whose carrier is known as exactly as phase and Doppler need it, (m,)."""
        named = zip(self.satellites, self.signals, strict=True)
        return np.array([known(*channel) for channel in named], dtype=np.bool_)


def code_channels(
    observations: Observations, antenna: int, *, causal: bool = False
) -> CodeChannels:
    """Return the channels of one antenna that its position is made of.

    One carrier of each constellation: the preferred one of those it has at all; with ``causal``, of
    those it has at the first epoch at which it has any.
    """
    chosen = select(observations, causal=causal, code_alone=True)
    has = chosen.channel[antenna] >= 0
    eligible = _first_seen(observations, antenna, chosen) if causal else has
    bands = [band(*pair) for pair in zip(chosen.satellites, chosen.signals, strict=True)]
    letters = [satellite[0] for satellite in chosen.satellites]
    decided = {} if observations.earlier is None else observations.earlier.bands
    first: dict[str, str] = {}
    for letter in "GEJCR":
        if letter in decided:
            first[letter] = decided[letter]
            continue
        tracked = {b for b, c, h in zip(bands, letters, eligible, strict=True) if h and c == letter}
        if tracked:
            first[letter] = min(tracked, key=_BANDS[letter].index)
    keep = [j for j in np.nonzero(has)[0] if bands[j] == first.get(letters[j])]
    satellites = tuple(chosen.satellites[j] for j in keep)
    signals = tuple(chosen.signals[j] for j in keep)
    member = [[float(s[0] == letter) for letter in first] for s in satellites]
    return CodeChannels(
        column=chosen.channel[antenna, keep],
        satellites=satellites,
        signals=signals,
        frequency_hz=np.array([frequency_hz(*p) for p in zip(satellites, signals, strict=True)]),
        constellations=tuple(first),
        clock_of=np.array(member).reshape(len(satellites), len(first)),
    )


def _first_seen(observations: Observations, antenna: int, chosen: Selection) -> BoolArray:
    """Return the channels, (m,), there when their constellation is first seen by one antenna."""
    column = chosen.channel[antenna]
    coded = np.isfinite(observations.code_m[:, antenna][:, column.clip(0)]) & (column >= 0)
    letters = np.array([satellite[0] for satellite in chosen.satellites])
    out = np.zeros(len(column), dtype=np.bool_)
    for letter in np.unique(letters):
        members = letters == letter
        is_tracked = coded[:, members].any(axis=1)
        if is_tracked.any():
            out |= members & coded[is_tracked.argmax()]
    return out


@dataclass(frozen=True, eq=False, slots=True)
class CodeRanges:
    """Observations of n epochs with all that is the satellites' taken out."""

    gps_s: FloatArray  # (n,)
    coded: BoolArray  # (n, m) whether there is a code observation
    range_m: FloatArray  # (n, m) code, free of satellite clock and group delay
    rate_mps: FloatArray  # (n, m) Doppler as a range rate, free of the satellite's clock drift
    states: SatelliteStates
    message_variance_m2: FloatArray  # (n, m)

    def rows(self, at: BoolArray | IntArray) -> "CodeRanges":
        """Return the model of selected epochs."""
        names = ("p_e_m", "v_e_mps", "clock_s", "clock_drift_sps", "unhealthy")
        return CodeRanges(
            self.gps_s[at],
            self.coded[at],
            self.range_m[at],
            self.rate_mps[at],
            SatelliteStates(**{name: getattr(self.states, name)[at] for name in names}),
            self.message_variance_m2[at],
        )


def orbits_of(flight: Flight) -> BroadcastOrbits | PreciseOrbits:
    """Return the orbits to use: precise ones where there are both.

    Raises
    ------
    NoSolutionError
        If the flight has none.
    """
    orbits = flight.precise or flight.broadcast
    if orbits is None:
        raise NoSolutionError(f"flight {flight.name}: GNSS needs navigation or orbits files")
    return orbits


def code_ranges(
    flight: Flight,
    obs: Observations,
    channels: CodeChannels,
    antenna: int,
    epoch: IntArray,
    *,
    rates: bool = True,
) -> CodeRanges:
    """Look up the satellites of some epochs and correct their observations.

    Without ``rates`` Doppler and what moves are NaN, and it takes half the time.
    """
    orbits = orbits_of(flight)
    code_m = obs.code_m[epoch, antenna][:, channels.column]
    left_s = obs.tag_s[epoch, antenna][:, None] - code_m / C_MPS
    states = states_at_clock(orbits, channels.satellites, left_s, rates=rates)
    accuracy = accuracy_m(orbits, channels.satellites, left_s)
    delay_s = group_delay_s(
        flight.broadcast or orbits,
        channels.satellites,
        channels.signals,
        left_s,
        precise_clocks=flight.precise is not None,
    )
    doppler_mps = obs.doppler_hz[epoch, antenna][:, channels.column] * C_MPS / channels.frequency_hz
    doppler_mps = np.where(channels.has_carrier, doppler_mps, np.nan)
    return CodeRanges(
        flight.start_gps_s + obs.t_s[epoch],
        np.isfinite(code_m),
        code_m + C_MPS * (states.clock_s - delay_s),
        C_MPS * states.clock_drift_sps - doppler_mps,
        states,
        flight.gnss_noise.message_errors * accuracy**2
        + _delay_variance_m2(flight.broadcast, channels),
    )


def _delay_variance_m2(broadcast: BroadcastOrbits | None, channels: CodeChannels) -> FloatArray:
    """Return the variance of delays that no message states, m2, (m,)."""
    glonass = ~channels.has_carrier
    unstated = glonass | (broadcast is None)
    return np.asarray(unstated * _NO_GROUP_DELAY_M**2 + glonass * _BETWEEN_CARRIERS_M**2)


def atmosphere_m(
    flight: Flight,
    channels: CodeChannels,
    p_e_m: FloatArray,
    angles_rad: tuple[FloatArray, FloatArray],
    gps_s: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return delays of the code in the atmosphere, m, and the variance they leave, m2, both (n, m).

    Parameters
    ----------
    flight : Flight
        The ionosphere is that of its broadcast messages; none without.
    p_e_m : ndarray, shape (n, 3)
    angles_rad : tuple of ndarray, shape (n, m)
        Elevations and azimuths.
    gps_s : ndarray, shape (n,)
    """
    broadcast, leaves = flight.broadcast, flight.gnss_noise.message_errors
    coefficients = np.zeros(8) if broadcast is None else broadcast.klobuchar
    coordinates = geodetic(p_e_m)
    elevation = angles_rad[0].clip(_LOWEST_RAD)
    ionosphere = klobuchar_m(coefficients, coordinates, elevation, angles_rad[1], gps_s)
    ionosphere = ionosphere * (_L1_HZ / channels.frequency_hz) ** 2
    unmodelled_m = _TROPOSPHERE_M / (np.sin(elevation) + 0.1)
    variance = leaves * ((_IONOSPHERE_SHARE * ionosphere) ** 2 + unmodelled_m**2)
    return ionosphere + saastamoinen_m(coordinates, elevation), variance
