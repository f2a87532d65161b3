"""Double differences of drawn epochs, their true integers, and the convention networks learn."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.types.differences import DoubleDifferences
from fgnav_sim.data_sets.epochs import ArrayEpochs

_APART_S = 3600.0  # from one run to the next: no method may connect them


def double_differences_of(epochs: ArrayEpochs) -> DoubleDifferences:
    """Return the double differences of epochs, as ``fgnav.gnss.difference`` takes them.

    The reference of a group is its highest satellite. Runs follow each other in time, an hour
    apart, wherever on Earth they were. A slot whose satellite changes is named by its number:
    ``"G#2"``.
    """
    array_b_m = epochs.antennas_b_m
    reference = _references(epochs)
    occupied = epochs.satellites != ""
    usable = occupied & (reference[:, epochs.group] >= 0)
    return DoubleDifferences(
        t_s=_times_s(epochs),
        baselines_b_m=array_b_m[1:] - array_b_m[0],
        satellites=_names(epochs),
        signals=epochs.signals,
        wavelength_m=epochs.wavelength_m,
        group=epochs.group,
        reference=reference,
        e_n=np.where(usable[..., None], epochs.e_n, 0.0),
        elevation_rad=np.where(usable, epochs.elevation_rad, np.nan),
        code_m=_against(epochs.code_m, reference, epochs.group),
        phase_m=_against(epochs.phase_m, reference, epochs.group),
        code_variance_m2=np.where(usable, epochs.code_sigma_m**2, 1.0),
        phase_variance_m2=np.where(usable, epochs.phase_sigma_m**2, 1.0),
        arc=_arcs(epochs, reference, usable),
    )


def true_cycles(epochs: ArrayEpochs, differences: DoubleDifferences) -> IntArray:
    """Return the integers in ``differences.phase_m``, (n, b, m); 0 without phase, at references."""
    cycles = _against(epochs.integers.astype(np.float64), differences.reference, epochs.group)
    return np.where(np.isfinite(differences.phase_m), cycles, 0.0).astype(np.int64)


def _references(epochs: ArrayEpochs) -> IntArray:
    """Return the highest satellite of each group, (n, g); -1 where a group has fewer than two."""
    height = np.where(np.isnan(epochs.elevation_rad), -np.inf, epochs.elevation_rad)
    out = np.empty((len(epochs), int(epochs.group.max()) + 1), dtype=np.int64)
    for g in range(out.shape[1]):
        members = np.flatnonzero(epochs.group == g)
        has_two = np.isfinite(height[:, members]).sum(axis=1) >= 2
        out[:, g] = np.where(has_two, members[height[:, members].argmax(axis=1)], -1)
    return out


def _against(links: FloatArray, reference: IntArray, group: IntArray) -> FloatArray:
    """Return double differences, (n, b, m), of links (n, a, m)."""
    single = links[:, 1:] - links[:, :1]
    of = reference[:, group]
    of_reference = np.take_along_axis(single, of.clip(0)[:, None], axis=2)
    return np.asarray(np.where(of[:, None] >= 0, single - of_reference, np.nan))


def _times_s(epochs: ArrayEpochs) -> FloatArray:
    """Return times that increase, (n,)."""
    first = _begins(epochs)
    begin = np.flatnonzero(first)[np.cumsum(first) - 1]
    since_s = epochs.t_s - epochs.t_s[begin]
    return np.asarray((since_s.max() + _APART_S) * (np.cumsum(first) - 1) + since_s)


def _begins(epochs: ArrayEpochs) -> BoolArray:
    """Return where another run begins, (n,)."""
    return np.asarray(np.diff(epochs.run, prepend=epochs.run[0] - 1) != 0)


def _names(epochs: ArrayEpochs) -> tuple[str, ...]:
    """Return a name of each slot: its satellite's if it is always the same one."""
    first = epochs.satellites[0]
    same = (epochs.satellites == first).all(axis=0)
    letters = ["".join({name[:1] for name in column}) for column in epochs.satellites.T]
    return tuple(
        str(name) if alike and name else f"{letter}#{k + 1}"
        for k, (name, alike, letter) in enumerate(zip(first, same, letters, strict=True))
    )


def _arcs(epochs: ArrayEpochs, reference: IntArray, usable: BoolArray) -> IntArray:
    """Return numbers of arcs, (n, b, m): new where run, satellite or reference is another."""
    of = reference[:, epochs.group].clip(0)
    of_reference = np.take_along_axis(epochs.satellites, of, axis=1)
    new = np.broadcast_to(_begins(epochs)[:, None], usable.shape).copy()
    new[1:] |= epochs.satellites[1:] != epochs.satellites[:-1]
    new[1:] |= of_reference[1:] != of_reference[:-1]
    arc = np.where(usable, np.cumsum(new, axis=0) - 1, -1)
    return np.repeat(arc[:, None], epochs.code_m.shape[1] - 1, axis=1)
