"""Signals on their way: when they left, how far and how fast the way grows, for every antenna."""

from dataclasses import dataclass, fields

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry.earth import C_MPS, EARTH_RATE_RADPS
from fgnav.gnss.orbits.satellites import angles, satellite_states
from fgnav.types.orbits import BroadcastOrbits, PreciseOrbits

_TYPICAL_S = 0.078  # 23,400 km: between the shortest and the longest way to a medium orbit


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Links:
    """Every antenna's view of every satellite at its own times of reception."""

    # range_m, range_rate_mps: (n, a, s); distance travelled, and its derivative by the time of
    # reception
    range_m: FloatArray
    range_rate_mps: FloatArray
    # clock_s, clock_drift_sps: (n, a, s); satellite clock minus GPS time when the signal left
    clock_s: FloatArray
    clock_drift_sps: FloatArray
    # elevation_rad, azimuth_rad: (n, s); as the reference antenna sees them. NaN, as all the rest,
    # where no message holds.
    elevation_rad: FloatArray
    azimuth_rad: FloatArray

    def of(self, satellites: IntArray) -> "Links":
        """Return the links of some satellites, by index; one may stand more than once."""
        return Links(**{f.name: getattr(self, f.name)[..., satellites] for f in fields(self)})


def links(
    orbits: BroadcastOrbits | PreciseOrbits,
    satellites: tuple[str, ...],
    t_s: FloatArray,
    p_e_m: FloatArray,
    v_e_mps: FloatArray,
) -> Links:
    """Solve the light-time equation exactly.

    The range is the distance between the antenna at reception and the satellite at transmission,
    both in the Earth-fixed axes of the time of reception. Orbits are evaluated for the reference
    antenna; the others' signals leave so soon before or after that the satellite's path is straight
    meanwhile: clocks 1 ms apart leave 0.3 um.

    Parameters
    ----------
    satellites : tuple of str, length s
    t_s : ndarray, shape (n, a)
        True times of reception since the flight's start.
    p_e_m, v_e_mps : ndarray, shape (n, a, 3)
        The antennas at these times.
    """
    travel_s = np.full((len(t_s), 1, len(satellites)), _TYPICAL_S)
    states = satellite_states(orbits, satellites, t_s[:, :1] - travel_s[:, 0])
    # This first way is off by at most 15 ms, in which a satellite comes 15 m closer: 5e-8 s.
    first_m, _ = _way(states.p_e_m[:, None], travel_s, p_e_m[:, :1])
    left_s = t_s[:, :1] - first_m[:, 0] / C_MPS
    states = satellite_states(orbits, satellites, left_s)
    p_s_m, v_s_mps = states.p_e_m[:, None], states.v_e_mps[:, None]

    range_m, toward = first_m, p_s_m
    shift_s = np.zeros_like(travel_s)  # against the time for which the orbit was evaluated
    for _ in range(
        2
    ):  # each shrinks the error by the satellite's speed over light's: below 1e-17 s
        travel_s = range_m / C_MPS
        shift_s = t_s[:, :, None] - travel_s - left_s[:, None]
        range_m, toward = _way(p_s_m + shift_s[..., None] * v_s_mps, travel_s, p_e_m)
    elevation_rad, azimuth_rad = angles(p_e_m[:, 0], toward[:, 0])
    return Links(
        range_m=range_m,
        range_rate_mps=_rate(toward, v_s_mps, v_e_mps, p_e_m, range_m),
        clock_s=states.clock_s[:, None] + shift_s * states.clock_drift_sps[:, None],
        clock_drift_sps=np.broadcast_to(states.clock_drift_sps[:, None], range_m.shape),
        elevation_rad=elevation_rad,
        azimuth_rad=azimuth_rad,
    )


def _rotated(v: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """Return coordinates of vectors (..., 3) in axes that turned on about z by angles (...)."""
    sine, cosine = np.sin(angle_rad), np.cos(angle_rad)
    x, y, z = np.moveaxis(v, -1, 0)
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, z + 0 * sine], axis=-1)


def _way(
    p_s_m: FloatArray, travel_s: FloatArray, p_e_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return length (n, a, s) and direction (n, a, s, 3) of the way to satellites."""
    separation_m = _rotated(p_s_m, EARTH_RATE_RADPS * travel_s) - p_e_m[:, :, None]
    length_m = np.sqrt(np.einsum("nasi,nasi->nas", separation_m, separation_m))
    return length_m, separation_m / length_m[..., None]


def _rate(
    toward: FloatArray,
    v_s_mps: FloatArray,
    v_e_mps: FloatArray,
    p_e_m: FloatArray,
    range_m: FloatArray,
) -> FloatArray:
    """Return the derivative of the range by the time of reception, (n, a, s).

    With ``q(t, travel)`` the satellite in the axes of reception, ``range = |q - p|`` and
    ``travel = range / c``: the range's rate stands on both sides, and is solved for.
    """
    v_mps = _rotated(v_s_mps, EARTH_RATE_RADPS * range_m / C_MPS)
    seen_m = toward * range_m[..., None] + p_e_m[:, :, None]
    spin_mps = EARTH_RATE_RADPS * np.stack(
        [seen_m[..., 1], -seen_m[..., 0], np.zeros_like(range_m)], axis=-1
    )
    direct = np.einsum("nasi,nasi->nas", toward, v_mps - v_e_mps[:, :, None])
    through_travel = np.einsum("nasi,nasi->nas", toward, spin_mps - v_mps)
    return np.asarray(direct / (1 - through_travel / C_MPS))
