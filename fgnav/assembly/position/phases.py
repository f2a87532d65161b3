"""Phases of antennas in the graph: their live arcs, and against a base their integers and slips."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.assembly.position.base_integers import BaseIntegers, with_integers
from fgnav.assembly.position.live_arcs import LiveRows, live_rows
from fgnav.assembly.position.numbered_arcs import EarlierArcs, Observed
from fgnav.checks import FloatArray
from fgnav.gnss.undifferenced import Undifferenced
from fgnav.graph.factors.antenna_phase import AntennaPhase
from fgnav.graph.types.parameters import Parameters
from fgnav.messages import note
from fgnav.types.estimate import Rejected
from fgnav.types.integers import ArcInteger


class Phases(NamedTuple):
    """Phases of antennas at keyframes, None where there are none, and what is reported of them."""

    phase: AntennaPhase | None
    goes_on: EarlierArcs | None = None  # of one antenna without a base: for epochs to come
    notes: tuple[str, ...] = ()
    arcs: tuple[ArcInteger, ...] = ()
    rejections: tuple[Rejected, ...] = ()


def antenna_phase(
    observed: tuple[Observed, ...],
    t_s: FloatArray,
    R_nb: FloatArray,
    constants: Parameters,
    *,
    causal: bool = False,
    earlier: EarlierArcs | None = None,
) -> Phases:
    """Return the phases of antennas at keyframes.

    Parameters
    ----------
    observed : tuple of Observed
    t_s : ndarray, shape (n,)
        Keyframes.
    R_nb : ndarray, shape (n, 3, 3)
        Attitudes that wind up phases.
    constants : Parameters
    causal : bool
        Whether integers against a base hold only after they are fixed.
    earlier : EarlierArcs, optional
        Rows are of epochs after it.
    """
    rejections: list[Rejected] = []
    live = live_rows(observed, t_s, R_nb, earlier)
    resolved: BaseIntegers | None = None
    if any(observation.of.integers for observation in observed):
        resolved = with_integers(live, t_s, causal=causal)
        while resolved.slips:
            observed, noted = _parted(observed, t_s, live, resolved)
            rejections += noted
            live = live_rows(observed, t_s, R_nb, earlier)
            resolved = with_integers(live, t_s, causal=causal)
    if not live.row:
        return Phases(None, live.goes_on)
    phase = AntennaPhase(
        row=np.array(live.row, dtype=np.int64),
        rows=live.rows,
        block=np.array(live.block, dtype=np.int64),
        blocks=live.blocks,
        first_block=live.first_block,
        arm_b_m=np.array(live.arms_b_m),
        constants=constants,
    )
    if resolved is None:
        return Phases(phase, live.goes_on)
    return Phases(
        replace(phase, blocks=resolved.blocks),
        live.goes_on,
        _notes(live, resolved),
        resolved.arcs,
        tuple(rejections),
    )


def _parted(
    observed: tuple[Observed, ...], t_s: FloatArray, live: LiveRows, resolved: BaseIntegers
) -> tuple[tuple[Observed, ...], list[Rejected]]:
    """Return observations whose arcs begin again where they slipped, and what is reported."""
    k, block = live.row[resolved.epoch], live.block[resolved.epoch]
    names, out, noted = live.names[block], list(observed), []
    for slip in resolved.slips:
        link = names.link[slip.arc]
        for index, part in enumerate(out):
            channels = zip(part.of.satellites, part.of.signals, strict=True)
            labels = [f"{part.antenna} {satellite} {signal}" for satellite, signal in channels]
            epoch = part.epoch[part.row == k]
            if link in labels and len(epoch):
                of = _begun_again(part.of, labels.index(link), int(epoch[0]), slip.cycles)
                out[index] = part._replace(of=of)
        noted.append(
            Rejected(
                what="phase",
                link=link,
                from_s=float(t_s[k]),
                until_s=float(t_s[k]),
                reason=f"slipped by {slip.cycles:+.1f} cycles: its arc begins again",
            )
        )
    return tuple(out), noted


def _begun_again(of: Undifferenced, m: int, epoch: int, cycles: float) -> Undifferenced:
    """Return observations whose channel m has a new arc, half a cycle that it slipped taken off."""
    arc, phase_m = of.arc.copy(), of.phase_m.copy()
    later = np.flatnonzero(of.arc[:, m] == of.arc[epoch, m])
    later = later[later >= epoch]
    arc[later, m] = arc.max() + 1
    halves = np.rint(2 * cycles)
    phase_m[later, m] -= (halves % 2) / 2 * of.wavelength_m[m]
    return replace(of, arc=arc, phase_m=phase_m)


def _notes(live: LiveRows, resolved: BaseIntegers) -> tuple[str, ...]:
    percent, chance = 100 * resolved.fixed[live.block].mean(), ""
    if percent:
        chance = f", wrong with a probability of {resolved.wrong_probability:.1g}"
    return (note("I206", percent=percent, chance=chance),)
