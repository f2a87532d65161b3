"""Flights of rigid bodies in six degrees of freedom."""

from dataclasses import dataclass, field

import numpy as np

from fgnav.checks import BadInputError, FloatArray, frozen, positive
from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import from_euler, quaternion_wxyz, skew
from fgnav_sim.vehicle.atmosphere import FLOOR_M, Air
from fgnav_sim.vehicle.forces import SIZE, SPIN, P, Q, V, W
from fgnav_sim.vehicle.model import Attitude, pack
from fgnav_sim.vehicle.planet import WGS84, FieldModel, Planet
from fgnav_sim.vehicle.rigid_body_kernel import fly, rates
from fgnav_sim.vehicle.tables import Vehicle


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Launch:
    """How a flight starts."""

    origin: Origin  # North, east, down are those of this place
    v_n_mps: FloatArray  # (3,); velocity against the Earth
    # (3,); roll, pitch, yaw of the body, 3-2-1; of its forebody where that rolls freely
    euler_rad: FloatArray
    w_ib_b_radps: FloatArray  # (3,); angular rate against inertial space, body axes
    spin_radps: float = 0.0  # of a decoupled rear body about +x_b, against inertial space
    # (3,); where the centre of mass is, from there
    position_n_m: FloatArray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        """Freeze the vectors; start within the table of the atmosphere."""
        for name in ("v_n_mps", "euler_rad", "w_ib_b_radps", "position_n_m"):
            object.__setattr__(self, name, frozen(name, getattr(self, name), (3,)))
        if not np.isfinite(self.spin_radps):
            raise BadInputError(f"spin_radps: must be finite, got {self.spin_radps}")
        if self.origin.height_m < FLOOR_M:
            raise BadInputError(
                f"height_m: must not be below {FLOOR_M:g}, got {self.origin.height_m:g}"
            )

    def state(self, planet: Planet = WGS84) -> FloatArray:
        """Return the state of the compiled code, (SIZE,)."""
        R_in = self.origin.R_ne.T
        y = np.zeros(SIZE)
        y[P : P + 3] = planet.p_e_m(self.origin) + R_in @ self.position_n_m
        y[V : V + 3] = R_in @ self.v_n_mps + np.cross(planet.rate_i_radps, y[P : P + 3])
        R_nb = from_euler(*self.euler_rad[:, None])[0]
        y[Q : Q + 4] = quaternion_wxyz((R_in @ R_nb)[None])[0]
        y[W : W + 3] = self.w_ib_b_radps
        y[SPIN] = self.spin_radps
        return y


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Plan:
    """How a flight is integrated."""

    duration_s: float
    step_s: float = 1e-3  # at most; it divides the interval of rows
    row_interval_s: float = 0.01  # between the rows that are kept
    gravity: FieldModel = "wgs84-normal"
    ground_m: float = FLOOR_M  # ellipsoidal height at which a flight ends
    commands: Attitude | None = None  # roll, pitch, yaw for an autopilot, against north, east, down
    planet: Planet = WGS84

    def __post_init__(self) -> None:
        """Check the times."""
        for name in ("duration_s", "step_s", "row_interval_s"):
            positive(name, getattr(self, name))
        if self.step_s > self.row_interval_s or self.row_interval_s > self.duration_s:
            raise BadInputError(
                "step_s, row_interval_s, duration_s: must not decrease, got "
                f"{self.step_s:g}, {self.row_interval_s:g}, {self.duration_s:g}"
            )

    @property
    def steps_per_row(self) -> int:
        """How many steps lie between two rows."""
        return int(np.ceil(self.row_interval_s / self.step_s - 1e-9))

    @property
    def t_s(self) -> FloatArray:
        """Times of the rows, (m,)."""
        return (
            np.arange(int(self.duration_s / self.row_interval_s + 1e-9) + 1) * self.row_interval_s
        )


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Flown:
    """A flight above the ground in the inertial frame ``i``: the Earth's axes at ``t_s = 0``."""

    t_s: FloatArray  # (m,)
    y: FloatArray  # (m, 19); states of the compiled code
    dy: FloatArray  # (m, 19); their time derivatives
    planet: Planet = WGS84


def fly_body(vehicle: Vehicle, launch: Launch, air: Air, plan: Plan) -> Flown:
    """Integrate a flight with fixed fourth-order Runge-Kutta steps, until it meets the ground.

    Raises
    ------
    BadInputError
        If the step is too long: the canards or the integration diverge.
    """
    at_work = vehicle.canards if vehicle.autopilot is not None else None
    if at_work is not None and plan.step_s > 2.0 * at_work.lag_s:  # RK4 is stable up to 2.8
        raise BadInputError(
            f"step_s: must be at most twice the canards' lag_s {at_work.lag_s:g}, "
            f"got {plan.step_s:g}; take a shorter step"
        )
    t_s, steps = plan.t_s, plan.steps_per_row
    model = pack(vehicle, air, (plan.gravity, plan.planet), plan.commands, t_s[-1])
    y = np.empty((len(t_s), SIZE))
    y[0] = launch.state(plan.planet)
    count = fly(model, plan.row_interval_s / steps, steps, plan.ground_m, y)
    if count < 0:
        raise BadInputError(
            f"step_s: the integration diverges with {plan.step_s:g} before "
            f"t_s = {t_s[-count]:g}; take a shorter step"
        )
    t_s, y = t_s[:count], y[:count]
    dy = np.empty_like(y)
    rates(model, t_s, y, dy)
    return Flown(t_s=t_s, y=y, dy=dy, planet=plan.planet)


def rotations_of(wxyz: FloatArray) -> FloatArray:
    """Return (m, 3, 3) rotations of quaternions, (m, 4)."""
    w, v = wxyz[:, 0, None, None], wxyz[:, 1:]
    K = skew(v)
    norm = np.sum(wxyz**2, axis=1)[:, None, None]
    return np.asarray(np.eye(3) + 2 * (w * K + K @ K) / norm)
