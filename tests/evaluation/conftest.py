"""A flight whose truth is known in closed form, and estimators whose errors are chosen."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.geometry import rotations
from fgnav.geometry.earth import Origin
from fgnav.types.differences import DoubleDifferences
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight, Truth
from tests.attitude.arrays import sky, synthetic

MADRID = Origin(latitude_rad=0.704, longitude_rad=-0.068, height_m=700.0)

PHASE_M = 0.003
L1_M = 0.190293672798


def true_state(t_s: FloatArray) -> Truth:
    """Return a level turn at constant rate: yaw 0.3 rad/s, an arc of 100 m/s."""
    yaw = 0.3 * t_s
    zero = np.zeros_like(t_s)
    v_n_mps = 100 * np.stack([np.cos(yaw), np.sin(yaw), zero], axis=1)
    p_n_m = 100 / 0.3 * np.stack([np.sin(yaw), 1 - np.cos(yaw), zero], axis=1)
    R_nb = rotations.from_euler(zero + 0.1, zero - 0.2, yaw)
    return Truth(t_s=t_s, p_n_m=p_n_m, v_n_mps=v_n_mps, R_nb=R_nb)


@dataclass(frozen=True)
class Off:
    """An estimator off by a chosen body tangent (or one per epoch), position and velocity."""

    name: str
    tangent_b_rad: Any = (0.0, 0.0, 0.0)
    position_m: float | None = None
    t_s: FloatArray = field(default_factory=lambda: np.arange(0, 10, 0.1))
    more: dict[str, Any] = field(default_factory=dict)

    def __call__(self, flight: Flight) -> Estimate:  # noqa: ARG002
        real = true_state(self.t_s)
        tangent = np.broadcast_to(np.asarray(self.tangent_b_rad), (len(self.t_s), 3))
        shift = np.array([0.0, 0.0, self.position_m or 0.0])
        return Estimate(
            **{
                "method": self.name,
                "t_s": self.t_s,
                "n_epochs": len(self.t_s),
                "R_nb": real.R_nb @ rotations.exp(tangent),
                "p_n_m": None if self.position_m is None else real.p_n_m + shift,
                "v_n_mps": None if self.position_m is None else real.v_n_mps + 2 * shift,
                **self.more,
            }
        )


@dataclass(frozen=True)
class Lost:
    """An estimator that never has an answer."""

    name: str = "lost"

    def __call__(self, flight: Flight) -> Estimate:  # noqa: ARG002
        raise NoSolutionError("yaw: not in the data")


def differences_of(
    R_nb: FloatArray, baselines_b_m: FloatArray, rng: np.random.Generator, satellites: int = 6
) -> DoubleDifferences:
    """Return differences of one group with exact phases, whole numbers of cycles aside."""
    antennas_b_m = np.vstack([np.zeros(3), baselines_b_m])
    e_n = sky(satellites, rng)
    return synthetic(R_nb, e_n, rng, antennas_b_m=antennas_b_m, sine=True, noise=0.0)[0]


@pytest.fixture
def flight() -> Flight:
    """Return ten seconds with truth at 10 Hz and no sensor at all."""
    return Flight(
        name="turn", start_gps_s=1e9, origin=MADRID, truth=true_state(np.arange(0, 10.05, 0.1))
    )
