"""The whole way from a flight's observations to double differences."""

from weakref import WeakKeyDictionary

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, unused_of
from fgnav.gnss.cycle_slips.detection import phase_arcs
from fgnav.gnss.single_differences import SingleDifferences, single_differences
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight

_CACHE: WeakKeyDictionary[Flight, dict[bool, DoubleDifferences]] = WeakKeyDictionary()


def double_differences(flight: Flight, *, causal: bool = False) -> DoubleDifferences:
    """Return the double differences of a flight; computed once per flight.

    Satellites at the time each signal left, elevation mask, unhealthy satellites out, one signal
    per constellation and carrier, arcs from slip to slip, and per epoch one reference channel per
    constellation and carrier: of those the reference antenna tracks, the one most antennas track,
    the highest of equals. A group of fewer than two channels is not usable. Epochs without any
    usable link stay, all NaN.

    Parameters
    ----------
    causal : bool
        Each epoch by epochs up to it alone, numbers of arcs included. Of a flight that is cut, the
        satellites that only come later are missing.

    Raises
    ------
    NoSolutionError
        If the flight has no observations of two antennas, or no position can be computed.
    """
    cached = _CACHE.setdefault(flight, {})
    if causal not in cached:
        single = single_differences(flight, causal=causal)
        names = tuple(antenna.name for antenna in flight.antennas)
        cached[causal] = differenced(single, names, causal=causal)
    return cached[causal]


def differenced(
    single: SingleDifferences, names: tuple[str, ...], *, causal: bool = False
) -> DoubleDifferences:
    """Return double differences of single ones, whose antennas have these names."""
    arcs = phase_arcs(single, names, causal=causal)
    reference = _references(single)
    of_reference = reference[:, single.group]  # (n, m)
    grouped = of_reference >= 0
    code_m = _against(single.code_m, of_reference)
    phase_m = _against(single.phase_m, of_reference)
    used = grouped & np.isfinite(single.elevation_rad)
    lost = single.lost.copy()
    alone = single.code_there & ~grouped[:, None]
    headless = np.isfinite(single.code_m) & np.isnan(code_m) & grouped[:, None]
    lost_of = {"only channel of its group": alone[:, 1:], "reference channel missing": headless}
    for reason, links in lost_of.items():
        for name, count in zip(names[1:], links.sum(axis=(0, 2)), strict=True):
            lost[f"{name} link", reason] += int(count)
    return DoubleDifferences(
        t_s=single.t_s,
        baselines_b_m=single.baselines_b_m,
        satellites=single.satellites,
        signals=single.signals,
        wavelength_m=single.wavelength_m,
        group=single.group,
        reference=reference,
        e_n=np.where(used[:, :, None], single.e_n, 0.0),
        elevation_rad=np.where(used, single.elevation_rad, np.nan),
        code_m=code_m,
        phase_m=phase_m,
        code_variance_m2=np.where(used, single.code_variance_m2, 1.0),
        phase_variance_m2=np.where(used, single.phase_variance_m2, 1.0),
        arc=_double_arcs(arcs.arc, of_reference, np.isfinite(phase_m)),
        unused=(*single.unused, *unused_of(lost), *arcs.unused),
    )


def _references(single: SingleDifferences) -> IntArray:
    """Return the reference channel of every group, (n, g); -1 where fewer than two channels are."""
    groups = 1 + int(single.group.max(initial=-1))
    reference = np.full((len(single.t_s), groups), -1, dtype=np.int64)
    both = single.code_there & single.phase_there
    # Antennas first; the elevation, below 1 in this scale, decides between equals.
    score = both.sum(axis=1) + single.elevation_rad / np.pi
    score = np.where(both[:, 0], score, -1.0)
    for g in range(groups):
        members = np.nonzero(single.group == g)[0]
        enough = single.code_there[:, 0, members].sum(axis=1) >= 2
        best = score[:, members].argmax(axis=1)
        enough &= score[np.arange(len(best)), members[best]] >= 0
        reference[:, g] = np.where(enough, members[best], -1)
    return reference


def _against(values: FloatArray, of_reference: IntArray) -> FloatArray:
    """Return values (n, b, m) minus those of each channel's reference; NaN where there is none."""
    reference = np.take_along_axis(values, of_reference.clip(0)[:, None], axis=2)
    return np.asarray(np.where(of_reference[:, None] >= 0, values - reference, np.nan))


def _double_arcs(arc: IntArray, of_reference: IntArray, has_phase: BoolArray) -> IntArray:
    """Return arcs of double differences, (n, b, m), from those of links, (n, a, m).

    A new one begins when any of the four links does, or the reference channel changes: within one
    arc the integer is constant.
    """
    of_reference_channel = np.take_along_axis(arc, of_reference.clip(0)[:, None], axis=2)
    out = np.full(has_phase.shape, -1, dtype=np.int64)
    for i, j in np.ndindex(has_phase.shape[1:]):
        at = has_phase[:, i, j]
        links = (
            arc[:, 0, j],
            arc[:, i + 1, j],
            of_reference_channel[:, 0, j],
            of_reference_channel[:, i + 1, j],
            of_reference[:, j],
        )
        key = np.stack([link[at] for link in links])
        out[at, i, j] = np.cumsum((np.diff(key, axis=1, prepend=key[:, :1]) != 0).any(axis=0))
    return out
