"""What all benchmarks share: the rows of their table, and how long a piece of work takes."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any, TypeAlias

import numpy as np

from fgnav.checks import FloatArray

Row: TypeAlias = dict[str, Any]
ROOT = Path(__file__).resolve().parents[2]
# Recordings and published tables; a benchmark without those it needs has no rows.
DATA = ROOT / (os.environ.get("FGNAV_SHARED") or "../shared") / "data"
KEYS = ("name", "ours", "peer", "ratio", "unit", "note")


def row(
    name: str, ours: float, peer: float | None, unit: str, note: str, *, less: bool = False
) -> Row:
    """Return a row; its ratio is above 1 where ours is larger or, with ``less``, smaller."""
    ratio = None
    if peer is not None:
        above, below = (peer, ours) if less else (ours, peer)
        peer, ratio = float(peer), float(above / below) if below else None
    return dict(zip(KEYS, (name, float(ours), peer, ratio, unit, note), strict=True))


def timed(
    works: Sequence[Callable[[], object]], rounds: int, clock: Callable[[], float] = perf_counter
) -> FloatArray:
    """Return seconds of pieces of work that take turns, (rounds, works), after one to compile."""
    seconds = np.empty((rounds + 1, len(works)))
    for own in seconds:
        for k, work in enumerate(works):
            start_s = clock()
            work()
            own[k] = clock() - start_s
    return seconds[1:]
