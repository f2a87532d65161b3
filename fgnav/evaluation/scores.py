"""One method's figures: errors against the truth, epoch by epoch, and what they amount to."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray, Loss
from fgnav.evaluation.integer_counts import IntegerCounts
from fgnav.evaluation.reference import covered, truth_at
from fgnav.geometry import rotations
from fgnav.types.estimate import (
    Consistency,
    Estimate,
    GraphSummary,
    Verdict,
    open_angle_variance_rad2,
)
from fgnav.types.flight import Truth

EULER = ("roll", "pitch", "yaw")
_OPEN = 0.9  # of the variance of a uniform angle: rounding, and what a prior adds


@dataclass(frozen=True, slots=True, kw_only=True)
class Angles:
    """One figure per Euler angle, degrees; None where the data do not determine the angle."""

    roll: float | None = None
    pitch: float | None = None
    yaw: float | None = None


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Errors:
    """Estimate minus truth at every epoch that has both.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
    euler_rad : ndarray, shape (n, 3)
        Roll, pitch, yaw, wrapped; NaN in the columns of unobservable angles.
    tangent_b_rad : ndarray, shape (n, 3)
        Body-axes rotation vector from the estimated to the true attitude.
    position_n_m, velocity_n_mps : ndarray, shape (n, 3), or None
    nees, position_nees, velocity_nees : ndarray, shape (n,), or None
        Normalised errors squared of attitude, position, velocity: chi-square with 3 degrees of
        freedom when the stated covariance is right; NaN where that is not positive definite.
    line_nees : ndarray, shape (n,), or None
        That of the direction of antennas in a line, 2 degrees of freedom; NaN where the stated
        covariance does not leave one axis open.
    losses : tuple of Loss
        Epochs of the estimate that could not be judged.
    """

    t_s: FloatArray
    euler_rad: FloatArray
    tangent_b_rad: FloatArray
    position_n_m: FloatArray | None
    velocity_n_mps: FloatArray | None
    nees: FloatArray | None
    position_nees: FloatArray | None = None
    velocity_nees: FloatArray | None = None
    line_nees: FloatArray | None = None
    losses: tuple[Loss, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """The figures of one method; None where the flight or the method has nothing to judge.

    Attributes
    ----------
    attitude_rmse_deg : float or None
        RMS of the angle of the rotation between estimate and truth.
    position_rmse_m, velocity_rmse_mps : float or None
        RMS of the length of the error vector.
    attitude_nees_mean, position_nees_mean, velocity_nees_mean : float or None
        Near 3 when the stated covariance is honest, over many flights: errors of position are
        nearly the same all along one.
    line_nees_mean : float or None
        Near 2 when that of the direction of antennas in a line is; None unless an angle is open.
    available : float
        Share of the epochs with an answer.
    seconds : float
        Wall time from the flight to the estimate, differences and integers included, without
        the compilation of kernels that the first run after an install brings.
    graph : GraphSummary or None
        Factors by kind, answers of networks, updates of the solver.
    consistency : tuple of Consistency
        Innovations by kind of measurement, of a method that states them.
    verdicts : tuple of Verdict
        Sensors that contradict the others, of such a method.
    failure : str or None
        Why there is no estimate at all.
    """

    rmse_deg: Angles = Angles()
    attitude_rmse_deg: float | None = None
    position_rmse_m: float | None = None
    velocity_rmse_mps: float | None = None
    attitude_nees_mean: float | None = None
    position_nees_mean: float | None = None
    velocity_nees_mean: float | None = None
    line_nees_mean: float | None = None
    available: float = 0.0
    integers: IntegerCounts | None = None
    seconds: float
    converged: bool = False
    unobservable: tuple[str, ...] = ()
    losses: tuple[Loss, ...] = ()
    graph: GraphSummary | None = None
    consistency: tuple[Consistency, ...] = ()
    verdicts: tuple[Verdict, ...] = ()
    notes: tuple[str, ...] = ()
    failure: str | None = None


def errors_against(truth: Truth, estimate: Estimate) -> Errors:
    """Return the errors of an estimate at its own epochs, the truth interpolated to them."""
    inside = covered(truth, estimate.t_s)
    real = truth_at(truth, estimate.t_s[inside])
    R_nb = estimate.R_nb[inside]
    euler_rad = rotations.wrap(rotations.to_euler(R_nb) - rotations.to_euler(real.R_nb))
    euler_rad[:, [name in hidden(estimate) for name in EULER]] = np.nan
    tangent_b_rad = rotations.log(rotations.transpose(R_nb) @ real.R_nb)
    position_n_m = _minus(estimate.p_n_m, real.p_n_m, inside)
    velocity_n_mps = _minus(estimate.v_n_mps, real.v_n_mps, inside)
    nees = _nees(
        tangent_b_rad, estimate.attitude_covariance_rad2, inside, _attitude_covariance(real)
    )
    outside = int((~inside).sum())
    losses = [("epoch", "not judged: outside the truth's time span or in a gap of it", outside)]
    if nees is not None:
        singular = int(np.isnan(nees).sum())
        losses.append(("epoch", "not in the NEES: covariance not positive definite", singular))
    return Errors(
        t_s=real.t_s,
        euler_rad=euler_rad,
        tangent_b_rad=tangent_b_rad,
        position_n_m=position_n_m,
        velocity_n_mps=velocity_n_mps,
        nees=nees,
        position_nees=_nees(
            position_n_m, estimate.position_covariance_m2, inside, _diagonal(real.position_sigma_m)
        ),
        velocity_nees=_nees(
            velocity_n_mps,
            estimate.velocity_covariance_m2ps2,
            inside,
            _diagonal(real.velocity_sigma_mps),
        ),
        line_nees=_line_nees(
            rotations.transpose(R_nb) @ real.R_nb,
            estimate.attitude_covariance_rad2,
            inside,
            _attitude_covariance(real),
        ),
        losses=tuple(Loss(what=w, reason=r, count=c) for w, r, c in losses if c),
    )


def score(
    estimate: Estimate, errors: Errors | None, integers: IntegerCounts | None, seconds: float
) -> Score:
    """Return a method's figures; without errors (no truth) only those that need none."""
    figures = Score(
        available=estimate.available,
        integers=integers,
        seconds=seconds,
        converged=estimate.converged,
        unobservable=estimate.unobservable,
        losses=estimate.losses + (errors.losses if errors else ()),
        graph=estimate.graph,
        consistency=estimate.consistency,
        verdicts=estimate.verdicts,
        notes=estimate.notes,
    )
    if errors is None:
        return figures
    lost = hidden(estimate)
    full_attitude = not lost & set(EULER)
    return replace(
        figures,
        rmse_deg=angles(errors.euler_rad),
        attitude_rmse_deg=degrees(rms(errors.tangent_b_rad)) if full_attitude else None,
        position_rmse_m=None if "position" in lost else rms(errors.position_n_m),
        velocity_rmse_mps=None if "velocity" in lost else rms(errors.velocity_n_mps),
        attitude_nees_mean=_mean(errors.nees) if full_attitude else None,
        position_nees_mean=None if "position" in lost else _mean(errors.position_nees),
        velocity_nees_mean=None if "velocity" in lost else _mean(errors.velocity_nees),
        line_nees_mean=None if full_attitude else _mean(errors.line_nees),
    )


def hidden(estimate: Estimate) -> set[str]:
    """Return the states an estimate calls unobservable.

    The three angles go together where the estimate names the attitude, or a rotation about an axis
    that is none of the body's: all three then hold a share of what is unknown.
    """
    names = set(estimate.unobservable)
    mixed = any(name == "attitude" or name.startswith("rotation") for name in names)
    return names | set(EULER) if mixed else names


def rms(values: FloatArray | None) -> float | None:
    """Return the RMS length of (n, 3) vectors or (n,) values; None of nothing."""
    if values is None or not values.size:
        return None
    return float(np.sqrt((values**2).sum() / len(values)))


def degrees(angle_rad: float | None) -> float | None:
    """Return degrees, or None of None."""
    return None if angle_rad is None else float(np.degrees(angle_rad))


def angles(euler_rad: FloatArray) -> Angles:
    """Return the RMS per Euler angle of (n, 3) angles; None for columns that hold a NaN."""
    columns = [None if np.isnan(c).any() else degrees(rms(c)) for c in euler_rad.T]
    return Angles(**dict(zip(EULER, columns, strict=True)))


def finite_mean(values: FloatArray, axis: int) -> FloatArray:
    """Return the mean of what is finite over an axis; NaN of nothing."""
    is_finite = np.isfinite(values)
    count = is_finite.sum(axis=axis)
    total = np.where(is_finite, values, 0.0).sum(axis=axis)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def _mean(values: FloatArray | None) -> float | None:
    if values is None or not np.isfinite(values).any():
        return None
    return float(np.nanmean(values))


def _minus(estimate: FloatArray | None, truth: FloatArray, inside: BoolArray) -> FloatArray | None:
    return None if estimate is None else np.asarray(estimate[inside] - truth)


def _diagonal(sigma: FloatArray | None) -> FloatArray | None:
    return None if sigma is None else np.asarray(sigma[:, :, None] ** 2 * np.eye(3))


def _attitude_covariance(truth: Truth) -> FloatArray | None:
    """Return the covariance of a reference's attitudes in body axes, (n, 3, 3)."""
    euler_rad2 = _diagonal(truth.euler_sigma_rad)
    if euler_rad2 is None:
        return None
    J = np.linalg.inv(rotations.euler_jacobian(truth.R_nb))
    return np.asarray(J @ euler_rad2 @ J.swapaxes(1, 2))


def _nees(
    error: FloatArray | None,
    covariance: FloatArray | None,
    inside: BoolArray,
    of_reference: FloatArray | None,
) -> FloatArray | None:
    """Return error' covariance^-1 error per epoch, (n,), NaN where there is no inverse.

    The covariance is that of the estimate, and of the reference where that states one: errors of
    both are taken as independent.
    """
    if error is None or covariance is None:
        return None
    covariance = covariance[inside] if of_reference is None else covariance[inside] + of_reference
    finite = np.isfinite(np.concatenate([covariance, error[:, :, None]], axis=2)).all(axis=(1, 2))
    variance, axes = np.linalg.eigh(np.where(np.reshape(finite, (-1, 1, 1)), covariance, 0.0))
    sound = variance[:, 0] > 0
    along = np.einsum("nij,ni->nj", axes, error)
    safe = np.where(sound[:, None], variance, 1.0)
    return np.where(sound, (along**2 / safe).sum(axis=1), np.nan)


def _line_nees(
    turn_b: FloatArray,
    covariance: FloatArray | None,
    inside: BoolArray,
    of_reference: FloatArray | None,
) -> FloatArray | None:
    """Return the NEES of the axis about which attitudes are open, (n,); NaN where none is.

    ``turn_b``, (n, 3, 3), is the way from the estimated to the true attitude. The angle about the
    axis may be any, so that components of its rotation vector across say nothing: the way that the
    axis itself takes does.
    """
    if covariance is None:
        return None
    covariance = covariance[inside] if of_reference is None else covariance[inside] + of_reference
    is_finite = np.isfinite(covariance).all(axis=(1, 2))
    variance, axes = np.linalg.eigh(
        np.where(np.reshape(is_finite, (-1, 1, 1)), covariance, np.eye(3))
    )
    is_open = variance > _OPEN * open_angle_variance_rad2()
    line = is_finite & is_open[:, 2] & ~is_open[:, 1] & (variance[:, 0] > 0)
    axis_b = axes[:, :, 2]
    true_b = np.einsum("nij,nj->ni", turn_b, axis_b)
    across = np.cross(axis_b, true_b)
    sine, cosine = np.linalg.norm(across, axis=1), np.einsum("ni,ni->n", axis_b, true_b)
    angle = np.arctan2(sine, cosine) / np.maximum(sine, np.finfo(float).tiny)
    along = np.einsum("nij,ni->nj", axes[:, :, :2], angle[:, None] * across)
    safe = np.where(line[:, None], variance[:, :2], 1.0)
    return np.where(line, (along**2 / safe).sum(axis=1), np.nan)
