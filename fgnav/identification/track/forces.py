"""Whether the forces that velocities tell are those that an inertial unit feels, turned.

No heading takes part: over the same spans both are the same vectors in two frames, so that one
rotation takes one series to the other, whichever it is (Wahba's problem). What is left over is
noise of fixes and unit; axes that are exchanged or turned beside the gyroscope's, or velocities of
another time, leave more.
"""

import numpy as np

from fgnav.attitude.flight_vectors import Track, track_of
from fgnav.attitude.own_rotation import own_rotation
from fgnav.checks import FloatArray, NoSolutionError
from fgnav.frontend.attitude.force_pairs import Integrated, Pairs, specific_forces
from fgnav.frontend.faulty_samples import without_faulty
from fgnav.gnss.single_point.solution import code_solution
from fgnav.graph.innovation.band import contradictions, limit_of
from fgnav.types.estimate import Consistency
from fgnav.types.flight import Flight, Imu

_SPAN_S = 1.0  # of an acceleration: shorter than a swing, long beside the noise of velocities
_FEWEST = 5  # pairs: a rotation takes three of their numbers
NAME = "specific force"


def force_consistency(flight: Flight) -> tuple[Consistency, ...]:
    """Return how far forces by velocities of fixes and by the unit disagree, at any attitude.

    Empty without velocities or a gyroscope, or with too few spans. Velocities are those of fixes,
    or, of raw observations, by Doppler.
    """
    imu, moving = flight.imu, _moving(flight)
    if moving is None or imu is None or imu.w_b_radps is None:
        return ()
    imu, _ = without_faulty(imu)
    own = own_rotation(imu)
    if own is None:
        return ()
    track, sigma_mps = moving
    integrated = Integrated(imu, own, track.arm_b_m - imu.position_b_m)
    gravity_n_mps2 = flight.origin.gravity_n_mps2(track.p_n_m[:1])[0]
    pairs = next(specific_forces(integrated, track, _SPAN_S, gravity_n_mps2), None)
    if pairs is None or len(pairs.from_s) < _FEWEST:
        return ()
    squared = _left(pairs, _variance(pairs, imu, sigma_mps))
    freedom = np.full(len(squared), 3)
    t_s = (pairs.from_s + pairs.until_s) / 2
    return (
        Consistency(
            what=NAME,
            count=len(squared),
            freedom=int(freedom.sum()),
            nis=float(squared.sum() / freedom.sum()),
            beyond_99=0.0,
            limit=limit_of(squared, freedom),
            contradictions=contradictions(t_s, squared, freedom),
        ),
    )


def _moving(flight: Flight) -> tuple[Track, float] | None:
    """Return the track of an antenna and the 1-sigma of its velocities, if there are any."""
    if flight.observations is not None:
        try:
            code = code_solution(flight)
        except NoSolutionError:
            return None
        if code.velocity_covariance_m2ps2 is None:
            return None
        variances = code.velocity_covariance_m2ps2.trace(axis1=1, axis2=2) / 3
        return track_of(flight), float(np.sqrt(np.nanmean(variances)))
    fixes = flight.fixes
    if fixes is None or fixes.v_n_mps is None or fixes.velocity_sigma_mps is None:
        return None
    return track_of(flight), float(np.sqrt((np.asarray(fixes.velocity_sigma_mps) ** 2).mean()))


def _left(pairs: Pairs, variance: FloatArray) -> FloatArray:
    """Return the squares of what the best rotation leaves, (m,), over their variances, (m,)."""
    weighted = pairs.f_n_mps2 / variance[:, None]
    U, _, Vt = np.linalg.svd(weighted.T @ pairs.f_u_mps2)
    proper = np.diag([1.0, 1.0, np.linalg.det(U @ Vt)])
    off = pairs.f_n_mps2 - pairs.f_u_mps2 @ (U @ proper @ Vt).T
    return np.asarray((off**2).sum(axis=1) / variance)


def _variance(pairs: Pairs, imu: Imu, sigma_mps: float) -> FloatArray:
    """Return the variance of an axis of each difference, (m,), by what the flight states.

    Of two velocities; of specific force; of the turn since the middle, across the force.
    """
    span_s = pairs.until_s - pairs.from_s
    t_s = (pairs.from_s + pairs.until_s) / 2
    away_s = np.abs(t_s - t_s.mean())
    force2 = (pairs.f_u_mps2**2).sum(axis=1)
    white = imu.accelerometer_noise_mps2_per_sqrt_hz**2 / span_s + imu.accelerometer_bias_mps2**2
    rate, drift = imu.gyroscope_noise_radps_per_sqrt_hz or 0.0, imu.gyroscope_bias_radps or 0.0
    turned = rate**2 * away_s + (drift * away_s) ** 2
    return np.asarray(2 * (sigma_mps / span_s) ** 2 + white + force2 * turned)
