"""Residuals of GNSS observations, satellite by satellite."""

from collections.abc import Iterator, Sequence

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.evaluation.comparison import Comparison, Method
from fgnav.evaluation.reference import common_epochs
from fgnav.evaluation.report.parts import Blocks, folded, number, paragraph, table
from fgnav.evaluation.scores import EULER, finite_mean, hidden
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight

_EXPLANATION = (
    "RMS over all epochs. The array's phase less what the attitude makes of it, whole cycles taken "
    "off, over all baselines; the code of the first antenna less what the position makes of it, "
    "clocks of each epoch taken off. One satellite far above the others is an echo, a wrong "
    "orbit, or a noise that its signal does not have."
)
_ByChannel = dict[str, float]


def satellite_blocks(flight: Flight, comparison: Comparison) -> Blocks:
    """Return tables of residuals by satellite; empty without observations."""
    differences = comparison.double_differences
    array = {} if differences is None else dict(_of_array(differences, comparison.solved))
    tables = (
        *_table("phase of the array", "mm", 1e3, array),
        *_table("code of the first antenna", "m", 1.0, dict(_of_code(flight, comparison.solved))),
    )
    explained = paragraph(_EXPLANATION) + list(tables) if tables else []
    return folded("residuals by satellite", explained)


def _of_array(
    differences: DoubleDifferences, methods: Sequence[Method]
) -> Iterator[tuple[str, _ByChannel]]:
    """Yield what each attitude leaves of the array's phase.

    Less the nearest whole cycles: a wrong attitude cannot hide behind wrong integers. The mean of
    a group is taken off each baseline, so that noise of the reference is not in all others.
    """
    for method in methods:
        estimate = method.solution
        if hidden(estimate) & set(EULER):
            continue
        rows, answers = common_epochs(differences.t_s, estimate.t_s)
        some = differences[rows]
        left_m = some.phase_m - some.array_m(estimate.R_nb[answers])
        left_m -= some.wavelength_m * np.round(left_m / some.wavelength_m)
        _take_off_means(left_m, some.group)
        left_m[np.broadcast_to(~(some.elevation_rad > 0)[:, None], left_m.shape)] = np.nan
        yield method.name, _rms(some.satellites, some.signals, left_m.reshape(-1, len(some.group)))


def _of_code(flight: Flight, methods: Sequence[Method]) -> Iterator[tuple[str, _ByChannel]]:
    """Yield what each position leaves of the first antenna's code."""
    from fgnav.gnss.undifferenced import undifferenced  # noqa: PLC0415  # lazy: brings numba

    placed = [
        (method.name, method.solution, method.solution.p_n_m)
        for method in methods
        if "position" not in hidden(method.solution)
    ]
    if flight.observations is None or not placed:
        return
    try:
        observed = undifferenced(flight)
    except NoSolutionError:  # too few satellites: then no method has a position by them either
        return
    arm_b_m = flight.antennas[0].position_b_m
    for name, estimate, p_n_m in placed:
        if p_n_m is None:
            continue
        rows, answers = common_epochs(observed.t_s, estimate.t_s)
        antenna_n_m = p_n_m[answers] + estimate.R_nb[answers] @ arm_b_m
        baseline_n_m = antenna_n_m - observed.place_n_m[rows]
        left_m = observed.code_m[rows] + np.einsum("kmi,ki->km", observed.e_n[rows], baseline_n_m)
        _take_off_means(left_m[:, None], observed.group)
        yield name, _rms(observed.satellites, observed.signals, left_m)


def _take_off_means(left_m: FloatArray, group: IntArray) -> None:
    """Take the mean over the channels of each group off, (n, b, m)."""
    for each in np.unique(group):
        members = group == each
        left_m[:, :, members] -= finite_mean(left_m[:, :, members], 2)[:, :, None]


def _rms(satellites: Sequence[str], signals: Sequence[str], left_m: FloatArray) -> _ByChannel:
    """Return RMS by channel of residuals, (k, m)."""
    names = map(" ".join, zip(satellites, signals, strict=True))
    rms = np.sqrt(finite_mean(left_m**2, 0)).tolist()
    return {name: value for name, value in zip(names, rms, strict=True) if np.isfinite(value)}


def _table(title: str, unit: str, scale: float, of: dict[str, _ByChannel]) -> Blocks:
    channels = sorted({channel for rms in of.values() for channel in rms})
    rows = [
        [channel, *(number(scale * rms.get(channel, np.nan)) for rms in of.values())]
        for channel in channels
    ]
    return table(["channel", *(f"{name}, {unit}" for name in of)], rows, f"{title}: RMS, {unit}")
