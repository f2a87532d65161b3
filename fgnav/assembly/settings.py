"""Settings by which a flight becomes a smoothing problem."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from fgnav.assembly.calibration_request import CalibrationRequest
from fgnav.gravity import GravityEstimator
from fgnav.process.hyperparameters import IntervalPriors, RatePrior
from fgnav.types.integers import Resolver


@dataclass(frozen=True, slots=True, kw_only=True)
class ProblemSettings:
    """Settings by which a flight becomes a smoothing problem; see ``Smoother``."""

    resolver: Resolver
    gravity: GravityEstimator | None = None
    calibration: tuple[CalibrationRequest, ...] = ()
    rate_prior: RatePrior | None = None
    # Identified with other tags or noise of the unit, which do not change an array's attitudes.
    interval_priors: IntervalPriors | None = None
    sub_steps: int | None = None
    false_alarm: float = 1e-4
    causal: bool = False  # each quantity from epochs up to its own alone
    noise: Literal["estimated", "nominal"] = "nominal"
    at_rest: Mapping[str, float] = field(default_factory=dict, hash=False)  # of motion
