"""The reference: what a careful user of RTK software gets, epoch by epoch, without smoothing."""

from dataclasses import dataclass

from fgnav.attitude.array import axis_name
from fgnav.attitude.baselines import body_motion, weighted_baselines
from fgnav.attitude.vector_pairs import collinear, sensitivity, wahba
from fgnav.checks import BadInputError, NoSolutionError, unused_of
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.integers.resolvers.resolve import resolve
from fgnav.messages import note
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight
from fgnav.types.integers import Resolver


@dataclass(frozen=True, slots=True, kw_only=True)
class Rtk:
    """LAMBDA per baseline with the ratio test, then Wahba's problem on the fixed baselines.

    The attitude's covariance is the phase noise carried to first order through baselines and
    Wahba's solution; it takes accepted integers as right. With two antennas, or all on a line, the
    rotation about that line is open: it is set by convention, named, and has the variance of a
    uniform angle.

    Attributes
    ----------
    ratio_min : float
        Threshold of the ratio test.
    resolver : Resolver or None
        Ignored, and only there because methods are made by name with one: a reference that changed
        with the integers under test would be none.
    name : str
    """

    ratio_min: float = 3.0
    resolver: Resolver | None = None
    name: str = "rtk"

    def __post_init__(self) -> None:
        """Reject a threshold that no search can fail."""
        if not self.ratio_min >= 1:
            raise BadInputError(f"rtk ratio_min: must be 1 or more, got {self.ratio_min}")

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate attitude, position and velocity at the epochs whose baselines are fixed.

        Raises
        ------
        NoSolutionError
            If the flight has fewer than two antennas with raw data, or no epoch is fixed.
        """
        if flight.observations is None or len(flight.antennas) < 2:
            raise NoSolutionError(f"attitude: flight {flight.name} needs raw data of two antennas")
        differences, integers = resolve(flight, Lambda(joint=False, ratio_min=self.ratio_min))
        baselines = weighted_baselines(differences, integers)
        names = tuple(antenna.name for antenna in flight.antennas[1:])
        pairs = baselines.pairs(differences.baselines_b_m, names)
        attitude = wahba(pairs)
        S = sensitivity(lambda moved: wahba(moved).R_nb, pairs)
        covariance = attitude.with_open_axis(baselines.attitude_covariance_rad2(S))
        line = collinear(differences.baselines_b_m)
        keep = attitude.rank == (1 if line else 2)
        reason = "no baseline is fixed" if line else "no two baselines out of line are fixed"
        if not keep.any():
            raise NoSolutionError(f"attitude: {reason} at any of {len(keep)} epochs")
        lost = unused_of({("epoch", reason): int((~keep).sum())})
        t_s, R_nb = differences.t_s[keep], attitude.R_nb[keep]
        motion = body_motion(flight, t_s, R_nb)
        return Estimate(
            method=self.name,
            t_s=t_s,
            n_epochs=len(flight.observations.t_s),
            R_nb=R_nb,
            attitude_covariance_rad2=covariance[keep],
            p_n_m=motion.p_n_m,
            position_covariance_m2=motion.position_covariance_m2,
            v_n_mps=motion.v_n_mps,
            velocity_covariance_m2ps2=motion.velocity_covariance_m2ps2,
            unobservable=(axis_name(differences.baselines_b_m),) if line else (),
            integers=integers,
            unused=(*differences.unused, *integers.unused, *lost),
            notes=(note("I508"), *motion.notes),
        )
