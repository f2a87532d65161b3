"""One estimate of the yardstick: its errors, its normalised errors, its time, and its outcome.

Normalised errors squared (NEES) of three components are averaged over a flight. An error that is
the same all along a flight is one draw of a chi-square variable with three degrees of freedom: its
mean is 3, and it exceeds 10 in 1.9 % and 16.3 in 0.1 % of flights. Errors that vary along a flight
average, and exceed either less often.

- right: no NEES above its limit, no RMSE above twice the reference of the clean flight.
- degraded: no NEES above its limit, but a larger RMSE, a missing state, a tenth of the epochs
  missing, or no convergence.
- refused: an error of the library in place of an estimate. Any other exception: crashed.
- said and wrong: a NEES above its limit, and a contradiction reported or no convergence.
- silent and wrong: a NEES above its limit, and neither of both.

The limit of a clean flight is 16.3: of three states of 60 flights, .2 exceed it by chance. That of
a faulty flight is 10, or 2.5 times the NEES of its clean flight, of which it has the noise and so
the luck of the draw. The reference of an RMSE is the larger of the clean flight's RMSE and standard
deviation: by luck the first may be small.
"""

import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from time import process_time

import numpy as np
from scipy.special import chdtri

from fgnav.checks import FgnavError
from fgnav.evaluation.scores import errors_against, score
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Truth

STATES = ("attitude", "position", "velocity")
UNITS = ("deg", "m", "m/s")
OUTCOMES = ("right", "degraded", "refused", "said and wrong", "silent and wrong", "crashed")
WRONG_NEES, MORE_THAN_CLEAN = 10.0, 2.5
CLEAN_NEES = float(chdtri(3, 1e-3))
COMPARABLE, MOST_EPOCHS = 2.0, 0.9


@dataclass(frozen=True, kw_only=True)
class Result:
    """One estimate of one flight.

    ``rmse``, ``sigma`` and ``nees`` are by ``STATES``, without those that are open; ``seconds`` are
    of processor, of the estimate alone; ``said`` is whether the estimate is reported as not
    consistent.
    """

    part: str
    name: str
    seed: int | None = None
    method: str = "batch"
    fault: str = ""
    outcome: str = ""
    failure: str = ""
    seconds: float = 0.0
    epochs: int = 0
    converged: bool = False
    said: bool = False
    rmse: dict[str, float] = field(default_factory=dict)
    sigma: dict[str, float] = field(default_factory=dict)
    nees: dict[str, float] = field(default_factory=dict)
    figures: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def solved(solve: Callable[[], Estimate], evaluate: Callable[[Estimate], dict]) -> dict:
    """Return the fields of a ``Result``, those of ``evaluate`` included if there is an estimate."""
    begin, fields = process_time(), {}
    try:
        estimate = solve()
        fields["seconds"] = process_time() - begin
        fields |= {"epochs": len(estimate.t_s), "converged": estimate.converged}
        fields |= {"said": not estimate.consistent, "notes": estimate.notes}
        return fields | evaluate(estimate)
    except FgnavError as error:
        failed = {"failure": f"{type(error).__name__}: {error}", "outcome": "refused"}
    except Exception:  # noqa: BLE001  # one flight must not hide the others
        failed = {"failure": traceback.format_exc(limit=-3), "outcome": "crashed"}
    return {"seconds": process_time() - begin} | fields | failed


def judged(solve: Callable[[], Estimate], truth: Truth, clean: Result | None = None) -> dict:
    """Return the fields of the ``Result`` of a flight whose truth is known."""
    fields = solved(solve, lambda estimate: against(truth, estimate))
    return fields if "failure" in fields else fields | {"outcome": outcome_of(fields, clean)}


def against(truth: Truth, estimate: Estimate) -> dict:
    """Return RMSE, stated standard deviations and NEES by state."""
    of = score(estimate, errors_against(truth, estimate), None, 0.0)
    covariances = (
        estimate.attitude_covariance_rad2,
        estimate.position_covariance_m2,
        estimate.velocity_covariance_m2ps2,
    )
    scales = (np.degrees(1.0), 1.0, 1.0)

    def known(x: float | None) -> bool:
        return x is not None and not np.isnan(x)

    columns = {
        "rmse": (of.attitude_rmse_deg, of.position_rmse_m, of.velocity_rmse_mps),
        "nees": (of.attitude_nees_mean, of.position_nees_mean, of.velocity_nees_mean),
        "sigma": [
            None if P is None else scale * np.sqrt(np.nanmean(np.einsum("nii->n", P)))
            for P, scale in zip(covariances, scales, strict=True)
        ],
    }
    return {
        name: {s: float(x) for s, x in zip(STATES, column, strict=True) if known(x)}
        for name, column in columns.items()
    }


def outcome_of(fields: dict, clean: Result | None) -> str:
    """Return the outcome of an estimate by its fields and the flight without its fault."""
    nees, rmse = fields["nees"], fields["rmse"]
    luck = {s: MORE_THAN_CLEAN * min(x, CLEAN_NEES) for s, x in clean.nees.items()} if clean else {}
    least = WRONG_NEES if clean else CLEAN_NEES
    if any(x > max(least, luck.get(s, 0.0)) for s, x in nees.items()):
        warned = fields["said"] or not fields["converged"]
        return "said and wrong" if warned else "silent and wrong"
    if clean is None or clean.failure:
        return "right"
    most = {s: COMPARABLE * max(x, clean.sigma[s]) for s, x in clean.rmse.items()}
    whole = fields["converged"] and fields["epochs"] >= MOST_EPOCHS * clean.epochs
    comparable = all(s in nees and rmse.get(s, np.inf) <= most[s] for s in most)
    return "right" if whole and comparable else "degraded"
