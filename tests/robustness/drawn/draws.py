"""What faults have in common: when they strike, and how such things are drawn."""

from collections.abc import Callable
from typing import Any

import numpy as np

from fgnav.geometry import rotations
from fgnav.types.flight import Flight

Change = Callable[[Flight, np.random.Generator], tuple[Flight, str]]
DURATION_S = 12.0  # of flights


def span(t_s: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, str]:
    """Return which samples a fault strikes: all, those from some time on, or some seconds."""
    kind, from_s = int(rng.integers(3)), rng.uniform(2.0, 0.7 * DURATION_S)
    until_s = from_s + rng.uniform(1.0, 6.0)
    if kind == 0:
        return np.ones(len(t_s), dtype=bool), "throughout"
    if kind == 1:
        return t_s >= from_s, f"from {from_s:.1f} s"
    return (t_s >= from_s) & (t_s < until_s), f"{from_s:.1f} to {until_s:.1f} s"


def choice(rng: np.random.Generator, options: Any) -> Any:
    """Return one of some."""
    return options[int(rng.integers(len(options)))]


def sign(rng: np.random.Generator) -> float:
    """Return one or minus one."""
    return float(rng.choice([-1.0, 1.0]))


def turn(rng: np.random.Generator, angle_rad: float) -> np.ndarray:
    """Return a rotation about any axis."""
    axis = rng.normal(size=3)
    return rotations.exp((axis / np.linalg.norm(axis) * angle_rad)[None])[0]
