"""Cost of training, estimated: a few timed steps of every network in the place of all."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

_HOUR_S = 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """Of one network."""

    name: str
    parameters: int
    steps: int
    step_s: float  # of one

    @property
    def training_s(self) -> float:
        """Of all steps, without validations."""
        return self.steps * self.step_s


_COSTS: ContextVar[list[Cost] | None] = ContextVar("costs", default=None)


@contextmanager
def planned() -> Iterator[list[Cost]]:
    """Let ``train`` take a few steps of each network within, and collect what all would cost."""
    costs: list[Cost] = []
    token = _COSTS.set(costs)
    try:
        yield costs
    finally:
        _COSTS.reset(token)


def costs_of_plan() -> list[Cost] | None:
    """Return where costs are collected; None outside of a plan."""
    return _COSTS.get()


def cost_lines(costs: Sequence[Cost], device: str, rest_s: float) -> list[str]:
    """Return a line for each network, and the sum.

    Parameters
    ----------
    rest_s : float
        Wall time of all but training: data, validation, release.
    """
    lines = [
        f"{cost.name}: {cost.parameters:,} parameters, {cost.steps:,} steps of "
        f"{1e3 * cost.step_s:.3g} ms, {cost.training_s / _HOUR_S:.3g} h"
        for cost in costs
    ]
    total_h = sum(cost.training_s for cost in costs) / _HOUR_S
    return [
        *lines,
        f"in all {total_h:.3g} h of {device} for {len(costs)} networks, and {rest_s:.3g} s for "
        "data, one validation of each and what follows training",
    ]
