"""One method's figures: errors against the truth, epoch by epoch, and what they amount to."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.attitude.baseline_angles import (
    BaselineAngles,
    azimuth_elevation,
    baseline_angles,
    reported_baselines,
)
from fgnav.attitude.receiver_baselines import KNOWN_RAD
from fgnav.checks import FloatArray, Unused
from fgnav.evaluation.integer_counts import IntegerCounts
from fgnav.evaluation.reference import covered, truth_at
from fgnav.geometry import rotations
from fgnav.types.estimate import Consistency, Errors, Estimate, GraphSummary, Verdict
from fgnav.types.flight import Flight, Truth

EULER = ("roll", "pitch", "yaw")
_SIGMAS = "azimuth_sigma_deg", "elevation_sigma_deg"
_ERRORS = "azimuth_rmse_deg", "elevation_rmse_deg"


@dataclass(frozen=True, slots=True, kw_only=True)
class Angles:
    """One figure per Euler angle, degrees; None where the data do not determine the angle."""

    roll: float | None = None
    pitch: float | None = None
    yaw: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MedianSigmas:
    """Medians over epochs of 1-sigma as stated: of angles, and the root of the sum of squares."""

    euler_deg: Angles = Angles()
    position_m: float | None = None
    velocity_mps: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class BaselineFigures:
    """Medians of 1-sigma of a baseline's angles, degrees, and what there is against truth.

    Attributes
    ----------
    name : str
    azimuth_sigma_deg, elevation_sigma_deg : float or None
    azimuth_rmse_deg, elevation_rmse_deg : float or None
    nees_mean : float or None
        Near 2 where what is stated of both angles is right.
    """

    name: str
    azimuth_sigma_deg: float | None = None
    elevation_sigma_deg: float | None = None
    azimuth_rmse_deg: float | None = None
    elevation_rmse_deg: float | None = None
    nees_mean: float | None = None


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
    sigmas : MedianSigmas
    baselines : tuple of BaselineFigures
        Azimuth and elevation of receivers' baselines, and of antennas in a line.
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
    sigmas: MedianSigmas = MedianSigmas()
    baselines: tuple[BaselineFigures, ...] = ()
    available: float = 0.0
    integers: IntegerCounts | None = None
    seconds: float
    converged: bool = False
    unobservable: tuple[str, ...] = ()
    unused: tuple[Unused, ...] = ()
    graph: GraphSummary | None = None
    consistency: tuple[Consistency, ...] = ()
    verdicts: tuple[Verdict, ...] = ()
    notes: tuple[str, ...] = ()
    failure: str | None = None


def errors_against(truth: Truth, estimate: Estimate) -> Errors:
    """Return the errors of an estimate at its own epochs, the truth interpolated to them."""
    inside = covered(truth, estimate.t_s)
    real = truth_at(truth, estimate.t_s[inside])

    def covered_values(
        values: FloatArray | None, reference: FloatArray | float = 0.0
    ) -> FloatArray | None:
        return None if values is None else np.asarray(values[inside] - reference)

    R_nb = estimate.R_nb[inside]
    euler_rad = rotations.wrap(rotations.to_euler(R_nb) - rotations.to_euler(real.R_nb))
    euler_rad[:, [name in hidden(estimate) for name in EULER]] = np.nan
    tangent_b_rad = rotations.log(rotations.transpose(R_nb) @ real.R_nb)
    position_n_m = covered_values(estimate.p_n_m, real.p_n_m)
    velocity_n_mps = covered_values(estimate.v_n_mps, real.v_n_mps)
    position, velocity = estimate.position_covariance_m2, estimate.velocity_covariance_m2ps2
    nees = _nees(
        tangent_b_rad, covered_values(estimate.attitude_covariance_rad2), _attitude_covariance(real)
    )
    outside = int((~inside).sum())
    unused = [("epoch", "not judged: outside the truth's time span or in a gap of it", outside)]
    if nees is not None:
        singular = int(np.isnan(nees).sum())
        unused.append(("epoch", "not in the NEES: covariance not positive definite", singular))
    return Errors(
        t_s=real.t_s,
        euler_rad=euler_rad,
        tangent_b_rad=tangent_b_rad,
        position_n_m=position_n_m,
        velocity_n_mps=velocity_n_mps,
        nees=nees,
        sigma_rad=covered_values(estimate.sigma_rad),
        position_sigma_m=covered_values(estimate.position_sigma_m),
        velocity_sigma_mps=covered_values(estimate.velocity_sigma_mps),
        position_nees=_nees(
            position_n_m, covered_values(position), _diagonal(real.position_sigma_m)
        ),
        velocity_nees=_nees(
            velocity_n_mps, covered_values(velocity), _diagonal(real.velocity_sigma_mps)
        ),
        unused=tuple(Unused(what=w, reason=r, count=c) for w, r, c in unused if c),
    )


def score(
    estimate: Estimate,
    errors: Errors | None,
    integers: IntegerCounts | None,
    seconds: float,
    baselines: tuple[BaselineFigures, ...] = (),
) -> Score:
    """Return a method's figures; without errors (no truth) only those that need none."""
    figures = Score(
        sigmas=median_sigmas(estimate),
        baselines=baselines,
        available=estimate.available,
        integers=integers,
        seconds=seconds,
        converged=estimate.converged,
        unobservable=estimate.unobservable,
        unused=estimate.unused + (errors.unused if errors else ()),
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
    )


def hidden(estimate: Estimate) -> set[str]:
    """Return the states an estimate calls unobservable.

    The three angles go together where the estimate names the attitude, or a rotation about an axis
    that is none of the body's: all three then hold a share of what is unknown.
    """
    names = set(estimate.unobservable)
    mixed = any(name == "attitude" or name.startswith("rotation") for name in names)
    return names | set(EULER) if mixed else names


def median_sigmas(estimate: Estimate) -> MedianSigmas:
    """Return medians of what an estimate states of its errors, of what it observes."""
    lost, euler_deg = hidden(estimate), estimate.sigma_deg
    sigmas: dict[str, float] = {}
    if euler_deg is not None and len(euler_deg):
        medians = dict(zip(EULER, np.median(euler_deg, axis=0).tolist(), strict=True))
        sigmas = {name: value for name, value in medians.items() if name not in lost}
    return MedianSigmas(
        euler_deg=Angles(**sigmas),
        position_m=None if "position" in lost else _size(estimate.position_covariance_m2),
        velocity_mps=None if "velocity" in lost else _size(estimate.velocity_covariance_m2ps2),
    )


def _size(covariance: FloatArray | None) -> float | None:
    """Return the median over epochs of the root of a covariance's trace."""
    if covariance is None or not np.isfinite(covariance).all(axis=(1, 2)).any():
        return None
    return float(np.nanmedian(np.sqrt(np.einsum("nii->n", covariance).clip(0))))


def open_heading_spans_s(estimate: Estimate) -> list[tuple[float, float]]:
    """Return first and last epoch of each span in which yaw is known to no better than a guess."""
    sigma_deg = estimate.sigma_deg
    if sigma_deg is None or not len(sigma_deg):
        return []
    is_open = sigma_deg[:, 2] > np.degrees(KNOWN_RAD)
    if "yaw" in hidden(estimate):
        is_open[:] = True
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_open, [False]]).astype(np.int8)))
    t_s = estimate.t_s
    return [
        (float(t_s[a]), float(t_s[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]


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
    error: FloatArray | None, covariance: FloatArray | None, of_reference: FloatArray | None = None
) -> FloatArray | None:
    """Return error' covariance^-1 error per epoch, (n,), NaN where there is no inverse.

    The covariance is that of the estimate, and of the reference where that states one: errors of
    both are taken as independent.
    """
    if error is None or covariance is None:
        return None
    covariance = covariance if of_reference is None else covariance + of_reference
    finite = np.isfinite(np.concatenate([covariance, error[:, :, None]], axis=2)).all(axis=(1, 2))
    variance, axes = np.linalg.eigh(np.where(np.reshape(finite, (-1, 1, 1)), covariance, 0.0))
    sound = variance[:, 0] > 0
    along = np.einsum("nij,ni->nj", axes, error)
    safe = np.where(sound[:, None], variance, 1.0)
    return np.where(sound, (along**2 / safe).sum(axis=1), np.nan)


def baseline_errors_rad(angles: BaselineAngles, truth: Truth, unit_b: FloatArray) -> FloatArray:
    """Return errors of azimuth and elevation, (n, 2); NaN where there is no truth."""
    inside, errors = covered(truth, angles.t_s), np.full((len(angles.t_s), 2), np.nan)
    real = azimuth_elevation(truth_at(truth, angles.t_s[inside]).R_nb @ unit_b)
    errors[inside] = rotations.wrap(angles.angles_rad[inside] - real)
    return errors


def baseline_figures(flight: Flight, estimate: Estimate) -> tuple[BaselineFigures, ...]:
    """Return the figures of all reported baselines of a flight."""
    figures = []
    for name, unit_b in reported_baselines(flight).items() if len(estimate.t_s) else ():
        angles = baseline_angles(estimate, unit_b)
        of: dict[str, float | None] = {}
        if angles.sigma_rad is not None:
            medians_rad = np.median(angles.sigma_rad, axis=0)
            of = dict(zip(_SIGMAS, np.degrees(medians_rad).tolist(), strict=True))
        if flight.truth is not None:
            errors = baseline_errors_rad(angles, flight.truth, unit_b)
            sizes = (degrees(rms(error[np.isfinite(error)])) for error in errors.T)
            of |= dict(zip(_ERRORS, sizes, strict=True))
            of["nees_mean"] = _mean(_nees(errors, angles.covariance_rad2))
        figures.append(BaselineFigures(name=name, **of))
    return tuple(figures)
