"""A receiver on the ground, as the flight's base: it stands still and sees the same satellites."""

from collections.abc import Mapping

import msgspec
import numpy as np

from fgnav.progress import watched_by
from fgnav.types.flight import Base
from fgnav.types.orbits import BroadcastOrbits, PreciseOrbits
from fgnav_sim.gnss.receiver import observe
from fgnav_sim.gnss.tables import GnssTable, Point
from fgnav_sim.motion import Motion, Straight
from fgnav_sim.scenario import Scenario


def stand(
    point: Point,
    sensor: GnssTable,
    scenario: Scenario,
    orbits: BroadcastOrbits | PreciseOrbits,
    *,
    messages: BroadcastOrbits | None,
    satellite_cycles: Mapping[tuple[str, str], float],
    rng: np.random.Generator,
) -> Base:
    """Return the observations of a receiver at the base, with a clock and noise of its own.

    Parameters
    ----------
    sensor : GnssTable
        Of the vehicle's receivers; the base is of the same make, its antenna looks up and its front
        north, and nothing disturbs it but noise and echoes from anywhere.
    orbits, messages : as in ``observe``
    satellite_cycles : mapping
        ``Received.satellite_cycles`` of the vehicle: the same satellites send to both.

    Raises
    ------
    BadInputError
        If no satellite is above the mask there at any time.
    """
    still = msgspec.structs.replace(
        scenario,
        origin=point,
        motion=Motion(path=Straight(speed_mps=0.0)),
        flown=None,
        antennas_b_m=((0.0, 0.0, 0.0),),
        gnss=None,
        photodetector=None,
    )
    undisturbed = msgspec.structs.replace(
        sensor, choose="all", antenna_noise=(), slips=None, loss_of_lock=None,
        outages=(), body_mask=None, reflectors=(), base=None,
    )  # fmt: skip
    with watched_by(lambda _: None):  # the share done is the vehicle's
        received = observe(
            undisturbed,
            still,
            orbits,
            messages=messages,
            satellite_cycles=satellite_cycles,
            rng=rng,
        )
    return Base(position_e_m=point.frame.p_e_m, observations=received.observations)
