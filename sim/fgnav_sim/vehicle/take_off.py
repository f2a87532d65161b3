"""Scenarios that a rigid body flies: from their tables to motion."""

from typing import TypeAlias

import msgspec
import numpy as np

from fgnav.checks import BadInputError, FloatArray, Unused
from fgnav_sim.scenario import Scenario
from fgnav_sim.vehicle.atmosphere import dryden
from fgnav_sim.vehicle.flown_motion import flown_motion
from fgnav_sim.vehicle.flown_table import FlownTable
from fgnav_sim.vehicle.forces import PATH
from fgnav_sim.vehicle.model import NO_GUST
from fgnav_sim.vehicle.rigid_body import ROW_INTERVAL_S, fly_body

Airborne: TypeAlias = tuple[Scenario, tuple[Unused, ...]]  # with known motion; parts not flown


def take_off(scenario: Scenario, rng: np.random.Generator) -> Airborne:
    """Fly the rigid body of a scenario; what is commanded stays as it is.

    A flight that meets the ground ends there: its duration becomes shorter, and says so.

    Parameters
    ----------
    rng : Generator
        For gusts.

    Raises
    ------
    BadInputError
        If a step is too long, or the flight meets the ground at once.
    """
    table = scenario.flown
    if table is None:
        return scenario, ()
    table = msgspec.structs.replace(table, gravity=table.gravity or scenario.gravity)
    origin, interval_s = scenario.origin.frame, max(ROW_INTERVAL_S, table.step_s)
    rows = np.ceil(scenario.duration_s / interval_s - 1e-9) + 2  # beyond: receivers' clocks err
    try:
        gust_mps = _gusts(table, rng)
        flown = fly_body(table, origin, float(rows * interval_s), gust_mps=gust_mps)
    except BadInputError as error:
        raise BadInputError(f"flown.{error}") from None
    motion = flown_motion(flown, origin)
    last_s, path_m = float(flown.t_s[-1]), float(flown.y[-1, PATH])
    unused = []
    if last_s < scenario.duration_s:
        reason = f"the body met the ground after {last_s:.2f} s"
        unused.append(Unused(what="landing", reason=reason, count=1))
    if table.gusts is not None and path_m > table.gusts.length_m:
        reason = f"gusts end after {table.gusts.length_m:g} of {path_m:.0f} m through the air"
        unused.append(Unused(what="gusts", reason=reason, count=1))
    changes = {"motion": motion, "flown": None, "duration_s": min(last_s, scenario.duration_s)}
    return msgspec.structs.replace(scenario, **changes), tuple(unused)


def _gusts(table: FlownTable, rng: np.random.Generator) -> FloatArray:
    """Return gusts along the way at the start, or along the nose."""
    start, gusts = table.start, table.gusts
    if gusts is None:
        return NO_GUST
    v_n_mps = start.velocity_n_mps
    return dryden(
        rng,
        sigma_mps=gusts.sigma_mps,
        direction_n=v_n_mps if v_n_mps.any() else start.R_nb[:, 0],
        length_m=gusts.length_m,
        scale_m=gusts.scale_m,
    )
