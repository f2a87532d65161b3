"""Positions, clocks and directions of the satellites."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.geometry.earth import C_MPS, EARTH_RATE_RADPS, geodetic, ned_axes
from fgnav.gnss.orbits.broadcast import choose, signal_delay_s
from fgnav.gnss.orbits.orbit_pieces import orbit_at
from fgnav.gnss.orbits.precise import InertialTable
from fgnav.gnss.orbits.turning import turned
from fgnav.gnss.signals import frequency_hz, known
from fgnav.types.orbits import BroadcastOrbits, PreciseOrbits

_TABLE_ACCURACY_M = 0.05
_STEP_S = 0.05  # half step of central differences: errors below 1e-6 m/s


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class SatelliteStates:
    """Satellites at times of transmission; NaN where no usable ephemeris says so."""

    # In the Earth-fixed frame of the time of transmission. Broadcast: antenna phase centre;
    # precise: what the table speaks of, the centre of mass.
    p_e_m: FloatArray  # (n, m, 3)
    v_e_mps: FloatArray  # (n, m, 3)
    # Satellite clock minus GPS time, periodic relativistic part included, group delays not.
    clock_s: FloatArray  # (n, m)
    clock_drift_sps: FloatArray  # (n, m)
    unhealthy: BoolArray  # (n, m): NaN because the message says the satellite is not healthy


def satellite_states(
    orbits: BroadcastOrbits | PreciseOrbits,
    satellites: tuple[str, ...],
    t_s: FloatArray,
    *,
    rates: bool = True,
    by_clock: bool = False,
) -> SatelliteStates:
    """Return the states of satellites at their times of transmission.

    Parameters
    ----------
    orbits : BroadcastOrbits or PreciseOrbits
        Messages: the nearest time of ephemeris within 2 h (GPS, QZSS), 4 h (Galileo), 6 h (BeiDou),
        I/NAV before F/NAV, as the interface documents evaluate it [1]_ [2]_ [3]_. Tables: a
        polynomial of order 10 through positions turned into an inertial frame, a linear clock.
    satellites : tuple of str, length m
        One may stand more than once.
    t_s : ndarray, shape (n, m)
        GPS time since the flight's start at which the signal truly left; NaN gives NaN.
    rates : bool
        Velocities and clock drifts are wanted; else those of messages are NaN. Clocks of tables
        lack what velocities tell.
    by_clock : bool
        Times are those that the satellites' own clocks show; of messages only.

    References
    ----------
    .. [1] IS-GPS-200N, 20.3.3.3.3 (clock) and table 20-IV (orbit).
    .. [2] Galileo OS SIS ICD 2.1, 5.1.1, 5.1.4.
    .. [3] BDS-SIS-ICD-B1I-3.0, 5.2.4.10, 5.2.4.12.
    """
    shape = t_s.shape
    p, v = np.full((*shape, 3), np.nan), np.full((*shape, 3), np.nan)
    clock, drift = np.full(shape, np.nan), np.full(shape, np.nan)
    unhealthy = np.zeros(shape, dtype=bool)
    table = InertialTable.of(orbits) if isinstance(orbits, PreciseOrbits) else None
    for column, satellite in enumerate(satellites):
        t = t_s[:, column]
        if isinstance(orbits, BroadcastOrbits):
            chosen = choose(orbits, satellite, t)
            unhealthy[:, column] = chosen.unhealthy
            state, rate = orbit_at(chosen, t, rates=rates, by_clock=by_clock)
            p[:, column], clock[:, column] = state[:, :3], state[:, 3]
            v[:, column], drift[:, column] = rate[:, :3], rate[:, 3]
        elif table is not None and satellite in table.satellites:
            usable = table.covers(t)
            at = (table.at(satellite, t[usable] + h) for h in (0.0, -_STEP_S, _STEP_S))
            (p[usable, column], clock[usable, column]), *around = at
            (p_before, c_before), (p_after, c_after) = around
            v[usable, column] = (p_after - p_before) / (2 * _STEP_S)
            drift[usable, column] = (c_after - c_before) / (2 * _STEP_S)
    if table is not None:  # broadcast clocks have it already, from the eccentric anomaly
        clock -= 2 * np.einsum("nmi,nmi->nm", p, v) / C_MPS**2
    return SatelliteStates(
        p_e_m=p, v_e_mps=v, clock_s=clock, clock_drift_sps=drift, unhealthy=unhealthy
    )


def group_delay_s(
    orbits: BroadcastOrbits | PreciseOrbits,
    satellites: tuple[str, ...],
    signals: tuple[str, ...],
    t_s: FloatArray,
    *,
    precise_clocks: bool = False,
) -> FloatArray:
    """Return by how much each signal leaves later than the satellite's clock says, (n, m).

    The signal's own clock is ``clock_s - group_delay_s``. Messages state nothing for B1C, B2a, E6:
    they are taken to leave with B3I and E1. Tables state no delays at all: 0.

    Parameters
    ----------
    t_s : ndarray, shape (n, m)
        Times of transmission.
    precise_clocks : bool
        The delays are wanted for clocks of tables instead of those of the messages: tables refer to
        the ionosphere-free pairs L1/L2, E1/E5a and B1I/B3I.
    """
    delay_s = np.zeros(t_s.shape)
    if isinstance(orbits, PreciseOrbits):
        return delay_s
    for column, (satellite, signal) in enumerate(zip(satellites, signals, strict=True)):
        if known(satellite, signal):
            records, k, usable, _ = choose(orbits, satellite, t_s[:, column])
            if usable.any():
                carrier_hz = frequency_hz(satellite, signal)
                by_message = signal_delay_s(satellite, carrier_hz, records, precise_clocks)
                delay_s[usable, column] = by_message[k[usable]]
    return delay_s


def accuracy_m(
    orbits: BroadcastOrbits | PreciseOrbits, satellites: tuple[str, ...], t_s: FloatArray
) -> FloatArray:
    """Return the standard deviation of ranges that the messages state, (n, m); 0 where they do not.

    Tables state none here: 0.05 m stands for their orbits and clocks.
    """
    if isinstance(orbits, PreciseOrbits):
        return np.full(t_s.shape, _TABLE_ACCURACY_M)
    out = np.zeros(t_s.shape)
    for column, satellite in enumerate(satellites):
        records, k, usable, _ = choose(orbits, satellite, t_s[:, column])
        out[usable, column] = records["accuracy_m"][k[usable]].clip(0.0)
    return out


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class SignalPaths:
    """Straight ways from satellites to a receiver."""

    range_m: FloatArray  # (n, m): distance travelled, with the Earth's turn meanwhile (Sagnac)
    range_rate_mps: FloatArray  # (n, m): its rate of change with the time of reception
    # Unit vectors from the receiver to the satellites, in the axes of the time of reception.
    e_e: FloatArray  # (n, m, 3)


def signal_paths(
    states: SatelliteStates, p_receiver_e_m: FloatArray, v_receiver_e_mps: FloatArray
) -> SignalPaths:
    """Return ranges, range rates and directions of signals at receivers (n, 3) moving at (n, 3)."""
    separation = states.p_e_m - p_receiver_e_m[:, None]
    distance = np.linalg.norm(separation, axis=2)
    turn = EARTH_RATE_RADPS / C_MPS
    # Axes at reception have turned on with the Earth since transmission.
    line_of_sight_e_m = turned(states.p_e_m, -turn * distance) - p_receiver_e_m[:, None]
    range_m = np.linalg.norm(line_of_sight_e_m, axis=2)
    x, y = np.moveaxis(states.p_e_m[:, :, :2], 2, 0)
    xr, yr = p_receiver_e_m.T[:2, :, None]
    vx, vy = np.moveaxis(states.v_e_mps[:, :, :2], 2, 0)
    vxr, vyr = v_receiver_e_mps.T[:2, :, None]
    along = separation / distance[:, :, None]
    satellite_mps = np.einsum("nmi,nmi->nm", along, states.v_e_mps) + turn * (vx * yr - vy * xr)
    receiver_mps = np.einsum("nmi,ni->nm", along, v_receiver_e_mps) - turn * (x * vyr - y * vxr)
    # Transmission lags more and more behind while the range grows: 2 mm/s at 800 m/s.
    rate_mps = (satellite_mps - receiver_mps) / (1 + satellite_mps / C_MPS)
    return SignalPaths(
        range_m=range_m,
        range_rate_mps=rate_mps,
        e_e=np.asarray(line_of_sight_e_m / range_m[:, :, None]),
    )


def look_angles(
    p_receiver_e_m: FloatArray, p_satellite_e_m: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return directions, elevations and azimuths from receivers (n, 3) to satellites (n, m, 3).

    Returns
    -------
    e_e : ndarray, shape (n, m, 3)
        Unit vectors.
    elevation_rad, azimuth_rad : ndarray, shape (n, m)
        Above the ellipsoid's tangent plane; clockwise from north, in (-pi, pi].
    """
    separation = p_satellite_e_m - p_receiver_e_m[:, None]
    e_e = separation / np.linalg.norm(separation, axis=2, keepdims=True)
    return (e_e, *angles(p_receiver_e_m, e_e))


def angles(p_receiver_e_m: FloatArray, e_e: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return elevations and azimuths, (n, m), of directions (n, m, 3) seen at receivers (n, 3)."""
    coordinates = geodetic(p_receiver_e_m)
    e_ned = e_e @ ned_axes(coordinates[:, 0], coordinates[:, 1]).swapaxes(1, 2)
    north, east, down = np.moveaxis(e_ned, 2, 0)
    return np.arcsin(np.clip(-down, -1.0, 1.0)), np.arctan2(east, north)


def states_at_clock(
    orbits: BroadcastOrbits | PreciseOrbits,
    satellites: tuple[str, ...],
    clock_t_s: FloatArray,
    *,
    rates: bool = True,
) -> SatelliteStates:
    """Return states when the satellites' own clocks show ``clock_t_s``, (n, m)."""
    if isinstance(orbits, BroadcastOrbits):
        return satellite_states(orbits, satellites, clock_t_s, rates=rates, by_clock=True)
    offset_s = satellite_states(orbits, satellites, clock_t_s, rates=False).clock_s
    left_s = clock_t_s - np.nan_to_num(offset_s)
    return satellite_states(orbits, satellites, left_s, rates=rates)
