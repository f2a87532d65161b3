"""A car that drives and stops: level, northwards, its engine shaking it at rest, the road more."""

import numpy as np

from fgnav.assembly.position.antenna_motion import AntennaMotion
from fgnav.assembly.position.series import VectorSeries
from fgnav.geometry.earth import Origin
from fgnav.types.flight import Antenna, Fixes, Flight, InitialAttitude, Truth
from tests.imu import imu_of

STEP_S = 0.02
SIGMA_MPS = 0.05
STOPS_S = ((0.0, 10.0), (30.0, 42.0), (58.0, 70.0))
SPEED_MPS = 8.0
AT_REST, ON_ROAD = np.repeat([0.05, 5e-3], 3), np.repeat([0.4, 3e-2], 3)  # of a sample


def stops(
    seed: int, *, on_road: np.ndarray = ON_ROAD, lost_s: tuple[float, float] = (np.inf, np.inf)
) -> Flight:
    """Return its flight; ``on_road`` shakes its samples as it moves, m/s2 and rad/s."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, 80.0, STEP_S)
    moves = np.ones(len(t_s))
    for first, last in STOPS_S:
        moves *= np.clip(np.maximum(first - t_s, t_s - last) / 4.0, 0.0, 1.0)
    v = np.outer(SPEED_MPS * (3 - 2 * moves) * moves**2, [1.0, 0.0, 0.0])
    p = np.vstack([np.zeros(3), np.cumsum((v[1:] + v[:-1]) / 2 * STEP_S, axis=0)])
    origin = Origin(latitude_rad=0.7, longitude_rad=0.3, height_m=100.0)
    earth = origin.earth_rate_n_radps
    force = np.gradient(v, STEP_S, axis=0) - origin.gravity_n_mps2(p) + 2 * np.cross(earth, v)
    shakes = np.where(moves[:, None] > 0, on_road, AT_REST) * rng.normal(size=(len(t_s), 6))
    loud = on_road * np.sqrt(STEP_S)
    fix = np.flatnonzero((t_s[::25] < lost_s[0]) | (t_s[::25] > lost_s[1])) * 25
    ones = np.ones((len(fix), 3))
    return Flight(
        name="stops",
        start_gps_s=1.3e9,
        origin=origin,
        antennas=(Antenna(name="a1", position_b_m=np.zeros(3)),),
        imu=imu_of(
            t_s,
            force + shakes[:, :3],
            earth + shakes[:, 3:],
            accelerometer=(float(loud[0]), 0.1, 1e-4),
            gyroscope=(float(loud[3]), 1e-3, 1e-6),
            clock_offset_sigma_s=0.0,
        ),
        fixes=(
            Fixes(
                t_s=t_s[fix],
                antenna="a1",
                p_n_m=p[fix] + rng.normal(0, 0.05, (len(fix), 3)),
                v_n_mps=v[fix] + rng.normal(0, SIGMA_MPS, (len(fix), 3)),
                position_sigma_m=0.05 * ones,
                velocity_sigma_mps=SIGMA_MPS * ones,
            ),
        ),
        initial=InitialAttitude(heading_rad=0.0, heading_sigma_rad=0.02),
        truth=Truth(t_s=t_s, p_n_m=p, v_n_mps=v, R_nb=np.tile(np.eye(3), (len(t_s), 1, 1))),
        standstill=True,
    )


def measured(flight: Flight, t_s: np.ndarray, *, velocities: bool = True) -> AntennaMotion:
    """Return what fixes say at keyframes, (n,): velocities beside positions, or positions alone."""
    fixes = flight.fixes[0]
    row = np.searchsorted(t_s, fixes.t_s)

    def series(value, sigma):
        at, P = np.full((len(t_s), 3), np.nan), np.zeros((len(t_s), 3, 3))
        at[row], P[row] = value, np.einsum("ki,ij->kij", sigma**2, np.eye(3))
        return VectorSeries(value=at, covariance=P, arm_b_m=np.zeros(3))

    speed = series(fixes.v_n_mps, fixes.velocity_sigma_mps)
    return AntennaMotion(
        positions=(series(fixes.p_n_m, fixes.position_sigma_m),),
        velocities=(speed,) if velocities else (),
    )
