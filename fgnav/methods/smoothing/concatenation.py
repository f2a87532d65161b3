"""Estimates of one flight, one after another in time, as one."""

from dataclasses import fields, replace
from typing import Any

import numpy as np

from fgnav.checks import Unused
from fgnav.methods.smoothing.estimates import ROUGH
from fgnav.types.estimate import Estimate


def no_keyframes(method: str) -> Estimate:
    """Return the estimate of a stream at a time when no keyframe is due."""
    return Estimate(method=method, t_s=np.empty(0), n_epochs=0, R_nb=np.empty((0, 3, 3)))


def among(estimate: Estimate, from_s: float, until_s: float) -> Estimate:
    """Return an estimate's epochs from a time on and before another."""
    rows = (estimate.t_s >= from_s) & (estimate.t_s < until_s)
    arrays: dict[str, Any] = {name: getattr(estimate, name)[rows] for name in _by_epoch(estimate)}
    verdicts = (
        verdict
        for verdict in estimate.verdicts
        if verdict.from_s < until_s and verdict.until_s >= from_s
    )
    return replace(estimate, **arrays, verdicts=tuple(verdicts))


def concatenate_estimates(parts: list[Estimate], epochs: int, keyframes: int) -> Estimate:
    """Return estimates of times that follow each other as one, of so many epochs and keyframes.

    What is not of epochs is the last one's, who saw all of the flight with the noise known last,
    NIS included, but for verdicts: they are those of all. It has converged if all have. Keyframes
    left out are counted again.
    """
    last = parts[-1]
    names = [n for n in _by_epoch(last) if all(getattr(e, n) is not None for e in parts)]
    arrays: dict[str, Any] = {n: np.concatenate([getattr(e, n) for e in parts]) for n in names}
    left_out = keyframes - len(arrays["t_s"])
    unused = tuple(entry for entry in last.unused if entry.reason != ROUGH)
    if left_out:
        unused = (*unused, Unused(what="keyframe", reason=ROUGH, count=left_out))
    converged = all(e.converged for e in parts)
    verdicts = tuple(dict.fromkeys(verdict for estimate in parts for verdict in estimate.verdicts))
    return replace(
        last,
        **arrays,
        n_epochs=epochs,
        converged=converged,
        unused=unused,
        verdicts=verdicts,
    )


def _by_epoch(estimate: Estimate) -> list[str]:
    """Return the fields that have a row for each epoch."""
    values = {field.name: getattr(estimate, field.name) for field in fields(estimate)}
    return [name for name, value in values.items() if isinstance(value, np.ndarray)]
