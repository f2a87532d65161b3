"""Flights whose observations follow from geometry alone, by light-time iteration."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.earth import C_MPS, EARTH_RATE_RADPS, Origin
from fgnav.geometry.rotations import from_euler
from fgnav.gnss.orbits.satellites import look_angles, satellite_states
from fgnav.gnss.signals import wavelengths_m
from fgnav.types.flight import Antenna, Flight, GnssNoise
from fgnav.types.observations import Observations
from fgnav.types.orbits import EPHEMERIS_DTYPE, BroadcastOrbits

ORIGIN = Origin(latitude_rad=np.radians(40.33), longitude_rad=np.radians(-3.88), height_m=700.0)
# Satellites, planes, semi-major axis, inclination.
_WALKER = {"G": (30, 6, 26_560e3, 55.0), "E": (24, 3, 29_600e3, 56.0), "C": (24, 3, 27_906e3, 55.0)}
_CARRIER = {"G": "1C", "E": "1C", "C": "2I"}


def walker_orbits(letters: str = "GEC", klobuchar: FloatArray | None = None) -> BroadcastOrbits:
    """Return one message per satellite of constellations laid out evenly, valid around t = 0."""
    rows = []
    for letter in letters:
        count, planes, axis_m, inclination_deg = _WALKER[letter]
        for k in range(count):
            row = np.zeros((), EPHEMERIS_DTYPE)
            row["satellite"] = f"{letter}{k + 6:02d}"
            row["semi_major_axis_m"] = axis_m
            row["eccentricity"] = 0.002 + 0.0005 * k
            row["inclination_rad"] = np.radians(inclination_deg)
            row["node_rad"] = 2 * np.pi * (k % planes) / planes + 0.3 * "GEC".index(letter)
            row["mean_anomaly_rad"] = 2 * np.pi * (k / count + 0.11 * (k % planes))
            row["perigee_rad"] = 0.3 * k
            row["node_rate_radps"] = -8e-9
            row["crs_m"], row["cuc_rad"], row["cic_rad"] = 40.0 - k, 1e-6, 1e-7
            row["af0_s"], row["af1_sps"] = (-1) ** k * 3e-5 * k, 1e-11
            row["data_source"] = 517 if letter == "E" else 0
            rows.append(row)
    return BroadcastOrbits(
        records=np.array(rows), klobuchar=np.zeros(8) if klobuchar is None else klobuchar
    )


@dataclass(frozen=True, kw_only=True)
class Made:
    """A vehicle that flies straight and turns steadily, and how its receivers err.

    Clocks are ahead by ``clock_s`` (per antenna; functions of time are allowed): a tag says that
    much more than GPS time.
    """

    t_s: FloatArray
    arms_b_m: FloatArray
    letters: str = "G"
    v_n_mps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_rate_radps: float = 0.0
    clock_s: tuple[float | Callable[[FloatArray], FloatArray], ...] = ()
    code_sigma_m: float = 0.0
    phase_sigma_m: float = 0.0
    doppler: bool = True
    delay_m: Callable[[FloatArray, FloatArray], FloatArray] | None = None  # of place, elevation
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    signals: dict[str, str] = field(default_factory=lambda: dict(_CARRIER))

    def attitude(self, t_s: FloatArray) -> FloatArray:
        still = np.zeros_like(t_s)
        return from_euler(still + 0.1, still - 0.2, 0.7 + self.yaw_rate_radps * t_s)

    def position_n_m(self, t_s: FloatArray, arm_b_m: FloatArray) -> FloatArray:
        return t_s[:, None] * np.array(self.v_n_mps) + self.attitude(t_s) @ arm_b_m

    def late_s(self, antenna: int, t_s: FloatArray) -> FloatArray:
        clock = self.clock_s[antenna] if self.clock_s else 0.0
        return clock(t_s) if callable(clock) else np.full_like(t_s, clock)

    def flight(self, orbits: BroadcastOrbits | None = None) -> Flight:
        """Return the flight, with integers of up to a million cycles in its phases."""
        orbits = orbits or walker_orbits(self.letters)
        wanted = sorted({str(s) for s in orbits.records["satellite"] if s[0] in self.letters})
        first = self._ranges(orbits, tuple(wanted), self.t_s[[0, -1]], 0)[1]
        seen = tuple(s for s, up in zip(wanted, first.max(axis=0) > 0.15, strict=True) if up)
        signals = tuple(self.signals[s[0]] for s in seen)
        wavelength = wavelengths_m(seen, signals)
        code, phase, doppler = [], [], []
        for antenna in range(len(self.arms_b_m)):
            range_m, elevation = self._ranges(orbits, seen, self.t_s, antenna)
            up = np.where(elevation > 0.09, 1.0, np.nan)
            noise = self.rng.standard_normal((2, *range_m.shape))
            delay = 0.0 if self.delay_m is None else self.delay_m(self.t_s, elevation)
            code.append(up * (range_m + delay + self.code_sigma_m * noise[0]))
            integers = self.rng.integers(-1_000_000, 1_000_000, len(seen))
            cycles = (range_m + delay + self.phase_sigma_m * noise[1]) / wavelength
            phase.append(up * (cycles + integers))
            later, earlier = (
                self._ranges(orbits, seen, self.t_s + h, antenna)[0] for h in (5e-3, -5e-3)
            )
            rate = (later - earlier) / 1e-2
            doppler.append(-up * rate / wavelength if self.doppler else up * np.nan)
        shape = np.stack(code, axis=1).shape
        return Flight(
            name="made",
            start_gps_s=1_277_078_400.0,
            origin=ORIGIN,
            antennas=tuple(
                Antenna(name=f"a{i + 1}", position_b_m=arm) for i, arm in enumerate(self.arms_b_m)
            ),
            observations=Observations(
                t_s=self.t_s,
                tag_s=np.repeat(self.t_s[:, None], shape[1], axis=1),
                satellites=seen,
                signals=signals,
                code_m=np.stack(code, axis=1),
                phase_cycles=np.stack(phase, axis=1),
                doppler_hz=np.stack(doppler, axis=1),
                cn0_dbhz=np.full(shape, 45.0),
                lock_flags=np.zeros(shape),
            ),
            broadcast=orbits,
            gnss_noise=GnssNoise(
                code_m=max(self.code_sigma_m, 0.01),
                elevation_weights="uniform",
                atmosphere=self.delay_m is not None,
            ),
        )

    def _ranges(
        self, orbits: BroadcastOrbits, satellites: tuple[str, ...], tag_s: FloatArray, antenna: int
    ) -> tuple[FloatArray, FloatArray]:
        """Return pseudoranges by receiver tags, and elevations."""
        true_s = tag_s - self.late_s(antenna, tag_s)
        p_e_m = ORIGIN.to_e(self.position_n_m(true_s, self.arms_b_m[antenna]))
        travel_s = np.full((len(tag_s), len(satellites)), 0.07)
        for _ in range(3):  # each step shrinks the error by 1e5
            states = satellite_states(orbits, satellites, true_s[:, None] - travel_s)
            s, c = np.sin(EARTH_RATE_RADPS * travel_s), np.cos(EARTH_RATE_RADPS * travel_s)
            x, y, z = np.moveaxis(states.p_e_m, 2, 0)
            seen = np.stack([c * x + s * y, c * y - s * x, z], axis=2)
            travel_s = np.linalg.norm(seen - p_e_m[:, None], axis=2) / C_MPS
        clock_m = C_MPS * (self.late_s(antenna, tag_s)[:, None] - states.clock_s)
        return travel_s * C_MPS + clock_m, look_angles(p_e_m, seen)[1]
