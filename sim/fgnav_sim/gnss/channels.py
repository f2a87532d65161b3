"""Which satellites and signals may be received, of those that the orbits know."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav.gnss.orbits.satellites import look_angles, satellite_states
from fgnav.types.orbits import BroadcastOrbits, PreciseOrbits
from fgnav_sim.gnss.constellation import satellites_of
from fgnav_sim.gnss.tables import GnssTable
from fgnav_sim.scenario import Scenario

_SCAN_S = 30.0  # a satellite climbs less than _MARGIN_RAD meanwhile
_MARGIN_RAD = np.radians(0.5)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Channels:
    """Signals of satellites; ``at`` is each channel's place among ``in_view``, the satellites."""

    in_view: tuple[str, ...]
    at: IntArray
    satellites: tuple[str, ...]
    signals: tuple[str, ...]


def channels_in_view(
    sensor: GnssTable, scenario: Scenario, orbits: BroadcastOrbits | PreciseOrbits, t_s: FloatArray
) -> Channels:
    """Return the wanted signals of satellites that may come above the mask.

    Raises
    ------
    BadInputError
        If there are none, or orbits say nothing of the time.
    """
    in_view = _in_view(sensor, scenario, orbits, t_s)
    rows = [(k, name, s) for k, name in enumerate(in_view) for s in sensor.signals[name[0]]]
    return Channels(
        in_view=in_view,
        at=np.array([k for k, _, _ in rows]),
        satellites=tuple(name for _, name, _ in rows),
        signals=tuple(signal for _, _, signal in rows),
    )


def empty_sky(sensor: GnssTable) -> BadInputError:
    """Return the error that there is nothing to receive."""
    return BadInputError(
        f"gnss: no satellite of {', '.join(sensor.signals)} above receiver_mask_deg "
        f"{sensor.receiver_mask_deg:g} at this place and time"
    )


def places_e_m(scenario: Scenario, t_s: FloatArray) -> FloatArray:
    """Return where the body is, (n, 3)."""
    return scenario.origin.frame.to_e(scenario.motion(t_s).p_n_m)


def _in_view(
    sensor: GnssTable, scenario: Scenario, orbits: BroadcastOrbits | PreciseOrbits, t_s: FloatArray
) -> tuple[str, ...]:
    """Return the satellites of the wanted constellations that may come above the mask."""
    wanted = satellites_of(orbits, sensor.signals)
    scan_s = np.append(np.arange(t_s[0], t_s[-1], _SCAN_S), t_s[-1])
    states = satellite_states(orbits, wanted, np.repeat(scan_s[:, None], len(wanted), axis=1))
    _, elevation_rad, _ = look_angles(places_e_m(scenario, scan_s), states.p_e_m)
    if np.isnan(elevation_rad).all():
        raise BadInputError(
            f"gnss: navigation and orbits know no satellite of {', '.join(sensor.signals)} at "
            f"{scenario.start.isoformat()}; name files of that date"
        )
    lowest_rad = np.radians(sensor.receiver_mask_deg) - _MARGIN_RAD
    above = (elevation_rad > lowest_rad).any(axis=0)
    if not above.any():
        raise empty_sky(sensor)
    return tuple(name for name, is_above in zip(wanted, above, strict=True) if is_above)
