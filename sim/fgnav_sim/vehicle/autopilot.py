"""Attitude autopilot, compiled: four canards turn a body to commanded Euler angles, no more."""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.kernels.compiled import kernel
from fgnav_sim.vehicle.forces import (
    FINS,
    Body,
    Flow,
    Frame,
    Vector,
    added,
    canard,
    cross,
    rotate_back,
)  # fmt: skip

_LEAST_PRESSURE_PA = 10.0  # below this canards have nothing to hold on to, and rest


@kernel
def commanded(body: Body, tables: FloatArray, t: float) -> tuple[Vector, Vector]:
    """Return the commanded roll, pitch, yaw and their rates: cubic between the table's rows."""
    h = body.command_interval_s
    x = min(max(t / h, 0.0), body.commands - 1.0)
    k = max(min(int(x), body.commands - 2), 0)  # where x is no number, too
    x, a = x - k, body.command + 6 * k
    b = a + 6
    s, c, m = x * x * (3 - 2 * x), x * (1 - x) * (1 - x) * h, x * x * (x - 1) * h
    ds, dc, dm = 6 * x * (1 - x) / h, (1 - x) * (1 - 3 * x), x * (3 * x - 2)
    rise = (tables[b] - tables[a], tables[b + 1] - tables[a + 1], tables[b + 2] - tables[a + 2])
    angle = (tables[a], tables[a + 1], tables[a + 2])
    before = (tables[a + 3], tables[a + 4], tables[a + 5])
    after = (tables[b + 3], tables[b + 4], tables[b + 5])
    angle = added(added(added(angle, rise, s), before, c), after, m)
    rate = added(added((ds * rise[0], ds * rise[1], ds * rise[2]), before, dc), after, dm)
    return angle, rate


@kernel
def attitude_demand(
    body: Body, tables: FloatArray, t: float, R_ib: Frame, ned: Frame, w_b: Vector
) -> Vector:
    """Return the angular acceleration in body axes that brings the attitude to the commanded one.

    A second-order servo on the rotation between both; command rates enter as body rates.
    """
    (roll, pitch, yaw), (roll_rate, pitch_rate, yaw_rate) = commanded(body, tables, t)
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    sy, cy = np.sin(yaw), np.cos(yaw)
    columns = (
        (cy * cp, sy * cp, -sp),
        (cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
        (cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr),
    )
    error = (0.0, 0.0, 0.0)  # sum of actual x commanded axes: twice the sine of the angle
    actual = ((R_ib[0][0], R_ib[1][0], R_ib[2][0]), (R_ib[0][1], R_ib[1][1], R_ib[2][1]),
              (R_ib[0][2], R_ib[1][2], R_ib[2][2]))  # fmt: skip
    for axis in range(3):
        error = added(error, cross(actual[axis], rotate_back(ned, columns[axis])), 0.5)
    rate = (
        roll_rate - yaw_rate * sp,
        pitch_rate * cr + yaw_rate * cp * sr,
        yaw_rate * cp * cr - pitch_rate * sr,
    )
    f = body.frequency_radps
    lag = added(rate, w_b, -1.0)
    return added(added((0.0, 0.0, 0.0), rotate_back(R_ib, error), f * f), lag, 2 * body.damping * f)


@kernel
def deflections(
    body: Body,
    slope: float,
    centre_m: float,
    flow: Flow,
    demand: Vector,
    y: FloatArray,
    dy: FloatArray,
) -> None:
    """Write the canards' rates: towards the deflections that make the demanded moment, limited."""
    arm = body.canard_station_m - centre_m
    holds = body.frequency_radps > 0.0 and flow[1] > _LEAST_PRESSURE_PA and slope > 0.0
    for fin in range(4):
        target = 0.0
        if holds:
            hinge, _, _, incidence = canard(body, fin, centre_m, flow)
            push = demand[0] / (4 * body.canard_arm_m)
            push -= (demand[1] * hinge[1] + demand[2] * hinge[2]) / (2 * arm)
            target = incidence + push / (flow[1] * body.canard_m2 * slope)
        target = min(max(target, -body.deflection_rad), body.deflection_rad)
        rate = (target - y[FINS + fin]) / body.lag_s
        dy[FINS + fin] = min(max(rate, -body.rate_radps), body.rate_radps)
