"""Full-covariance maximum likelihood of the antenna array, epoch by epoch."""

from dataclasses import dataclass, field

from fgnav.attitude.array import agreeing
from fgnav.attitude.baselines import body_motion
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import NoSolutionError, positive, unused_of
from fgnav.integers.resolvers.registry import default_resolver
from fgnav.integers.resolvers.resolve import resolve
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight
from fgnav.types.integers import Resolver


@dataclass(frozen=True, slots=True, kw_only=True)
class MaximumLikelihood:
    """Every fixed double difference of an epoch at once, with its full covariance; no smoothing.

    Epochs whose residuals fail the chi-square test, as they do with a wrong integer, are not
    answered but counted.

    Attributes
    ----------
    resolver : Resolver
    false_alarm : float
        Share of right epochs that the chi-square test may turn away.
    name : str
    """

    resolver: Resolver = field(default_factory=default_resolver)
    false_alarm: float = 1e-4
    name: str = "maximum-likelihood"

    def __post_init__(self) -> None:
        """Reject a share that is none."""
        positive(f"{self.name} false_alarm", self.false_alarm)

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate attitude at the epochs with fixed differences; position from code.

        Raises
        ------
        NoSolutionError
            If no epoch determines the attitude.
        """
        differences, integers = resolve(flight, self.resolver)
        stated = RotationQuadratic.of_double_differences(differences, integers)
        _, solution, noise_notes = agreeing(stated)
        keep = solution.solved & solution.consistent(self.false_alarm)
        undetermined, failed = int((~solution.solved).sum()), int((solution.solved & ~keep).sum())
        unused = unused_of(
            {
                ("epoch", "fixed differences do not determine the attitude"): undetermined,
                ("epoch", "residuals of the fixed array fail the chi-square test"): failed,
            }
        )
        if not keep.any():
            reasons = "; ".join(f"{loss.reason} ({loss.count})" for loss in unused)
            raise NoSolutionError(f"attitude: no epoch has an answer: {reasons}")
        R_nb = solution.R_nb[keep]
        motion = body_motion(flight, differences.t_s[keep], R_nb)
        return Estimate(
            method=self.name,
            t_s=differences.t_s[keep],
            n_epochs=len(differences.t_s),
            R_nb=R_nb,
            attitude_covariance_rad2=solution.covariance_rad2[keep],
            p_n_m=motion.p_n_m,
            position_covariance_m2=motion.position_covariance_m2,
            v_n_mps=motion.v_n_mps,
            velocity_covariance_m2ps2=motion.velocity_covariance_m2ps2,
            unobservable=solution.unobservable(),
            integers=integers,
            unused=(*differences.unused, *integers.unused, *unused),
            notes=(*noise_notes, *motion.notes),
        )
