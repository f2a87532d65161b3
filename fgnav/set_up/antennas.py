"""Whether the antennas sit where the flight says: the phases of a rigid array can tell.

Where the stated shape fits no epoch, others are tried: two antennas exchanged, one left out.
"""

import numpy as np

from fgnav.identification.array.displaced import (
    RIGHT,
    WRONG,
    best_shape,
    epochs_of_shapes,
    fitting,
    omissions,
    position_by_others,
)
from fgnav.identification.array.exchanged import exchanges
from fgnav.set_up.findings import Finding
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight

_NOTABLE_M = 0.05


def antenna_findings(flight: Flight, differences: DoubleDifferences) -> list[Finding]:
    """Return which antennas are not where they are said to be, empty if all are."""
    part = differences[epochs_of_shapes(differences)]
    stated = fitting(part)
    if stated >= WRONG or not len(part.t_s):
        return []
    names = [antenna.name for antenna in flight.antennas]
    places_b_m = np.stack([antenna.position_b_m for antenna in flight.antennas])
    evidence = f"the stated places fit {100 * stated:.0f} % of {len(part.t_s)} epochs"
    swapped = best_shape(exchanges(places_b_m, part))
    alone = best_shape(omissions(part))
    if max(swapped[0], alone[0]) < RIGHT or max(swapped[0], alone[0]) < 2 * stated:
        text = (
            f"{evidence}; neither an exchange of two nor leaving one out mends it; "
            "check position_b_m of all"
        )
        return [Finding(name="antennas misplaced", text=text)]
    if swapped[0] >= alone[0]:
        i, j = swapped[1]
        text = (
            f"{names[i]} and {names[j]} look exchanged: {evidence}, exchanged "
            f"{100 * swapped[0]:.0f} %; exchange their observations or position_b_m"
        )
        return [Finding(name="antennas exchanged", text=text)]
    (a,) = alone[1]
    text = f"{names[a]} is not at its place: {evidence}, without it {100 * alone[0]:.0f} %"
    return [Finding(name="antenna misplaced", text=text + _where(flight, differences, a))]


def _where(flight: Flight, differences: DoubleDifferences, antenna: int) -> str:
    """Say where a misplaced antenna is, seen from the others; nothing where they cannot tell."""
    place_b_m = position_by_others(flight, differences, antenna)
    if place_b_m is None:
        return "; check its position_b_m"
    stated_b_m = flight.antennas[antenna].position_b_m
    off_m = float(np.linalg.norm(place_b_m - stated_b_m))
    if np.linalg.norm(place_b_m + stated_b_m) < min(off_m / 4, _NOTABLE_M):
        return "; its position_b_m has the wrong sign"
    shown = ", ".join(f"{x:.2f}" for x in np.round(place_b_m, 2) + 0.0)
    return f"; its phases put it {off_m:.2f} m away, at position_b_m = [{shown}]"
