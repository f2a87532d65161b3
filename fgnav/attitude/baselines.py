"""Baselines in local axes from phase whose integers are known, and the place of the body."""

from dataclasses import dataclass

import numpy as np

from fgnav.attitude.vector_pairs import VectorPairs
from fgnav.checks import BoolArray, FloatArray, IntArray, NoSolutionError
from fgnav.geometry.interpolation import interpolate
from fgnav.gnss.single_point.solution import code_solution
from fgnav.messages import note
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers, fixed_ranges_m

_MANOEUVRE_MPS2 = 9.8  # what a body may do unseen between two code solutions
_SINGULAR = 1e-8  # smallest over largest eigenvalue of H^T H; six satellites in a plane reach 1e-16


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class FixedBaselines:
    """Baselines from the reference antenna, and the linear map that made them."""

    # Baselines in local axes; NaN where fewer than three double differences are fixed, or where a
    # weighted solution has no unique answer.
    b_n_m: FloatArray  # (n, b, 3)
    # ``b_n_m = gain @ ranges``; its columns sum to zero within a group, so it holds for ranges of
    # any reference, undifferenced ones included. 0 where a link is not used.
    gain: FloatArray  # (n, b, 3, m)
    link_variance_m2: FloatArray  # (n, m): of one undifferenced link of one antenna

    @property
    def covariance_m2(self) -> FloatArray:
        """Covariance of each baseline, (n, b, 3, 3); NaN where there is none.

        Noise of links is independent, so both antennas of a baseline contribute alike.
        """
        noisy = self.gain * self.link_variance_m2[:, None, None, :]
        covariance = 2.0 * noisy @ self.gain.swapaxes(2, 3)
        covariance[np.isnan(self.b_n_m[..., 0])] = np.nan
        return np.asarray(covariance)

    def pairs(self, baselines_b_m: FloatArray, names: tuple[str, ...]) -> VectorPairs:
        """Return the baselines beside their body vectors, (b, 3), weighted by inverse variance.

        The weight is one over the mean variance of a baseline's components: with the same
        satellites everywhere, baselines count by their length alone.
        """
        mean_variance = np.trace(self.covariance_m2, axis1=2, axis2=3) / 3.0
        valid = np.isfinite(mean_variance)
        weight = np.where(valid, 1.0 / np.where(valid, mean_variance, 1.0), 0.0)
        v_b = np.broadcast_to(baselines_b_m, self.b_n_m.shape)
        sources = tuple(f"baseline {name}" for name in names)
        return VectorPairs(v_n=self.b_n_m, v_b=v_b, weight=weight, sources=sources)

    def attitude_covariance_rad2(self, sensitivity: FloatArray) -> FloatArray:
        """Return the covariance of an attitude from these baselines, (n, 3, 3), first order.

        Phase noise is carried through the baselines into the attitude link by link, so that what
        baselines share, the reference antenna and the reference satellites, counts as shared. It
        takes body vectors, integers and satellite directions as exact.

        Parameters
        ----------
        sensitivity : ndarray, shape (n, b, 3, 3)
            ``vector_pairs.sensitivity`` to the baselines.
        """
        per_link = sensitivity @ self.gain  # (n, b, 3, m)
        noise_m2 = self.link_variance_m2[:, None, None, :]
        covariance = ((per_link * noise_m2) @ per_link.swapaxes(2, 3)).sum(axis=1)
        of_reference = per_link.sum(axis=1)
        covariance += (of_reference * noise_m2[:, 0]) @ of_reference.swapaxes(1, 2)
        return np.asarray(covariance)


def paper_baselines(differences: DoubleDifferences, integers: Integers) -> FixedBaselines:
    """Return baselines by the pseudo-inverse, every double difference alike (Eqs. 28-32) [1]_.

    Where the satellites leave a direction open, the shortest baseline that fits (Eq. 32).

    References
    ----------
    .. [1] Neural Networks for Estimating Attitude, Line of Sight, and GNSS Ambiguity Through
       Onboard Sensor Fusion, Sensors, 2025, Eqs. 28-32.
    """
    ranges_m = fixed_ranges_m(differences, integers)
    used = _used(differences, ranges_m)
    of_reference = differences.reference[:, differences.group].clip(0)
    e_of_reference = np.take_along_axis(differences.e_n, of_reference[..., None], axis=1)
    H = np.where(differences.is_reference[..., None], 0.0, e_of_reference - differences.e_n)
    normal = _normal_matrices(used, H)
    inverse = np.linalg.pinv(normal, rcond=_SINGULAR, hermitian=True)
    gain = (inverse @ H.swapaxes(1, 2)[:, None]) * used[:, :, None, :]
    # What a difference takes from its reference is the reference's own share.
    for channels in _groups(differences):
        is_reference = differences.is_reference[:, None, None, channels]
        total = gain[..., channels].sum(axis=3, keepdims=True)
        gain[..., channels] -= total * is_reference
    return _solved(differences, ranges_m, used, gain, np.ones(used.shape[:2], dtype=np.bool_))


def weighted_baselines(differences: DoubleDifferences, integers: Integers) -> FixedBaselines:
    """Return baselines by generalised least squares with the full covariance of the differences.

    Double differences weighted by their inverse covariance equal undifferenced links weighted by
    their inverse variances with one free offset per group: the weighted mean of each group leaves
    the sums instead, and no covariance is inverted.
    """
    ranges_m = fixed_ranges_m(differences, integers)
    used = _used(differences, ranges_m)
    weight = used / differences.phase_variance_m2[:, None, :]
    normal = _normal_matrices(weight, differences.e_n)
    gain = np.zeros((*used.shape[:2], 3, used.shape[2]))
    for channels in _groups(differences):
        w, e_n = weight[..., channels], differences.e_n[:, channels]
        total = w.sum(axis=2, keepdims=True)
        mean_e_n = (w @ e_n) / np.where(total > 0, total, 1.0)
        normal -= total[..., None] * mean_e_n[..., :, None] * mean_e_n[..., None, :]
        gain[..., channels] = (mean_e_n[..., None] - e_n.swapaxes(1, 2)[:, None]) * w[:, :, None, :]
    eigenvalues = np.linalg.eigvalsh(normal)
    regular = eigenvalues[..., 0] > _SINGULAR * eigenvalues[..., 2]
    normal[~regular] = np.eye(3)
    return _solved(differences, ranges_m, used, np.linalg.inv(normal) @ gain, regular)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class BodyMotion:
    """Positions of the body's origin at epochs of known attitude, by the reference's code."""

    p_n_m: FloatArray | None = None  # (n, 3)
    position_covariance_m2: FloatArray | None = None  # (n, 3, 3)
    v_n_mps: FloatArray | None = None  # (n, 3); of the reference antenna
    velocity_covariance_m2ps2: FloatArray | None = None  # (n, 3, 3)
    notes: tuple[str, ...] = ()  # why something is None, and what the velocity lacks


def body_motion(flight: Flight, t_s: FloatArray, R_nb: FloatArray) -> BodyMotion:
    """Return the body origin's motion at epochs ``t_s``, (n,), of attitudes ``R_nb``, (n, 3, 3).

    The code solution of the reference antenna less its lever arm. Epochs between code solutions are
    interpolated, with the variance of a manoeuvre at 1 g. Position and velocity are given for all
    the epochs or for none.
    """
    try:
        code = code_solution(flight)
    except NoSolutionError as error:
        return BodyMotion(notes=(note("W505", reason=error),))
    positions = _bridged(t_s, code.t_s, code.p_n_m, code.position_covariance_m2, power=2)
    if positions is None:
        reason = "some epochs lie outside the code solutions"
        return BodyMotion(notes=(note("W505", reason=reason),))
    p_n_m, position_covariance, bridged = positions
    notes = [note("I506", count=bridged)] if bridged else []
    arm_b_m = flight.antennas[0].position_b_m
    rates = None
    if code.v_n_mps is not None and code.velocity_covariance_m2ps2 is not None:
        valid = np.isfinite(code.v_n_mps[:, 0])
        v_n_mps, covariance = code.v_n_mps[valid], code.velocity_covariance_m2ps2[valid]
        rates = _bridged(t_s, code.t_s[valid], v_n_mps, covariance, power=1)
    if rates is None:
        notes.append(note("W507"))
    elif arm_b_m.any():
        notes.append(note("W504", antenna="the reference antenna"))
    return BodyMotion(
        p_n_m=p_n_m - R_nb @ arm_b_m,
        position_covariance_m2=position_covariance,
        v_n_mps=None if rates is None else rates[0],
        velocity_covariance_m2ps2=None if rates is None else rates[1],
        notes=tuple(notes),
    )


def _bridged(
    at_s: FloatArray, t_s: FloatArray, x: FloatArray, covariance: FloatArray, *, power: int
) -> tuple[FloatArray, FloatArray, int] | None:
    """Interpolate vectors, (k, 3), at other times; None if any lies outside.

    Between samples the variance grows with the power of the gap that a constant acceleration gives:
    ``a gap^2 / 8`` in position, ``a gap / 2`` in velocity at most. Returns also how many times are
    not samples.
    """
    if not len(t_s) or at_s.min() < t_s[0] or at_s.max() > t_s[-1]:
        return None
    after = np.searchsorted(t_s, at_s)
    between = t_s[after] != at_s
    gap_s = np.where(between, t_s[after] - t_s[(after - 1).clip(0)], 0.0)
    spread = _MANOEUVRE_MPS2 * (gap_s**2 / 8 if power == 2 else gap_s / 2)
    grown = covariance[after] + spread[:, None, None] ** 2 * np.eye(3)
    return interpolate(at_s, t_s, x), grown, int(between.sum())


def _groups(differences: DoubleDifferences) -> list[IntArray]:
    """Return the channels of each group."""
    return [np.flatnonzero(differences.group == g) for g in np.unique(differences.group)]


def _used(differences: DoubleDifferences, ranges_m: FloatArray) -> BoolArray:
    """Return links that carry geometry, (n, b, m): fixed ones, and references beside any."""
    used = np.isfinite(ranges_m)
    for channels in _groups(differences):
        of_group = used[..., channels]
        with_reference = (of_group & differences.is_reference[:, None, channels]).any(axis=2)
        used[..., channels] = of_group & (with_reference & (of_group.sum(axis=2) > 1))[..., None]
    return used


def _normal_matrices(weight: FloatArray | BoolArray, rows: FloatArray) -> FloatArray:
    """Return ``sum_m weight rows rows^T``, (n, b, 3, 3), of weights (n, b, m), rows (n, m, 3)."""
    n, m, _ = rows.shape
    outer = (rows[:, :, :, None] * rows[:, :, None, :]).reshape(n, m, 9)
    return np.asarray(weight.astype(np.float64) @ outer).reshape(n, weight.shape[1], 3, 3)


def _solved(
    differences: DoubleDifferences,
    ranges_m: FloatArray,
    used: BoolArray,
    gain: FloatArray,
    regular: BoolArray,
) -> FixedBaselines:
    """Apply the gain, and withhold baselines that lack differences or geometry."""
    count = (used & ~differences.is_reference[:, None, :]).sum(axis=2)
    b_n_m = (gain @ np.where(used, ranges_m, 0.0)[..., None])[..., 0]
    withheld = (count < 3) | ~regular
    b_n_m[withheld] = np.nan
    gain[withheld] = 0.0
    return FixedBaselines(
        b_n_m=b_n_m,
        gain=gain,
        link_variance_m2=differences.phase_variance_m2,
    )
