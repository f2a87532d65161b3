"""Solutions of receivers: fixes of antennas, and baselines from antenna to antenna."""

from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias

import numpy as np

from fgnav.checks import BadInputError, FloatArray, freeze, freeze_times
from fgnav.types.instruments import Samples

Measured: TypeAlias = Literal["vector", "direction", "heading"]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True, repr=False)
class Fixes(Samples):
    """A receiver's own solution of one antenna, where raw data are absent.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
    antenna : str
        Name of the antenna it speaks of.
    p_n_m : ndarray, shape (k, 3)
    v_n_mps : ndarray, shape (k, 3), or None
    position_sigma_m : ndarray, shape (k, 3)
        Standard deviations north, east, down.
    velocity_sigma_mps : ndarray, shape (k, 3), or None
    unstated : tuple of str
        Those of the two sigmas, ``"position"`` and ``"velocity"``, that are a usual figure, not the
        receiver's.
    """

    columns: ClassVar = ("t_s", "p_n_m", "v_n_mps", "position_sigma_m", "velocity_sigma_mps")
    t_s: FloatArray
    antenna: str
    p_n_m: FloatArray
    v_n_mps: FloatArray | None
    position_sigma_m: FloatArray
    velocity_sigma_mps: FloatArray | None
    unstated: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        shape = (freeze_times("fixes", self), 3)
        freeze("fixes", self, {"position_sigma_m": shape})
        if not (self.position_sigma_m > 0).all():
            raise BadInputError("fixes position_sigma_m: must be positive")
        freeze("fixes", self, {"p_n_m": shape})
        if (self.v_n_mps is None) != (self.velocity_sigma_mps is None):
            raise BadInputError("fixes velocity_sigma_mps: goes with velocities, and only then")
        if self.v_n_mps is not None and self.velocity_sigma_mps is not None:
            freeze("fixes", self, {"velocity_sigma_mps": shape})
            if not (self.velocity_sigma_mps > 0).all():
                raise BadInputError("fixes velocity_sigma_mps: must be positive")
            freeze("fixes", self, {"v_n_mps": shape})


@dataclass(frozen=True, eq=False, slots=True, kw_only=True, repr=False)
class Baseline(Samples):
    """The vector from one antenna to another as a receiver has it, or its direction, or heading.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
    antennas : tuple of str
        Names of the antenna it starts at, and of that it leads to.
    vector_n_m : ndarray, shape (k, 3)
        North, east, down; of length one where the length is not measured, and level where the
        heading alone is.
    covariance_m2 : ndarray, shape (k, 3, 3)
        Of a direction or heading, rad2: the part across it counts.
    measured : {"vector", "direction", "heading"}
        What of the vector the receiver measured: all of it, heading and pitch, or heading alone.
    unstated : tuple of str
        ``("baseline",)`` where the covariance is a usual figure, not the receiver's.
    """

    columns: ClassVar = ("t_s", "vector_n_m", "covariance_m2")
    t_s: FloatArray
    antennas: tuple[str, str]
    vector_n_m: FloatArray
    covariance_m2: FloatArray
    measured: Measured = "vector"
    unstated: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        k = freeze_times("baseline", self)
        freeze("baseline", self, {"vector_n_m": (k, 3), "covariance_m2": (k, 3, 3)})
        if self.antennas[0] == self.antennas[1]:
            raise BadInputError(f"baseline antennas: must be two, got {self.antennas[0]!r} twice")
        wrong = np.linalg.norm(self.vector_n_m[:, :2], axis=1) == 0
        if self.measured == "vector":
            wrong = np.linalg.norm(self.vector_n_m, axis=1) == 0
        if wrong.any():
            raise BadInputError(f"baseline vector_n_m: no length at row {int(np.argmax(wrong))}")
        if k and not (np.linalg.eigvalsh(self.covariance_m2)[:, 0] > 0).all():
            raise BadInputError("baseline covariance_m2: must be positive definite")

    @property
    def heading_rad(self) -> FloatArray:
        """Azimuth of the vector, (k,), from north towards east."""
        return np.arctan2(self.vector_n_m[:, 1], self.vector_n_m[:, 0])

    @property
    def heading_sigma_rad(self) -> FloatArray:
        """1-sigma of it, (k,)."""
        north, east, _ = self.vector_n_m.T
        gradient = np.stack([-east, north], axis=1) / (north**2 + east**2)[:, None]
        P = self.covariance_m2[:, :2, :2]
        return np.asarray(np.sqrt(np.einsum("ki,kij,kj->k", gradient, P, gradient)))
