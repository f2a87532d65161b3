"""Code and phase of all epochs as equations for positions, clocks and the constants of arcs."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss.least_squares import fit_consistent
from fgnav.gnss.single_differences import SingleDifferences
from fgnav.gnss.slips import phase_arcs

# Ionosphere, orbits and clocks of messages move phase against code: by decimetres in some minutes.
_LONGEST_ARC_S = 300.0
_LEAST = 4  # arcs that carry a position over to the next epoch


class Epochs(NamedTuple):
    """Equations of n epochs: m channels of code, then m of phase; p unknowns of an epoch.

    Unknown are three coordinates, the clocks of code and the clocks of phase, one for each carrier.
    """

    A: FloatArray  # (n, 2 m, p)
    y: FloatArray  # (n, 2 m), m
    weight: FloatArray  # (n, 2 m), 1/m2; 0 where there is nothing
    arc: IntArray  # (n, 2 m), from 0 to a - 1; a where there is no phase
    offset_m: FloatArray  # (a,): taken off the phases of each arc, so that numbers stay small
    channel: IntArray  # (a,)

    @property
    def phases(self) -> slice:
        """Which channels are of phase."""
        return slice(self.y.shape[1] // 2, None)


class Code(NamedTuple):
    """What the code of n epochs and m channels is good for."""

    there: BoolArray  # (n, m): it does not contradict the others of its epoch
    variance_m2: FloatArray  # (n, m), as large as it shows


def code_of(single: SingleDifferences) -> Code:
    """Return which code of one antenna to use, and its variance: that which it shows, or more."""
    of_code, code_m = _designs(single)[0], single.code_m[:, 0]
    variance_m2 = 2 * single.code_variance_m2
    fits, there = fit_consistent(of_code, code_m, variance_m2, np.isfinite(code_m))
    spare = fits.solved & (fits.freedom > 0)
    squares = np.where(there, fits.residual**2 / variance_m2, 0.0)[spare].sum()
    return Code(there, variance_m2 * max(1.0, squares / max(fits.freedom[spare].sum(), 1)))


def epochs_of(single: SingleDifferences, names: tuple[str, str], code: Code) -> Epochs:
    """Return the equations of single differences.

    Parameters
    ----------
    single : SingleDifferences
        Of one antenna.
    names : tuple of str
        Of base and antenna.
    code : Code
    """
    n, m = single.elevation_rad.shape
    code_m, phase_m, coded = single.code_m[:, 0], single.phase_m[:, 0], code.there
    arc = _arcs(single, names)
    count = 1 + int(arc.max(initial=0))
    # Integers are large: what is left is small once the mean of an arc's phase less code is off.
    both = (arc >= 0) & coded
    number = np.bincount(arc[both], minlength=count)
    total_m = np.bincount(arc[both], (phase_m - code_m)[both], count)
    known = (arc >= 0) & (number > 0)[arc]  # an arc without any code is of no use
    offset_m = total_m / number.clip(1)
    channel = np.zeros(count, dtype=np.int64)
    channel[arc[arc >= 0]] = np.nonzero(arc >= 0)[1]
    y = [np.where(coded, code_m, 0.0), np.where(known, phase_m - offset_m[arc], 0.0)]
    variances = ((coded, code.variance_m2), (known, 2 * single.phase_variance_m2))
    return Epochs(
        A=np.concatenate(_designs(single), axis=1),
        y=np.concatenate(y, axis=1),
        weight=np.concatenate([np.where(there, 1 / of, 0.0) for there, of in variances], axis=1),
        arc=np.concatenate([np.full((n, m), count), np.where(known, arc, count)], axis=1),
        offset_m=offset_m,
        channel=channel,
    )


def _designs(single: SingleDifferences) -> tuple[FloatArray, FloatArray]:
    """Return how code and phase follow position and clocks, (n, m, p) each."""
    groups = np.eye(1 + int(single.group.max(initial=-1)))[single.group]
    clocks = np.broadcast_to(groups, (len(single.t_s), *groups.shape))
    e_n = np.where(np.isfinite(single.e_n), single.e_n, 0.0)
    of_code = np.concatenate([-e_n, clocks, 0 * clocks], axis=2)
    return of_code, np.concatenate([-e_n, 0 * clocks, clocks], axis=2)


def _arcs(single: SingleDifferences, names: tuple[str, str]) -> IntArray:
    """Return arcs of single differences, numbered through, (n, m); long ones are cut in turn."""
    arc = phase_arcs(single, names).arc.astype(np.int64)
    n, m = arc.shape[0], arc.shape[2]
    turn = np.floor(single.t_s[:, None] / _LONGEST_ARC_S + np.arange(m) / m).astype(np.int64)
    turn -= turn.min(initial=0)
    wide = 1 + np.array([arc.max(initial=0), turn.max(initial=0)])
    key = ((arc[:, 0] * wide[0] + arc[:, 1]) * wide[1] + turn) * m + np.arange(m)
    there = (arc >= 0).all(axis=1) & np.isfinite(single.phase_m[:, 0])
    out = np.full((n, m), -1, dtype=np.int64)
    out[there] = np.unique(key[there], return_inverse=True)[1]
    return out


def pieces(arc: IntArray, group: IntArray) -> IntArray:
    """Return the number of each epoch's stretch, (n,): phase does not connect one to the next.

    Parameters
    ----------
    arc : ndarray of int, shape (n, m)
        -1 without phase.
    group : ndarray of int, shape (m,)
        Carriers.
    """
    goes_on = (arc[1:] == arc[:-1]) & (arc[1:] >= 0)
    groups = np.stack([goes_on[:, group == g].any(axis=1) for g in np.unique(group)], axis=1)
    broken = goes_on.sum(axis=1) < _LEAST - 1 + groups.sum(axis=1)
    return np.concatenate([[0], np.cumsum(broken)])
