"""The released gravity networks as estimators of fgnav: ``--gravity network``."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, Loss, positive
from fgnav.gnss.single_point.solution import code_solution
from fgnav.gravity import GravityDirection
from fgnav.types.flight import Flight, Imu
from fgnav_models.gravity_features import (
    SAMPLES,
    SPAN_S,
    STEP_S,
    course_motion,
    differenced,
    domain_values,
    windows,
)
from fgnav_models.runtime.load import Model, load

_SAME_SPAN = 0.1  # relative; of the two velocities that are differenced
_SAME = 1e-6  # relative to the interval
_NO_WINDOW = f"the accelerometer has no {SAMPLES} samples, {STEP_S:g} s apart or less, before it"


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkGravity:
    """Gravity in body axes by a released network, where its declared domain allows.

    A body that flies nose first, as in training: nothing in its measurements betrays one that does
    not. Errors of neighbouring answers are alike, so answers are thinned to the time after which
    they may be taken as independent.

    Attributes
    ----------
    network : str or Path
        ``"gravity"`` sees a receiver's velocities, too; ``"gravity-accelerometer"`` does not.
    interval_s : float or None
        Between answers; None: what was measured for the network, its domain's
        ``independent_after_s``. Answers that are closer are right one by one, too sure together.
    name : str
    """

    network: str | Path = "gravity"
    interval_s: float | None = None
    name: str = "network"

    def __post_init__(self) -> None:
        """Reject an interval that is zero or negative."""
        if self.interval_s is not None:
            positive(f"{self.name} gravity interval_s", self.interval_s)

    def __call__(self, flight: Flight) -> GravityDirection:
        """Estimate; times outside the domain have no answer and are counted.

        Raises
        ------
        BadInputError
            If the flight has no accelerometer, or no velocities where the network needs them.
        """
        if flight.imu is None:
            raise BadInputError(f"flight {flight.name}: {self.name} gravity needs an [imu]")
        model = load(self.network)
        domain = model.manifest.domain
        interval_s = self.interval_s or float(domain["independent_after_s"])
        if any(port.name == "motion" for port in model.manifest.inputs):
            seen = _aided(flight, flight.imu, domain, self.name)
        else:
            seen = _alone(flight.imu, interval_s)
        rows, losses = _usable(seen, domain, interval_s)
        motion = None if seen.motion is None else seen.motion[rows]
        g_b, covariance = answers(model, seen.f_b_mps2[rows], motion)
        return GravityDirection(t_s=seen.t_s[rows], g_b=g_b, covariance=covariance, losses=losses)


AccelerometerGravity = partial(
    NetworkGravity, network="gravity-accelerometer", name="network-accelerometer"
)


def answers(
    model: Model, f_b_mps2: FloatArray, motion: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors, (n, 3), and their covariance, (n, 3, 3), from a network's inputs.

    The covariance lies across the vector, of rank two; in any two axes across it is the 2 by 2
    covariance of the tangent plane.
    """
    if not len(f_b_mps2):
        return np.zeros((0, 3)), np.zeros((0, 3, 3))
    inputs: dict[str, FloatArray] = {"f_b_mps2": f_b_mps2.astype(np.float32)}
    if motion is not None:
        inputs["motion"] = motion.astype(np.float32)
    told = model(**inputs)
    g_b = told["g_b"].astype(np.float64)
    g_b /= np.linalg.norm(g_b, axis=1, keepdims=True)
    across = np.eye(3) - g_b[:, :, None] * g_b[:, None, :]
    return g_b, across @ told["covariance"].astype(np.float64) @ across


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Seen:
    """What a network is to see at times, (n,), and by reason whether it may, (n,) each."""

    t_s: FloatArray
    f_b_mps2: FloatArray
    motion: FloatArray | None
    sound: dict[str, BoolArray]


def _alone(imu: Imu, interval_s: float) -> _Seen:
    first_s = imu.t_s[0] + (SAMPLES - 1) * STEP_S
    t_s = np.arange(first_s, imu.t_s[-1] + STEP_S / 2, interval_s)
    f_b_mps2, covered = windows(imu, t_s)
    return _Seen(t_s=t_s, f_b_mps2=f_b_mps2, motion=None, sound={_NO_WINDOW: covered})


def _aided(flight: Flight, imu: Imu, domain: dict[str, Any], name: str) -> _Seen:
    told = _velocities(flight, name)
    velocity, acceleration = differenced(told.t_s, told.v_n_mps)
    t_s, span_s = told.t_s[1:-1], told.t_s[2:] - told.t_s[:-2]
    f_b_mps2, covered = windows(imu, t_s)
    arm_m = float(np.linalg.norm(told.arm_b_m - imu.position_b_m))
    noisiest_mps = domain["velocity_noise_mps"][1]
    sound = {
        f"velocities are those of an antenna {arm_m:.3g} m from the accelerometer": np.full(
            len(t_s), arm_m <= domain["arm_m"][1]
        ),
        f"velocities are noisier than {noisiest_mps:g} m/s": told.sigma_mps[1:-1] <= noisiest_mps,
        f"velocities before and after are not {SPAN_S:g} s apart": (
            np.abs(span_s / SPAN_S - 1) <= _SAME_SPAN
        ),
        _NO_WINDOW: covered,
    }
    motion = course_motion(velocity, acceleration)
    return _Seen(t_s=t_s, f_b_mps2=f_b_mps2, motion=motion, sound=sound)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Velocities:
    """Velocities, (n, 3), their largest standard deviation, (n,), and where they were measured."""

    t_s: FloatArray
    v_n_mps: FloatArray
    sigma_mps: FloatArray
    arm_b_m: FloatArray


def _velocities(flight: Flight, name: str) -> _Velocities:
    fixes = flight.fixes
    if flight.observations is not None:
        code, antenna = code_solution(flight), flight.antennas[0]
        t_s, v_n_mps, covariance = code.t_s, code.v_n_mps, code.velocity_covariance_m2ps2
        if v_n_mps is not None and covariance is not None:
            sigma_mps = np.sqrt(np.einsum("nii->ni", covariance).max(axis=1))
            return _told(t_s, v_n_mps, sigma_mps, antenna.position_b_m)
    elif fixes is not None and fixes.v_n_mps is not None and fixes.velocity_sigma_mps is not None:
        sigma_mps = fixes.velocity_sigma_mps.max(axis=1)
        arm_b_m = flight.antenna(fixes.antenna).position_b_m
        return _told(fixes.t_s, fixes.v_n_mps, sigma_mps, arm_b_m)
    raise BadInputError(
        f"flight {flight.name}: {name} gravity needs velocities, of Doppler or of fixes; "
        "network-accelerometer needs none"
    )


def _told(
    t_s: FloatArray, v_n_mps: FloatArray, sigma_mps: FloatArray, arm_b_m: FloatArray
) -> _Velocities:
    there = np.isfinite(v_n_mps).all(axis=1)
    return _Velocities(
        t_s=t_s[there], v_n_mps=v_n_mps[there], sigma_mps=sigma_mps[there], arm_b_m=arm_b_m
    )


def _usable(
    seen: _Seen, domain: dict[str, Any], interval_s: float
) -> tuple[IntArray, tuple[Loss, ...]]:
    """Return the rows to answer: sound, in the domain, an interval apart; and what is lost."""
    sound = dict(seen.sound)
    for name, value in domain_values(seen.f_b_mps2, seen.motion).items():
        low, high = domain[name]
        what = name.replace("_", " ")
        inside = (value >= low) & (value <= high)
        sound[f"{what} outside {low:.4g} to {high:.4g}, the network's domain"] = inside
    usable, lost = np.ones(len(seen.t_s), dtype=np.bool_), {}
    for reason, well in sound.items():
        lost[reason] = int((usable & ~well).sum())
        usable &= well
    rows = np.flatnonzero(usable)
    t_s = seen.t_s[rows]
    _, first = np.unique(np.floor((t_s - t_s[:1]) / interval_s + _SAME), return_index=True)
    lost[f"within {interval_s:g} s of another: their errors are alike"] = len(rows) - len(first)
    losses = (Loss(what="gravity answer", reason=r, count=n) for r, n in lost.items() if n)
    return rows[first], tuple(losses)
