"""The border type of the project: what was measured on a flight, before any estimator sees it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from fgnav.checks import BadInputError, FloatArray, Unused, freeze, freeze_times, positive
from fgnav.geometry.earth import Origin
from fgnav.types.instruments import (
    USUAL_IMU_NOISE,
    USUAL_POSITION_SIGMA_M,
    USUAL_VELOCITY_SIGMA_MPS,
    Antenna,
    ElevationWeights,
    GnssNoise,
    Imu,
    Photodetector,
    Samples,
)
from fgnav.types.observations import Observations
from fgnav.types.orbits import BroadcastOrbits, PreciseOrbits
from fgnav.types.receiver import Baseline, Fixes
from fgnav.types.summaries import summary, summary_html
from fgnav.types.surroundings import Barometer, Magnetometer
from fgnav.types.vehicle import FinnedVehicle, WheeledVehicle

__all__ = [
    "Antenna",
    "Base",
    "Baseline",
    "ElevationWeights",
    "Fixes",
    "Flight",
    "GnssNoise",
    "Imu",
    "InitialAttitude",
    "LinkIntegers",
    "Photodetector",
    "Truth",
]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Base:
    """A station on the ground: its ECEF position, (3,), and its observations (one antenna)."""

    position_e_m: FloatArray
    observations: Observations

    def __post_init__(self) -> None:
        """Check and freeze the position."""
        freeze("base", self, {"position_e_m": (3,)})


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialAttitude:
    """Prior of the attitude at the first epoch.

    Each angle with its standard deviation, rad, or neither.
    """

    roll_rad: float | None = None
    pitch_rad: float | None = None
    heading_rad: float | None = None
    roll_sigma_rad: float | None = None
    pitch_sigma_rad: float | None = None
    heading_sigma_rad: float | None = None

    def __post_init__(self) -> None:
        """Reject an angle without its sigma, and sigmas that are not positive."""
        for name in ("roll", "pitch", "heading"):
            angle, sigma = getattr(self, f"{name}_rad"), getattr(self, f"{name}_sigma_rad")
            if (angle is None) != (sigma is None):
                lacking = f"{name}_deg" if angle is None else f"{name}_sigma_deg"
                raise BadInputError(f"initial {lacking}: angle and sigma go together; add it")
            if sigma is not None:
                positive(f"initial {name}_sigma_deg", np.degrees(sigma))

    @property
    def angles_rad(self) -> tuple[float | None, float | None, float | None]:
        """Roll, pitch, heading."""
        return self.roll_rad, self.pitch_rad, self.heading_rad

    @property
    def sigmas_rad(self) -> tuple[float | None, float | None, float | None]:
        """Of roll, pitch, heading."""
        return self.roll_sigma_rad, self.pitch_sigma_rad, self.heading_sigma_rad


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class LinkIntegers:
    """True integers of the carrier phase: one row per arc of a link, antenna and channel.

    Phase is way over wavelength plus the integer plus what double differences remove.

    Attributes
    ----------
    antennas, satellites, signals : tuple of str, length k
        Antenna by name, channel as in ``Observations``.
    from_s : ndarray, shape (k,)
        First epoch of the arc, which lasts until the link's next row; it increases within a link.
    cycles : ndarray, shape (k,)
        Whole; after a slip of half a cycle, halves.
    """

    antennas: tuple[str, ...]
    satellites: tuple[str, ...]
    signals: tuple[str, ...]
    from_s: FloatArray
    cycles: FloatArray

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        k = len(self.antennas)
        if not len(self.satellites) == len(self.signals) == k:
            raise BadInputError(
                f"true integers: {k} antennas, {len(self.satellites)} satellites and "
                f"{len(self.signals)} signals must be equally many"
            )
        freeze("true integers", self, {"from_s": (k,), "cycles": (k,)})
        broken = 2 * self.cycles % 1 != 0
        if broken.any():
            row = int(np.argmax(broken))
            raise BadInputError(
                "true integers cycles: must be whole or halves, "
                f"got {self.cycles[row]} at row {row}"
            )
        last: dict[tuple[str, str, str], float] = {}
        for link, start_s in zip(self.links, self.from_s.tolist(), strict=True):
            if start_s <= last.get(link, -np.inf):
                raise BadInputError(
                    f"true integers from_s: of {' '.join(link)} must increase, "
                    f"got {start_s:.9g} after {last[link]:.9g}"
                )
            last[link] = start_s

    @property
    def links(self) -> tuple[tuple[str, str, str], ...]:
        """Antenna, satellite and signal of each row."""
        return tuple(zip(self.antennas, self.satellites, self.signals, strict=True))


TruthSource: TypeAlias = Literal["simulated", "survey", "filter"]
_SINGLE = (
    "imu",
    "photodetector",
    "barometer",
    "magnetometer",
    "truth",
)  # of one instrument
TRUTH_SIGMAS = ("position_sigma_m", "velocity_sigma_mps", "euler_sigma_rad")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True, repr=False)
class Truth(Samples):
    """True states of a simulated flight; or a reference taken as such.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
    p_n_m, v_n_mps : ndarray, shape (k, 3)
        Of the body's origin.
    R_nb : ndarray, shape (k, 3, 3)
    integers : LinkIntegers or None
        Of the phase, where they are known.
    source : {"simulated", "survey", "filter"} or None
        What made it, where that is known; what a filter made is an estimate itself.
    position_sigma_m, velocity_sigma_mps, euler_sigma_rad : ndarray, shape (k, 3), or None
        1-sigma of its own errors where it states them: north, east, down; roll, pitch, yaw.
    """

    columns: ClassVar = ("t_s", "p_n_m", "v_n_mps", "R_nb", *TRUTH_SIGMAS)
    t_s: FloatArray
    p_n_m: FloatArray
    v_n_mps: FloatArray
    R_nb: FloatArray
    integers: LinkIntegers | None = None
    source: TruthSource | None = None
    position_sigma_m: FloatArray | None = None
    velocity_sigma_mps: FloatArray | None = None
    euler_sigma_rad: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        k = freeze_times("truth", self)
        freeze("truth", self, {"p_n_m": (k, 3), "v_n_mps": (k, 3), "R_nb": (k, 3, 3)})
        stated = [name for name in TRUTH_SIGMAS if getattr(self, name) is not None]
        freeze("truth", self, dict.fromkeys(stated, (k, 3)))

    @property
    def is_reference(self) -> bool:
        """True if it is an estimate itself, so that errors against it are not all the judged's."""
        return self.source == "filter"


@dataclass(frozen=True, eq=False, slots=True, kw_only=True, weakref_slot=True)
class Flight:
    """A recorded flight, real or simulated.

    Attributes
    ----------
    name : str
    start_gps_s : float
        GPS time of ``t_s = 0``: seconds since 1980-01-06, leap seconds not counted.
    origin : Origin
        Where the frame ``n`` is fixed.
    antennas : tuple of Antenna
        The first is the reference of all baselines.
    observations : Observations or None
        Raw GNSS data; its antenna axis follows ``antennas``.
    broadcast, precise : BroadcastOrbits, PreciseOrbits or None
        Where the satellites are; precise orbits are preferred where both are present.
    elevation_mask_rad : float
        Satellites below are not used.
    gnss_noise : GnssNoise
    base : Base or None
    fixes : tuple of Fixes
        Of receivers, each of another antenna; the first one's track starts an estimate.
    baselines : tuple of Baseline
        From antenna to antenna, by receivers.
    imu, photodetector, barometer, magnetometer, truth : their types, or None
    vehicle : WheeledVehicle, FinnedVehicle or None
        What it may be taken to do.
    standstill : bool
        Whether it may be taken to stand still where samples and GNSS say so.
    initial : InitialAttitude or None
        Of the first epoch that is estimated.
    networks : tuple of Path
        Manifests of the networks whose factors it brings (``fgnav.neural``).
    unused : tuple of Unused
        What was in the files and is not here.

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> flight.name, flight.imu.f_b_mps2.shape[1], len(flight.fixes)
    ('demo', 3, 0)
    """

    name: str
    start_gps_s: float
    origin: Origin
    antennas: tuple[Antenna, ...] = ()
    observations: Observations | None = None
    broadcast: BroadcastOrbits | None = None
    precise: PreciseOrbits | None = None
    elevation_mask_rad: float = np.radians(10.0)
    gnss_noise: GnssNoise = field(default_factory=GnssNoise)
    base: Base | None = None
    imu: Imu | None = None
    fixes: tuple[Fixes, ...] = ()
    baselines: tuple[Baseline, ...] = ()
    photodetector: Photodetector | None = None
    barometer: Barometer | None = None
    magnetometer: Magnetometer | None = None
    vehicle: WheeledVehicle | FinnedVehicle | None = None
    standstill: bool = False
    initial: InitialAttitude | None = None
    truth: Truth | None = None
    networks: tuple[Path, ...] = ()
    unused: tuple[Unused, ...] = ()

    def __post_init__(self) -> None:
        """Check what the parts owe each other."""
        names = [antenna.name for antenna in self.antennas]
        for name in names:
            if names.count(name) > 1:
                raise BadInputError(f"antenna {name}: two antennas have this name")
        if self.observations is not None:
            if self.observations.tag_s.shape[1] != len(self.antennas):
                raise BadInputError(
                    f"observations: of {self.observations.tag_s.shape[1]} antennas, "
                    f"but the flight has {len(self.antennas)}"
                )
            if self.broadcast is None and self.precise is None:
                raise BadInputError("gnss: observations need navigation or orbits files")
        self._check_receivers(names)
        if not 0 <= self.elevation_mask_rad < np.pi / 2:
            raise BadInputError(
                "elevation_mask_deg: must be within 0 and 90, "
                f"got {np.degrees(self.elevation_mask_rad):g}"
            )

    def _check_receivers(self, names: list[str]) -> None:
        """Raise unless receivers speak of antennas that the flight has, each of its own."""
        used = [("fixes antenna", fix.antenna) for fix in self.fixes]
        used += [
            ("baseline antennas", name) for baseline in self.baselines for name in baseline.antennas
        ]
        for key, name in used:
            if name not in names:
                raise BadInputError(f"{key}: {name!r} is not one of {names}")
        records = [f"fixes of antenna {fix.antenna}" for fix in self.fixes]
        records += [f"baseline {' to '.join(baseline.antennas)}" for baseline in self.baselines]
        for record in records:
            if records.count(record) > 1:
                raise BadInputError(
                    f"{record}: given twice; name another antenna at the same place"
                )

    def __repr__(self) -> str:
        """Return five lines: where it is, what was measured, what is lost."""
        return summary(self)

    def _repr_html_(self) -> str:
        """Return the summary as HTML, for a notebook."""
        return summary_html(self)

    @classmethod
    def from_arrays(  # noqa: PLR0913  # an array of each quantity
        cls,
        t_s: FloatArray,
        f_b_mps2: FloatArray,
        w_b_radps: FloatArray | None = None,
        *,
        origin: Origin,
        fixes_t_s: FloatArray | None = None,
        p_n_m: FloatArray | None = None,
        v_n_mps: FloatArray | None = None,
        position_sigma_m: ArrayLike | None = None,
        velocity_sigma_mps: ArrayLike | None = None,
        antenna_b_m: ArrayLike = (0.0, 0.0, 0.0),
        name: str = "flight",
        start_gps_s: float = 0.0,
        **noise: float,
    ) -> "Flight":
        """Return the flight of an inertial unit and, beside it, of a receiver's solution.

        Other sensors are added by ``dataclasses.replace(flight, barometer=...)``.

        Parameters
        ----------
        t_s : ndarray, shape (k,)
        f_b_mps2, w_b_radps : ndarray, shape (k, 3)
            Of accelerometer and gyroscope.
        origin : Origin
        fixes_t_s : ndarray, shape (m,)
        p_n_m, v_n_mps : ndarray, shape (m, 3)
            Of the antenna.
        position_sigma_m, velocity_sigma_mps : float or ndarray, shape (3,) or (m, 3)
            Usual figures where they are not given, as of the noise.
        antenna_b_m : array, shape (3,)
        name : str
        start_gps_s : float
        **noise : float
            Of the unit, as fields of ``Imu``: ``accelerometer_noise_mps2_per_sqrt_hz``.

        Examples
        --------
        >>> import fgnav, numpy as np
        >>> t_s, f_b_mps2 = np.arange(100) / 100, np.tile([0.0, 0.0, -9.81], (100, 1))
        >>> munich = fgnav.Origin.from_degrees(48.14, 11.58, 520.0)
        >>> fgnav.Flight.from_arrays(t_s, f_b_mps2, origin=munich).records
        {'imu': <Imu: 100 samples, 0.000 to 0.990 s>}
        """
        usual = {
            n: x for n, x in USUAL_IMU_NOISE.items() if w_b_radps is not None or n.startswith("acc")
        }
        unstated = tuple(n for n in usual if n not in noise)
        values: dict[str, Any] = usual | noise
        imu = Imu(t_s=t_s, f_b_mps2=f_b_mps2, w_b_radps=w_b_radps, unstated=unstated, **values)
        if fixes_t_s is None or p_n_m is None:
            return cls(name=name, start_gps_s=start_gps_s, origin=origin, imu=imu)
        given = {"position": position_sigma_m, "velocity": velocity_sigma_mps}
        usual_sigma = {"position": USUAL_POSITION_SIGMA_M, "velocity": USUAL_VELOCITY_SIGMA_MPS}
        sigma = {
            name: np.broadcast_to(usual_sigma[name] if x is None else x, np.shape(p_n_m)).copy()
            for name, x in given.items()
            if name == "position" or v_n_mps is not None
        }
        fixes = Fixes(
            t_s=fixes_t_s,
            antenna="antenna",
            p_n_m=p_n_m,
            v_n_mps=v_n_mps,
            position_sigma_m=sigma["position"],
            velocity_sigma_mps=sigma.get("velocity"),
            unstated=tuple(name for name in sigma if given[name] is None),
        )
        return cls(
            name=name,
            start_gps_s=start_gps_s,
            origin=origin,
            antennas=(Antenna(name="antenna", position_b_m=np.asarray(antenna_b_m, dtype=float)),),
            imu=imu,
            fixes=(fixes,),
        )

    def antenna(self, name: str) -> Antenna:
        """Return the antenna of that name.

        Raises
        ------
        BadInputError
            If there is none.
        """
        for antenna in self.antennas:
            if antenna.name == name:
                return antenna
        raise BadInputError(f"antenna {name!r}: not one of {[a.name for a in self.antennas]}")

    @property
    def first_fixes(self) -> Fixes | None:
        """Those whose track an estimate starts with; None without any."""
        return self.fixes[0] if self.fixes else None

    @property
    def records(self) -> dict[str, Samples]:
        """Sampled records by name: ``"imu"``, ``"fixes a1"``, ``"baseline a1 a2"``."""
        records: dict[str, Samples | None] = {"imu": self.imu}
        records |= {f"fixes {fix.antenna}": fix for fix in self.fixes}
        records |= {
            f"baseline {' '.join(baseline.antennas)}": baseline for baseline in self.baselines
        }
        records |= {name: getattr(self, name) for name in _SINGLE[1:]}
        return {name: record for name, record in records.items() if record is not None}

    def with_records(self, records: Mapping[str, Samples]) -> "Flight":
        """Return a copy with records of these names, and no others."""
        single = {name: records.get(name) for name in _SINGLE}
        fixes = tuple(record for record in records.values() if isinstance(record, Fixes))
        baselines = tuple(record for record in records.values() if isinstance(record, Baseline))
        return replace(self, fixes=fixes, baselines=baselines, **single)  # type: ignore[arg-type]
