"""Attitude from vectors known in two frames: the paper's least squares, Wahba's problem."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, freeze
from fgnav.geometry.rotations import exp, log, skew
from fgnav.types.estimate import open_angle_variance_rad2

_COLLINEAR = 1e-6  # second over first singular value; rounding leaves 1e-15, any real array > 1e-3
_STEP = 1e-5  # of a vector's length: a central difference rounds to 1e-11 of it and curves by less
_INDIFFERENT = 1e-2  # sine below which a common direction cannot set the body upright
_NORTH, _DOWN = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class VectorPairs:
    """The same vectors in local and in body axes, epoch by epoch."""

    # Vectors, each pair in a unit of its own (m of a baseline, 1 of a direction); NaN where an
    # epoch lacks the pair.
    v_n: FloatArray  # (n, k, 3)
    v_b: FloatArray  # (n, k, 3)
    # One over the variance of a component of ``v_n - R_nb v_b``, in that unit. With equal weights
    # vectors count with the square of their length.
    weight: FloatArray  # (n, k)
    # Where each vector comes from: ``"baseline a2"``, ``"gravity"``, ``"velocity"``, ``"line of
    # sight"``.
    sources: tuple[str, ...]

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        k = len(self.sources)
        freeze("vector pairs", self, {"v_n": (None, k, 3)}, gaps=True)
        freeze("vector pairs", self, {"v_b": self.v_n.shape}, gaps=True)
        freeze("vector pairs", self, {"weight": self.v_n.shape[:2]})
        if (self.weight < 0).any():
            smallest = self.weight.min()
            raise BadInputError(f"vector pairs weight: must not be negative, got {smallest:g}")

    @property
    def valid(self) -> BoolArray:
        """Mask of the pairs that have a length in both frames, (n, k)."""
        lengths = np.minimum(_length(self.v_n), _length(self.v_b))[..., 0]  # NaN if either is
        return np.asarray((lengths > 0) & (self.weight > 0))

    def where(self, keep: BoolArray) -> "VectorPairs":
        """Return the pairs that ``keep``, (n, k), names, the others absent."""
        return replace(self, v_b=np.where(keep[..., None], self.v_b, np.nan))

    def scatter(self, rows: IntArray, epochs: int) -> "VectorPairs":
        """Return the pairs at some rows of so many epochs, none at the others."""
        v_n, v_b = np.full((2, epochs, *self.v_n.shape[1:]), np.nan)
        weight = np.zeros((epochs, len(self.sources)))
        v_n[rows], v_b[rows], weight[rows] = self.v_n, self.v_b, self.weight
        return VectorPairs(v_n=v_n, v_b=v_b, weight=weight, sources=self.sources)

    def directions(self) -> "VectorPairs":
        """Return the pairs as unit vectors of equal weight, as the paper takes them (Eq. 19)."""
        with np.errstate(invalid="ignore", divide="ignore"):
            keep = self.valid[..., None]
            v_n = np.where(keep, self.v_n / _length(self.v_n), np.nan)
            v_b = np.where(keep, self.v_b / _length(self.v_b), np.nan)
        ones = np.ones_like(self.weight)
        return VectorPairs(v_n=v_n, v_b=v_b, weight=ones, sources=self.sources)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class VectorAttitude:
    """Attitude that vector pairs determine, and how far they do."""

    R_nb: FloatArray  # (n, 3, 3): rotations; NaN where an epoch has no vector at all
    # 2 where the attitude is determined, 1 where all vectors are collinear and the rotation about
    # them is a convention, 0 without vectors.
    rank: IntArray  # (n,)
    # Unit vector of that undetermined rotation where the rank is 1, else NaN.
    open_axis_b: FloatArray  # (n, 3)

    def with_open_axis(self, covariance_rad2: FloatArray) -> FloatArray:
        """Return a covariance, (n, 3, 3), about open axes that of a uniform angle."""
        axis_b = np.where((self.rank == 1)[:, None], self.open_axis_b, 0.0)
        about = axis_b[:, :, None] * axis_b[:, None, :]
        across = np.eye(3) - about
        return np.asarray(across @ covariance_rad2 @ across + open_angle_variance_rad2() * about)


def stacked(parts: Sequence[VectorPairs]) -> VectorPairs:
    """Return pairs of the same epochs, one part after the other."""
    return VectorPairs(
        v_n=np.concatenate([pairs.v_n for pairs in parts], axis=1),
        v_b=np.concatenate([pairs.v_b for pairs in parts], axis=1),
        weight=np.concatenate([pairs.weight for pairs in parts], axis=1),
        sources=tuple(source for pairs in parts for source in pairs.sources),
    )


def paper_matrix(pairs: VectorPairs) -> FloatArray:
    """Return the paper's (n, 3, 3) matrix T_nb of unit vectors, which is not quite a rotation.

    ``T = N_n N_b^T (N_b N_b^T)^-1`` (Eqs. 18-20) [1]_ maps body to local axes; the paper prints the
    counterpart, built on ``N_n N_n^T``, that maps the other way. Where the body vectors span only a
    plane, as two always do, the cross product of their principal combinations joins them; of two
    vectors that is Eq. 18. NaN where they do not span a plane.

    References
    ----------
    .. [1] Neural Networks for Estimating Attitude, Line of Sight, and GNSS Ambiguity Through
       Onboard Sensor Fusion, Sensors, 2025, Eqs. 18-20.
    """
    units = pairs.directions()
    M = attitude_profile(units)
    v_b = np.where(units.valid[..., None], units.v_b, 0.0)
    G = v_b.swapaxes(1, 2) @ v_b
    squares, axes = np.linalg.eigh(G)  # ascending
    spans = squares > _COLLINEAR**2 * squares[:, 2:].clip(1e-300)
    planar = spans[:, 1] & ~spans[:, 0]
    normal_b = np.cross(axes[:, :, 2], axes[:, :, 1])
    normal_n = np.cross(*(np.einsum("nij,nj->ni", M, axes[:, :, c]) for c in (2, 1)))
    normal_n /= _length(normal_n).clip(1e-300)
    extra_b = np.where(planar[:, None], normal_b, 0.0)
    M = M + normal_n[:, :, None] * extra_b[:, None, :]
    G = G + extra_b[:, :, None] * extra_b[:, None, :]
    G[~spans[:, 1]] = np.eye(3)
    T = M @ np.linalg.inv(G)
    T[~spans[:, 1]] = np.nan
    return np.asarray(T)


def wahba(pairs: VectorPairs) -> VectorAttitude:
    """Return the rotations that minimise ``sum weight |v_n - R_nb v_b|^2``: Wahba's problem.

    By singular value decomposition [1]_. Collinear vectors leave the rotation about them open; it
    is then set by ``upright``.

    References
    ----------
    .. [1] F. L. Markley, Attitude determination using vector observations and the singular value
       decomposition, Journal of the Astronautical Sciences 36(3), 1988.
    """
    B = attitude_profile(pairs)
    U, s, Vt = np.linalg.svd(B)
    handed = np.linalg.det(U) * np.linalg.det(Vt)
    # Markley: the optimum is unique when the second singular value outweighs a flipped third.
    determined = s[:, 1] + handed * s[:, 2] > _COLLINEAR * s[:, 0]
    rank = np.where(s[:, 0] > 0, 1 + determined, 0)
    R_nb = np.concatenate([U[:, :, :2], U[:, :, 2:] * handed[:, None, None]], axis=2) @ Vt
    open_axis_b = np.full((len(B), 3), np.nan)
    single = rank == 1
    # The sign of a singular vector is arbitrary, that of the axis does not matter.
    open_axis_b[single] = Vt[single, 0]
    R_nb[single] = upright(R_nb[single], Vt[single, 0])
    R_nb[rank == 0] = np.nan
    return VectorAttitude(R_nb=R_nb, rank=rank, open_axis_b=open_axis_b)


def attitude_profile(pairs: VectorPairs) -> FloatArray:
    """Return ``sum weight v_n v_b^T``, (n, 3, 3), over the pairs each epoch has."""
    keep = pairs.valid[..., None]
    v_n = np.where(keep, pairs.v_n * pairs.weight[..., None], 0.0)
    return np.asarray(v_n.swapaxes(1, 2) @ np.where(keep, pairs.v_b, 0.0))


def collinear(v_b: FloatArray) -> bool:
    """Return True if vectors, (k, 3), lie on one line, so that no epoch of them is determined."""
    squares = np.linalg.eigvalsh(v_b.T @ v_b)
    return bool(squares[1] <= _COLLINEAR * squares[2])


def sensitivity(solve: Callable[[VectorPairs], FloatArray], pairs: VectorPairs) -> FloatArray:
    """Return (n, k, 3, 3): change of the body-axes tangent per change of each ``v_n``, first order.

    With ``S_k`` these matrices and ``C_kl`` the covariances between errors of ``v_n - R_nb v_b``,
    the attitude's covariance is ``sum_kl S_k C_kl S_l^T``, of any solution: by central differences.
    Zero for absent pairs.

    Parameters
    ----------
    solve : callable
        From pairs to rotations, (n, 3, 3); NaN where there is none.
    """
    steps = _STEP * _length(pairs.v_n)[..., 0]
    S = np.zeros((*pairs.v_n.shape, 3))
    for k, axis in np.ndindex(pairs.v_n.shape[1:]):
        step = np.zeros_like(pairs.v_n)
        step[:, k, axis] = steps[:, k]
        before, after = (solve(replace(pairs, v_n=pairs.v_n + shift)) for shift in (-step, step))
        has = pairs.valid[:, k] & np.isfinite(before[:, 0, 0]) & np.isfinite(after[:, 0, 0])
        rotation = log(before[has].swapaxes(1, 2) @ after[has])
        S[has, k, :, axis] = rotation / (2 * steps[has, k, None])
    return S


def upright(R_nb: FloatArray, axis_b: FloatArray) -> FloatArray:
    """Turn rotations about body axes, (n, 3), that are open: the convention for what nothing tells.

    Until z_b is nearest down (zero roll with a baseline along x_b) and, where that is indifferent,
    until x_b is nearest north (zero yaw with gravity alone).
    """
    to_down, reach = _turn(R_nb, axis_b, _DOWN, _DOWN)
    to_north, _ = _turn(R_nb, axis_b, _NORTH, _NORTH)
    return np.asarray(np.where((reach > _INDIFFERENT)[:, None, None], to_down, to_north))


def _turn(
    R_nb: FloatArray, axis_b: FloatArray, body: FloatArray, towards_n: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return rotations turned about body axes so that a body vector is nearest to a local one.

    Also how much that turn matters, (n,): the amplitude of their cosine.
    """
    K = skew(axis_b)
    along = np.einsum("i,nij,njk,k->n", towards_n, R_nb, K @ K, body)
    across = np.einsum("i,nij,njk,k->n", towards_n, R_nb, K, body)
    # Rodrigues: the cosine is constant - along cos(angle) + across sin(angle).
    angle = np.arctan2(across, -along)[:, None]
    return R_nb @ exp(angle * axis_b), np.hypot(along, across)


def _length(v: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(v, axis=-1, keepdims=True))
