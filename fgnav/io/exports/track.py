"""What exporters of trajectories write: the epochs of an estimate that have a position."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.io.exports.recorded import RecordedEstimate
from fgnav.io.flight.local_frame import place_of_n
from fgnav.io.gps_time import GPS_EPOCH, utc_of_gps


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Track:
    """Epochs with a position, (n,), and covariances in ``n``, of attitudes in body axes.

    What the method does not estimate is NaN.
    """

    title: str  # flight and method
    gps: np.ndarray  # datetime64[us]
    utc: np.ndarray
    p_n_m: FloatArray
    v_n_mps: FloatArray
    rate_b_radps: FloatArray
    place: FloatArray  # latitude, longitude, deg; height above the ellipsoid, m
    R_nb: FloatArray
    R_ln: FloatArray  # into the axes north, east, down at the vehicle
    P_position: FloatArray
    P_velocity: FloatArray
    P_attitude: FloatArray


def track_of(recorded: RecordedEstimate) -> Track:
    """Return the track of an estimate."""
    estimate, origin = recorded.estimate, recorded.origin
    n = len(estimate.t_s)
    p_n_m = np.full((n, 3), np.nan) if estimate.p_n_m is None else estimate.p_n_m
    rows = np.isfinite(p_n_m).all(axis=1)
    if not rows.any():
        raise BadInputError(
            f"{estimate.method}: has no positions, which this format needs; "
            "csv and parquet do without"
        )

    def of_rows(values: FloatArray | None, *shape: int) -> FloatArray:
        return (np.full((n, *shape), np.nan) if values is None else values)[rows]

    microseconds = np.rint((recorded.start_gps_s + estimate.t_s[rows]) * 1e6)
    gps = GPS_EPOCH + microseconds.astype("timedelta64[us]")
    return Track(
        title=f"{recorded.flight}, {estimate.method}",
        gps=gps,
        utc=utc_of_gps(gps),
        p_n_m=p_n_m[rows],
        v_n_mps=of_rows(estimate.v_n_mps, 3),
        rate_b_radps=of_rows(estimate.angular_rate_b_radps, 3),
        place=place_of_n(origin, p_n_m[rows]),
        R_nb=estimate.R_nb[rows],
        R_ln=origin.local_ned(p_n_m[rows]).swapaxes(1, 2),
        P_position=of_rows(estimate.position_covariance_m2, 3, 3),
        P_velocity=of_rows(estimate.velocity_covariance_m2ps2, 3, 3),
        P_attitude=of_rows(estimate.attitude_covariance_rad2, 3, 3),
    )
